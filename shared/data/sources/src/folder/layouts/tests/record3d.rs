//! Record3D: `metadata` as its documentation says, images as Apple's own library compressed them.

use super::*;
use crate::folder::layouts::record3d::NAME;
use crate::folder::zip::tests::zipped;
use std::path::Path;

/// 32x32 px, `metres` below, compressed by liblzfse (a block `bvx2`), behind a byte of the corpus.
const DEPTH: &[u8] = include_bytes!("../../../../../../../fuzz/corpus/images/lzfse_depth");
/// 32x32 px, `column / 8 % 3` (a block `bvxn`).
const CONFIDENCE: &[u8] = include_bytes!("../../../../../../../fuzz/corpus/images/lzfse_confidence");

const SIDE: usize = 32;
const UNITS_PER_METRE: f64 = 5000.0;

/// Depth that the fixture holds.
fn metres(column: usize, row: usize) -> f64 {
    match (column, row) {
        (0, 0) => f64::NAN,
        (1, 0) => -1.0,
        (2, 0) => f64::INFINITY,
        (3, 0) => 14.0,
        (u, v) => 1.0 + 0.01 * u as f64 + 0.001 * ((7 * u + 13 * v) % 50) as f64,
    }
}

/// A colour image twice as large as depth, `K` by columns.
fn metadata(more: &str) -> String {
    format!(r#"{{"w": 64, "h": 64, "K": [62.0, 0, 0, 0, 60.0, 0, 33.0, 31.0, 1], "cameraType": 1{more}}}"#)
}

pub(super) fn recording(more: &str) -> Folder {
    let folder = Folder::new();
    folder.write("metadata", metadata(more));
    for k in [0, 1, 2, 10] {
        folder.write(&format!("rgbd/{k}.depth"), &DEPTH[1..]);
        folder.write(&format!("rgbd/{k}.conf"), &CONFIDENCE[1..]);
        folder.colour(&format!("rgbd/{k}.jpg"), (64, 64), 90);
    }
    folder
}

/// Depth and colour of a frame.
fn images(source: &FolderSource, index: u64) -> Result<(Vec<u16>, Vec<u8>), SourceError> {
    let (mut depth, mut colour) = (vec![1; SIDE * SIDE], vec![1; 3 * SIDE * SIDE]);
    let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut colour };
    source.read(index, &mut buffers)?;
    Ok((depth, colour))
}

#[test]
fn depth_confidence_colour_and_poses_are_read() {
    let half = 0.5_f64.sqrt();
    let more = format!(
        r#", "dw": 32, "dh": 32, "fps": 60, "initPose": [0, 0, 0, 1, 0, 0, 0],
        "poses": [[0, 0, 0, 1, 0.5, 0, 0], [0, {half}, 0, {half}, 0, 0.25, 0]],
        "perFrameIntrinsicCoeffs": [[60.0, 60.0, 32.0, 30.0], [61.0, 61.0, 33.0, 31.0], [64.0, 64.0, 33.0, 32.0]],
        "frameTimestamps": [7.5, 7.6, 7.55, 0, 0, 0, 0, 0, 0, 0, 8.0]"#
    );
    let folder = recording(&more);
    let source = folder.open();
    assert!(described(&source, "layout").starts_with("Record3D"));
    let camera = source.camera();
    assert_eq!((camera.width, camera.height, camera.units_per_metre), (32, 32, UNITS_PER_METRE));
    assert_eq!((camera.fx, camera.fy, camera.cx, camera.cy), (30.5, 30.5, 16.5, 15.5), "median, halved");
    // The third does not rise.
    assert_eq!(stamps(&source), [7_500_000_000, 7_600_000_000, 8_000_000_000]);
    assert!(described(&source, "times").contains("frameTimestamps"));
    let warnings = source.warnings().join("\n");
    assert!(warnings.contains("focal length changes by 6.6 %"), "{warnings}");
    assert!(warnings.contains("1 depth images have no time of their own"), "{warnings}");

    let (depth, colour) = images(&source, 2).unwrap();
    for (at, raw) in depth.iter().enumerate() {
        let (column, row) = (at % SIDE, at / SIDE);
        let units = (f64::from(metres(column, row) as f32) * UNITS_PER_METRE).round();
        let is_seen = column / 8 % 3 > 0 && units > 0.0 && units < 65535.0;
        assert_eq!(f64::from(*raw), if is_seen { units } else { 0.0 }, "column {column}, row {row}");
    }
    assert!(described(&source, "colour").contains("64x64 px, warped"), "{}", described(&source, "colour"));
    assert!(colour.iter().all(|value| value.abs_diff(90) < 4));

    // ARKit's camera looks along -z with y up: half a turn about x away from ours.
    let truth = source.ground_truth().unwrap();
    assert_eq!(truth.stamps_nanos, [7_500_000_000, 7_600_000_000]);
    let forward = |at: usize| truth.poses[at].rotation * nalgebra::Vector3::z();
    assert!((forward(0) + nalgebra::Vector3::z()).norm() < 1e-12 && truth.poses[0].translation.x == 0.5);
    assert!((forward(1) + nalgebra::Vector3::x()).norm() < 1e-12 && truth.poses[1].translation.y == 0.25);
    assert!(described(&source, "ground truth of").contains("an estimate too"));
}

