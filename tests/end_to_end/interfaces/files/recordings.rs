//! Recordings that other people's libraries wrote, and what we write for them to read.

use crate::common::room;
use std::path::{Path, PathBuf};
use std::process::Command;
use tessera_sources::{FrameBuffers, Source, SourceOptions, SourceSpec};

const FRAMES: u64 = 12;

const PACKAGES: [&str; 9] = [
    "rosbags==0.11.9",
    "mcap==1.6.0",
    "mcap-protobuf-support==0.6.0",
    "mcap-ros2-support==0.6.0",
    "foxglove-schemas-protobuf==0.4.0",
    "protobuf",
    "rvl==1.0.4",
    "pillow",
    "numpy",
];

fn python() -> Option<PathBuf> {
    crate::common::python("recordings", &PACKAGES)
}

fn run_script(python: &Path, name: &str, arguments: &[&Path]) -> String {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/end_to_end/interfaces/files").join(name);
    let output = Command::new(python).arg(script).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn open(path: &Path) -> Box<dyn Source> {
    tessera_sources::open(&SourceSpec::parse(path.to_str().unwrap()), &SourceOptions::default())
        .unwrap_or_else(|error| panic!("{error}"))
}

/// Stamp, depth in metres and colour of a frame.
fn frame(source: &dyn Source, index: u64) -> (i64, Vec<f64>, Vec<u8>) {
    let camera = source.camera();
    let n = (camera.width * camera.height) as usize;
    let (mut depth, mut colour) = (vec![0; n], vec![0; 3 * n]);
    let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut colour };
    let info = source.read(index, &mut buffers).unwrap();
    assert!(info.has_colour, "frame {index}");
    let metres = depth.iter().map(|&raw| f64::from(raw) / camera.units_per_metre).collect();
    (info.stamp_nanos, metres, colour)
}

fn command(arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_tessera")).args(arguments).output().unwrap();
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat();
    (output.status.code(), text)
}

#[test]
fn recordings_of_other_libraries_are_the_folder_that_they_were_made_of() {
    let Some(python) = python() else { return };
    let run = room();
    let camera = run.dir.path().join("camera.toml");
    let folder = run.dir.path().join("frames");
    // Depth in whole millimetres, so that each recording has it exactly.
    let text = std::fs::read_to_string(&camera).unwrap().replace("5000.0", "1000.0");
    std::fs::write(&camera, text).unwrap();
    crate::common::write_folder(&folder, &camera, FRAMES);
    run_script(&python, "write_recordings.py", &[&folder, run.dir.path()]);
    let expected = open(&folder);
    let recordings = [
        "ros_raw.mcap",
        "ros_metres.mcap",
        "ros_compressed.mcap",
        "ros_rvl.mcap",
        "ros_mono_jpeg.mcap",
        "ros_sqlite_bag",
        "ros_sqlite_bag/ros_sqlite_bag.db3",
        // Compressed as a whole.
        "ros_packed_bag",
        "ros_packed_bag/ros_packed_bag.db3.zstd",
        "ros1_plain.bag",
        "ros1_bz2.bag",
        "ros1_lz4.bag",
        "ros1_pictures.bag",
        "foxglove_protobuf.mcap",
        "foxglove_json.mcap",
        "foxglove_json_lz4.mcap",
    ];
    for name in recordings {
        let found = open(&run.dir.path().join(name));
        assert_eq!(found.n_frames(), Some(FRAMES), "{name}");
        assert_eq!(found.warnings(), &[] as &[String], "{name}");
        let (a, b) = (found.camera(), expected.camera());
        assert_eq!((a.fx, a.fy, a.cx, a.cy, a.distortion), (b.fx, b.fy, b.cx, b.cy, b.distortion), "{name}");
        for index in (0..FRAMES).rev() {
            let ((stamp, depth, colour), of) = (frame(&*found, index), frame(&*expected, index));
            assert_eq!(stamp, of.0, "{name}");
            let worst = depth.iter().zip(&of.1).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            // What metres cannot hold above 13.1 m is no measurement; the room has nothing there.
            assert!(worst < 1e-4, "{name}: {worst} m");
            if !name.contains("jpeg") {
                assert!(colour == of.2, "{name}: colour of frame {index}");
            }
        }
    }

    // Through the pipeline: the same bytes as the folder.
    let n = FRAMES;
    let of_folder = room().of(&folder).frames(n).with(&["--camera", camera.to_str().unwrap()]);
    assert!(of_folder.finish().success());
    let recording = run.dir.path().join("ros_raw.mcap");
    let kills = "sensor=sent:5;align=journaled:7";
    for name in ["ros_raw.mcap", "ros_sqlite_bag", "ros1_bz2.bag"] {
        let of_recording =
            room().of(&run.dir.path().join(name)).frames(n).with(&["--camera", camera.to_str().unwrap()]);
        let of_recording = of_recording.with_faults(kills);
        assert!(of_recording.finish().success());
        assert_eq!(of_recording.n_deaths(), 2, "{}", of_recording.log());
        of_recording.assert_same_bytes(&of_folder, name);
    }

    let (code, text) = command(&["check", recording.to_str().unwrap()]);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("12 of 12 depth and 12 colour images") && text.contains("1000 a metre"), "{text}");
    // A file that was cut, and topics that were given.
    let bytes = std::fs::read(run.dir.path().join("foxglove_json.mcap")).unwrap();
    let cut = run.dir.path().join("cut.mcap");
    std::fs::write(&cut, &bytes[..bytes.len() * 4 / 5]).unwrap();
    let (code, text) = command(&["check", cut.to_str().unwrap()]);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("warning: the record at byte") && text.contains("last whole record"), "{text}");
    let topic = ["check", recording.to_str().unwrap(), "--depth-topic", "/camera/color/image_raw"];
    let (code, text) = command(&topic);
    assert_eq!(code, Some(3), "{text}");
    assert!(text.contains("encoding is 'bgr8', expected 16UC1 or 32FC1"), "{text}");
    let (code, text) = command(&["check", recording.to_str().unwrap(), "--color-topic", "/nothing"]);
    assert_eq!(code, Some(3), "{text}");
    assert!(text.contains("--color-topic TOPIC is /nothing, expected an image topic"), "{text}");
}

#[test]
fn what_is_exported_is_read_by_other_libraries() {
    let run = room().frames(20);
    assert!(run.finish().success());
    let file = run.dir.path().join("out.mcap");
    let export = |file: &Path| {
        let (run, file) = (run.out().display().to_string(), file.display().to_string());
        command(&["export", &run, "--mcap", &file, "--voxel-mm", "20"])
    };
    let (code, text) = export(&file);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("out.mcap: 20 poses") && text.contains(" points"), "{text}");
    let again = run.dir.path().join("again.mcap");
    export(&again);
    assert!(std::fs::read(&file).unwrap() == std::fs::read(&again).unwrap(), "the same run, the same bytes");
    // It has no images, and says so where it is taken for a source.
    let (code, text) = command(&["check", file.to_str().unwrap()]);
    assert_eq!(code, Some(3), "{text}");
    assert!(text.contains("no depth topic") && text.contains("no image topics"), "{text}");
    let Some(python) = python() else { return };
    let words = run_script(&python, "read_export.py", &[&file, &run.out()]);
    assert!(words.contains("read 20 poses"), "{words}");
}