/// A folder's files as the `.r3d` that it was unpacked from.
pub(super) fn packed(folder: &Folder, into: &str, is_deflated: bool) -> std::path::PathBuf {
    let file = |name: &str| fs::read(folder.path().join(name)).unwrap();
    let names: Vec<String> =
        super::super::names(&folder.path().join("rgbd")).iter().map(|name| format!("rgbd/{name}")).collect();
    let mut files = vec![("metadata", file("metadata"))];
    files.extend(names.iter().map(|name| (name.as_str(), file(name))));
    let files: Vec<(&str, &[u8])> = files.iter().map(|(name, bytes)| (*name, bytes.as_slice())).collect();
    let path = folder.path().join(into);
    fs::write(&path, zipped(&files, is_deflated, false)).unwrap();
    path
}

#[test]
fn a_recording_is_read_as_it_is() {
    let folder = recording(r#", "dw": 32, "dh": 32, "frameTimestamps": [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]"#);
    let unpacked = folder.open();
    let options = SourceOptions::default();
    for (name, is_deflated) in [("a.r3d", true), ("b.R3D", false), ("c.zip", true)] {
        let path = packed(&folder, name, is_deflated);
        let source = crate::open(&crate::SourceSpec::parse(&path.display().to_string()), &options).unwrap();
        assert_eq!((source.n_frames(), source.camera()), (Some(4), unpacked.camera()));
        assert!(source.warnings().is_empty(), "{:?}", source.warnings());
        let n = SIDE * SIDE;
        for index in 0..4 {
            let (mut depth, mut colour) = (vec![1; n], vec![1; 3 * n]);
            let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut colour };
            assert!(source.read(index, &mut buffers).unwrap().has_colour);
            assert_eq!((depth, colour), images(&unpacked, index).unwrap());
            assert!(source.inspect(index).is_ok());
            let taken = source.colour_as_taken(index).unwrap().unwrap();
            assert_eq!((taken.rgb.len(), taken.file), (64 * 64 * 3, None), "no file holds it alone");
        }
        let first = SourceOptions { frames: Some(2), skip: 1, ..SourceOptions::default() };
        let first = crate::open(&crate::SourceSpec::parse(&path.display().to_string()), &first).unwrap();
        assert_eq!((first.n_frames(), first.stamp_nanos(0)), (Some(2), unpacked.stamp_nanos(1)));
    }
}

#[test]
fn damage_of_a_packed_recording_is_named_by_file_and_name_inside() {
    let folder = recording(r#", "dw": 32, "dh": 32"#);
    let open = |path: &Path| {
        crate::open(&crate::SourceSpec::parse(&path.display().to_string()), &SourceOptions::default())
    };
    folder.write("rgbd/1.depth", &DEPTH[1..DEPTH.len() / 2]);
    let path = packed(&folder, "a.r3d", true);
    let source = open(&path).unwrap();
    let mut buffers = FrameBuffers { depth: &mut [0; SIDE * SIDE], colour: &mut [0; 3 * SIDE * SIDE] };
    let error = source.read(1, &mut buffers).unwrap_err();
    let message = error.to_string();
    assert!(error.is_of_one_frame() && message.contains("a.r3d/rgbd/1.depth"), "{message}");
    assert!(message.contains("expected a whole LZFSE stream") && source.inspect(1).is_err(), "{message}");
    assert!(source.read(2, &mut buffers).is_ok());
    let refusal = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        open(&path).err().unwrap().to_string()
    };
    let whole = fs::read(&path).unwrap();
    let message = refusal(&whole[..whole.len() / 2]);
    assert!(message.contains("a.r3d") && message.contains("is it cut short?"), "{message}");
    let message = refusal(&zipped(&[("metadata", b"{"), ("rgbd/0.depth", b"")], false, false));
    assert!(message.contains("a.r3d/metadata") && message.contains("EOF while parsing"), "{message}");
    let message = refusal(&zipped(&[("photos/1.jpg", b"")], false, false));
    assert!(message.contains("a zip file, which is not read") && message.contains("unzip"), "{message}");
    // A folder of one recording names it.
    let outer = Folder::new();
    outer.write("scan.r3d", &whole);
    assert!(outer.refusal().contains("run the file: ") && outer.refusal().contains("scan.r3d"));
}

#[test]
fn what_is_not_there_is_done_without() {
    // An older recording: no size of depth, no times, no intrinsics of each frame, no poses.
    let folder = recording(r#", "fps": 50"#);
    for k in [0, 1, 2, 10] {
        fs::remove_file(folder.path().join(format!("rgbd/{k}.conf"))).unwrap();
        fs::remove_file(folder.path().join(format!("rgbd/{k}.jpg"))).unwrap();
    }
    let source = folder.open();
    let camera = source.camera();
    assert_eq!((camera.width, camera.height), (32, 32), "by what the first image holds");
    assert_eq!((camera.fx, camera.fy, camera.cx, camera.cy), (31.0, 30.0, 16.5, 15.5), "K goes by columns");
    assert_eq!(stamps(&source), [0, 20_000_000, 40_000_000, 200_000_000]);
    assert!(source.ground_truth().is_none());
    let no_times = "metadata has no frameTimestamps: times are those of its rate (--fps)";
    assert_eq!(source.warnings(), [no_times, "no frame has colour: there are no colour images"]);
    assert!(images(&source, 0).unwrap().0[4] > 0, "no confidence, all depth");
    let slow = SourceOptions { fps: Some(10.0), ..SourceOptions::default() };
    assert_eq!(stamps(&FolderSource::open_with(folder.path(), &slow).unwrap())[1], 100_000_000);
}

#[test]
fn damage_names_the_file_what_was_found_and_what_was_expected() {
    let folder = recording(r#", "dw": 32, "dh": 32"#);
    let whole = &DEPTH[1..];
    // Twice the image in one stream: blocks of the first, then the whole second.
    let twice = [&whole[..whole.len() - 4], whole].concat();
    let table: [(&[u8], &str); 7] = [
        (b"", "begins with ''"),
        (b"\x89PNG\r\n\x1a\n", "begins with '\\x89PNG'"),
        (&whole[..whole.len() / 2], "expected a whole LZFSE stream"),
        (&whole[..whole.len() - 4], "expected a whole LZFSE stream"),
        (b"bvx9nonsense", "expected a whole LZFSE stream"),
        (&twice, "depth image holds more than 4096 bytes, expected 4096 for 32x32 px"),
        (&CONFIDENCE[1..], "depth image holds 1024 bytes, expected 4096 for 32x32 px"),
    ];
    for (bytes, expected) in table {
        folder.write("rgbd/1.depth", bytes);
        let message = images(&folder.open(), 1).unwrap_err().to_string();
        assert!(message.starts_with("frame 1, ") && message.contains("rgbd/1.depth"), "{message}");
        assert!(message.contains(expected), "{message}");
    }
    folder.write("rgbd/1.depth", whole);
    folder.write("rgbd/1.conf", whole);
    let message = images(&folder.open(), 1).unwrap_err().to_string();
    assert!(message.contains("rgbd/1.conf: confidence image holds more than 1024 bytes"), "{message}");
    // From outside, as `tessera check` looks.
    let inspect = |file: &str, bytes: &[u8]| {
        folder.write(file, bytes);
        folder.open().inspect(2).map_err(|error| error.to_string())
    };
    assert_eq!(inspect("rgbd/2.depth", whole), Ok(()));
    let cut = inspect("rgbd/2.depth", &whole[..whole.len() - 1]).unwrap_err();
    assert!(cut.contains("rgbd/2.depth") && cut.contains("no end marker in"), "{cut}");
    assert!(inspect("rgbd/2.depth", b"GIF89a").unwrap_err().contains("begins with 'GIF8'"));
}

#[test]
fn metadata_that_cannot_be_is_refused_by_name() {
    for (text, expected) in [
        ("{".to_owned(), "EOF while parsing"),
        (r#"{"w": 64, "h": 64}"#.to_owned(), "missing field `K`"),
        (metadata(r#", "dw": 0, "dh": 32"#), "image size is 0x32 px, expected 16x16 to"),
        (metadata(r#", "fps": -1"#), "fps is -1, expected 0.01 to 10000"),
        (metadata(r#", "poses": [[0, 0, 0, 7, 0, 0, 0]]"#), "pose 0 is [0.0, 0.0, 0.0, 7.0"),
        (metadata("").replace("\"h\": 64", "\"h\": 48"), "do not have the shape of colour, 64x48"),
    ] {
        let folder = recording("");
        folder.write("metadata", text);
        let message = folder.refusal();
        let path = folder.path().join("metadata").display().to_string();
        assert!(message.contains(&path) && message.contains(expected), "{message}");
    }
    let folder = recording("");
    fs::remove_dir_all(folder.path().join("rgbd")).unwrap();
    fs::create_dir(folder.path().join("rgbd")).unwrap();
    assert!(folder.refusal().contains("no depth images, expected rgbd/NUMBER.depth"));
}

/// Decompression gives no more than an image, whatever the stream says; nonsense never panics.
#[test]
fn changed_streams_are_read_or_refused() {
    let folder = recording(r#", "dw": 32, "dh": 32"#);
    let source = folder.open();
    let mut n_refused = 0;
    for at in 0..DEPTH.len() - 1 {
        let mut bytes = DEPTH[1..].to_vec();
        bytes[at] ^= 1 << (at % 8);
        folder.write("rgbd/0.depth", &bytes);
        n_refused += usize::from(images(&source, 0).is_err());
    }
    assert!(n_refused > 20, "{n_refused} of {} refused", DEPTH.len() - 1);
}

#[test]
fn an_export_with_depth_as_openexr_is_read() {
    let folder = Folder::new();
    folder.write(
        "metadata.json",
        metadata(r#", "frameTimestamps": [1, 1.02, 1.04], "poses": [[0, 0, 0, 1, 0.5, 0, 0]]"#),
    );
    for k in 0..3 {
        folder.write(&format!("depth/{k}.exr"), mutations::exr_of((32, 32), 1.5));
        folder.colour(&format!("rgb/{k}.jpg"), (64, 64), 90);
    }
    let source = folder.open();
    let camera = source.camera();
    assert_eq!((camera.width, camera.height, camera.fx, camera.cx), (32, 32, 31.0, 16.5));
    assert_eq!((stamps(&source)[1], described(&source, "layout")), (1_020_000_000, NAME.to_owned()));
    let (depth, colour) = images(&source, 2).unwrap();
    assert!(depth.iter().all(|raw| *raw == 7500) && colour[0].abs_diff(90) < 4);
    assert!(source.warnings().is_empty() && source.ground_truth().is_some() && source.inspect(1).is_ok());
}
