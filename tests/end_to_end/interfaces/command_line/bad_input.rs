//! Recordings that something is wrong with: each gets its message, and nothing is lost.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::atomic::{AtomicU32, Ordering};
use tessera_sources::{FrameBuffers, SourceOptions, SourceSpec};

/// A Kinect: what is lost on it must be found again.
const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;
const CAMERA: &str = "width = 640\nheight = 480\nfx = 525.0\nfy = 525.0\ncx = 319.5\ncy = 239.5\n\
                      units_per_metre = 5000.0\n";

/// A recording in the TUM layout, made from the simulated room.
struct Recording {
    dir: tempfile::TempDir,
}

impl Recording {
    fn new(n_frames: u64) -> Self {
        let recording = Self { dir: tempfile::tempdir().unwrap() };
        recording.write("camera.toml", CAMERA);
        for folder in ["depth", "rgb"] {
            std::fs::create_dir(recording.path(folder)).unwrap();
        }
        let camera = recording.path("camera.toml").to_str().unwrap().to_owned();
        let options =
            SourceOptions { camera: Some(camera), frames: Some(n_frames), ..SourceOptions::default() };
        let source = tessera_sources::open(&SourceSpec::parse("room"), &options).unwrap();
        let n_pixels = (WIDTH * HEIGHT) as usize;
        let (mut depth, mut colour) = (vec![0; n_pixels], vec![0; 3 * n_pixels]);
        let (mut depth_list, mut colour_list) = (String::new(), String::new());
        for index in 0..n_frames {
            source.read(index, &mut FrameBuffers { depth: &mut depth, colour: &mut colour }).unwrap();
            recording.write_depth(index, &depth);
            let image = image::RgbImage::from_raw(WIDTH, HEIGHT, colour.clone()).unwrap();
            image.save(recording.path(&format!("rgb/{index}.png"))).unwrap();
            let seconds = index as f64 / 30.0;
            writeln!(depth_list, "{seconds:.6} depth/{index}.png").unwrap();
            writeln!(colour_list, "{seconds:.6} rgb/{index}.png").unwrap();
        }
        recording.write("depth.txt", &depth_list);
        recording.write("rgb.txt", &colour_list);
        recording
    }

    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    fn replace(&self, name: &str, old: &str, new: &str) {
        let text = std::fs::read_to_string(self.path(name)).unwrap();
        assert!(text.contains(old), "{text}");
        self.write(name, &text.replacen(old, new, 1));
    }

    fn write_depth(&self, index: u64, depth: &[u16]) {
        let image =
            image::ImageBuffer::<image::Luma<u16>, _>::from_raw(WIDTH, HEIGHT, depth.to_vec()).unwrap();
        image.save(self.path(&format!("depth/{index}.png"))).unwrap();
    }

    fn run(&self, arguments: &[&str]) -> Output {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let name = format!("test-bad-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        Command::new(env!("CARGO_BIN_EXE_tessera"))
            .args(["run", "--quiet", "--set", "surface.step=4", "--name", &name, "--out"])
            .arg(self.path("out"))
            .arg(self.dir.path())
            .args(arguments)
            .output()
            .unwrap()
    }

    /// The message of a run that must be refused as unusable input.
    fn refusal(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(3), "{text}");
        assert!(text.starts_with("tessera: ") && text.matches("tessera: ").count() == 1, "{text}");
        text
    }

    /// State of each frame as `states.csv` has it.
    fn states(&self) -> Vec<String> {
        let text = std::fs::read_to_string(self.path("out/states.csv")).unwrap();
        text.lines().skip(1).map(|line| line.split(',').nth(2).unwrap().to_owned()).collect()
    }
}

fn assert_contains(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "expected {part:?} in: {text}");
    }
}

#[test]
fn lists_and_cameras_are_refused_by_file_line_and_key() {
    let recording = Recording::new(4);
    let check = |name: &str, old: &str, new: &str, parts: &[&str]| {
        let before = std::fs::read_to_string(recording.path(name)).unwrap();
        recording.replace(name, old, new);
        assert_contains(&recording.refusal(&[]), parts);
        assert!(!recording.path("out").exists(), "a refused run leaves no folder");
        recording.write(name, &before);
    };
    let (depth, second) = ("depth.txt", "0.033333 depth/1.png");
    // What can be mended is mended and stated.
    let stated = |name: &str, old: &str, new: &str, words: &str| {
        let before = std::fs::read_to_string(recording.path(name)).unwrap();
        recording.replace(name, old, new);
        let output = recording.run(&[]);
        assert!(output.status.success());
        assert_contains(&String::from_utf8(output.stderr).unwrap(), &["warning: ", words]);
        std::fs::remove_dir_all(recording.path("out")).unwrap();
        recording.write(name, &before);
    };
    stated(depth, second, "0.000000 depth/1.png", "2 of 4 stamps are not set");
    stated(depth, second, "9.000000 depth/1.png", "the stamps go back by 8.933 s");
    check(depth, second, "soon depth/1.png", &["depth.txt, line 2", "soon"]);
    check(depth, second, "0.033333 ../x.png", &["depth.txt, line 2", "expected a path inside the folder"]);
    check("camera.toml", "fx = 525.0", "fx = 0.0", &["camera.toml", "fx is 0, expected a finite number"]);
    check("camera.toml", "fx = 525.0\n", "", &["camera.toml", "missing field `fx`"]);
    check("camera.toml", "fx", "focal = 1.0\nfx", &["camera.toml", "unknown field `focal`"]);
    recording.write("imu.txt", "0.0 0.1 0 0\n0.005 0.1 0 0\n0.005 0.1 0 0\n");
    assert_contains(&recording.refusal(&[]), &["imu.txt, line 3", "is repeated, expected each once"]);
    recording.write("imu.txt", "0.0 0.1 0 inf\n");
    assert_contains(&recording.refusal(&[]), &["imu.txt, line 1", "found 'inf', expected a finite number"]);
    std::fs::remove_file(recording.path("imu.txt")).unwrap();
    let truth: String = (0..4).map(|k| format!("{:.6} 0 0 0 0 0 0 1\n", f64::from(k) / 30.0)).collect();
    recording.write("groundtruth.txt", &truth);
    let first = "0.000000 0 0 0 0 0 0 1\n";
    stated("groundtruth.txt", first, &format!("{first}0.01 0 nan 0 0 0 0 1\n"), "line 2: ty is 'nan'");
    std::fs::remove_file(recording.path("groundtruth.txt")).unwrap();
    recording.write("depth.txt", "# nothing\n");
    assert_contains(&recording.refusal(&[]), &["depth.txt names no images"]);
    std::fs::remove_file(recording.path("depth.txt")).unwrap();
    assert_contains(&recording.refusal(&[]), &["depth.txt"]);
    std::fs::remove_file(recording.path("camera.toml")).unwrap();
    recording.write("depth.txt", "0.0 depth/0.png\n");
    assert_contains(&recording.refusal(&[]), &["has no camera.toml", "--camera"]);
}

/// Bears no broken image.
const STRICT: [&str; 2] = ["--set", "source.max_broken_share=0"];

#[test]
fn images_are_refused_by_frame_and_file() {
    let recording = Recording::new(6);
    let whole = std::fs::read(recording.path("depth/0.png")).unwrap();
    let spoil = |bytes: &[u8]| {
        for index in 0..6 {
            std::fs::write(recording.path(&format!("depth/{index}.png")), bytes).unwrap();
        }
    };
    spoil(&whole[..whole.len() / 2]);
    assert_contains(&recording.refusal(&[]), &["frame 0", "depth/0.png", "cut short or damaged"]);
    let eight_bit = image::GrayImage::from_pixel(WIDTH, HEIGHT, image::Luma([9]));
    eight_bit.save(recording.path("depth/0.png")).unwrap();
    assert_contains(&recording.refusal(&[]), &["frame 0", "depth/0.png", "expected"]);
    spoil(&whole);
    image::RgbImage::new(80, 60).save(recording.path("rgb/0.png")).unwrap();
    assert_contains(&recording.refusal(&STRICT), &["frame 0", "rgb/0.png", "80x60 px, expected 640x480 px"]);
}

#[test]
fn a_broken_image_costs_itself_and_is_named() {
    let recording = Recording::new(40);
    std::fs::write(recording.path("depth/33.png"), b"no image").unwrap();
    std::fs::remove_file(recording.path("rgb/20.png")).unwrap();
    let output = recording.run(&[]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read = |name: &str| std::fs::read_to_string(recording.path(name)).unwrap();
    assert_eq!(recording.states().len(), 40);
    let broken = read("out/broken_frames.txt");
    let rows: Vec<&str> = broken.lines().skip(1).collect();
    assert!(rows.len() == 1 && rows[0].starts_with("33 ") && rows[0].contains("depth/33.png"), "{broken}");
    let summary: serde_json::Value = serde_json::from_str(&read("out/summary.json")).unwrap();
    assert_eq!((&summary["frames_broken"], &summary["frames_processed"]), (&1.into(), &40.into()));
    assert_eq!(summary["verdict"]["grade"], "doubtful", "{summary}");
    let verdict = summary["verdict"].to_string();
    assert!(verdict.contains("1 of 40 frames have a missing or broken image"), "{summary}");
    assert!(verdict.contains("1 of 40 colour images are not there, the first: rgb/20.png"), "{summary}");
    assert!(read("out/log.txt").contains("verdict doubtful: "));
    // The third is one too many of 40.
    std::fs::write(recording.path("depth/7.png"), b"no image").unwrap();
    std::fs::write(recording.path("depth/8.png"), b"no image").unwrap();
    std::fs::remove_dir_all(recording.path("out")).unwrap();
    let text = String::from_utf8(recording.run(&[]).stderr).unwrap();
    assert_contains(&text, &["3 of 40 frames have a missing or broken image, expected at most 2"]);
    // The verdict is an exit code where that is asked for.
    std::fs::copy(recording.path("depth/6.png"), recording.path("depth/7.png")).unwrap();
    std::fs::copy(recording.path("depth/6.png"), recording.path("depth/8.png")).unwrap();
    std::fs::remove_dir_all(recording.path("out")).unwrap();
    assert_eq!(recording.run(&["--strict"]).status.code(), Some(6));
}

#[test]
fn an_image_that_is_damaged_in_the_middle_ends_a_strict_run_and_keeps_what_was_done() {
    let recording = Recording::new(40);
    std::fs::write(recording.path("depth/33.png"), b"no image").unwrap();
    assert_contains(&recording.refusal(&STRICT), &["sensor", "frame 33", "depth/33.png"]);
    // Frames before it may still have been under way; what was recorded is written.
    let states = recording.states();
    assert!(states.len() <= 33, "{states:?}");
    assert!(recording.path("out/trajectory.txt").is_file() && recording.path("out/summary.json").is_file());
    // Once the file is there, the run goes on where it ended.
    std::fs::copy(recording.path("depth/32.png"), recording.path("depth/33.png")).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_tessera"))
        .args(["resume", "--quiet"])
        .arg(recording.path("out"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(recording.states().len(), 40);
}

#[test]
fn wrong_depth_units_are_refused_with_a_hint_unless_forced() {
    let recording = Recording::new(4);
    recording.replace("camera.toml", "5000.0", "50.0");
    assert_contains(
        &recording.refusal(&[]),
        &["the depth units look wrong", "units_per_metre = ", "--force"],
    );
    let output = recording.run(&["--force"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(recording.states().len(), 4);
}

#[test]
fn frames_without_depth_are_lost_and_tracking_comes_back() {
    let recording = Recording::new(20);
    let n_pixels = (WIDTH * HEIGHT) as usize;
    let mut few = vec![0; n_pixels];
    few[50000..50050].fill(8000);
    for (index, depth) in [(8, vec![0; n_pixels]), (9, vec![65535; n_pixels]), (10, few)] {
        recording.write_depth(index, &depth);
    }
    let output = recording.run(&[]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let states = recording.states();
    let text = std::fs::read_to_string(recording.path("out/states.csv")).unwrap();
    assert_eq!(states.len(), 20);
    assert!(states[..8].iter().all(|state| state == "tracking"), "{states:?}");
    assert!(states[8..11].iter().all(|state| state == "lost"), "{states:?}");
    assert!(states[14..].iter().all(|state| state == "tracking"), "{states:?}");
    let reason = text.lines().nth(9).unwrap().split(',').nth(3).unwrap();
    assert!(!reason.is_empty(), "a lost frame says why");
    let marked = std::fs::read_to_string(recording.path("out/trajectory_marked.txt")).unwrap();
    let n_predicted = marked.lines().filter(|line| line.contains(" predicted ")).count();
    assert_eq!(n_predicted, states.iter().filter(|state| *state != "tracking").count());
    let log = std::fs::read_to_string(recording.path("out/log.txt")).unwrap();
    let at = |words: &str| log.lines().position(|line| line.contains("align[") && line.contains(words));
    let (lost, found) = (at(" not tracked: 0 usable points"), at(" tracked again"));
    assert!(lost.is_some() && lost < found, "{log}");
}

#[test]
fn a_recording_that_begins_without_depth_begins_when_there_is_some() {
    let recording = Recording::new(12);
    for index in 0..3 {
        recording.write_depth(index, &vec![0; (WIDTH * HEIGHT) as usize]);
    }
    let output = recording.run(&[]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let states = recording.states();
    assert_eq!(states.len(), 12);
    assert!(states[..3].iter().all(|state| state == "lost"), "{states:?}");
    assert!(states[6..].iter().all(|state| state == "tracking"), "{states:?}");
}

#[test]
fn a_recording_without_any_depth_is_told_apart_from_a_failure() {
    let recording = Recording::new(5);
    for index in 0..5 {
        recording.write_depth(index, &vec![0; (WIDTH * HEIGHT) as usize]);
    }
    let output = recording.run(&[]);
    let text = String::from_utf8_lossy(&output.stderr);
    assert!([Some(0), Some(3)].contains(&output.status.code()), "{text}");
    if output.status.success() {
        assert!(recording.states().iter().all(|state| state == "lost"), "{:?}", recording.states());
    }
}

#[test]
fn a_depth_frame_without_colour_is_used() {
    let recording = Recording::new(12);
    recording.replace("rgb.txt", "0.133333 rgb/4.png\n", "");
    let output = recording.run(&[]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(recording.states(), vec!["tracking"; 12]);
}

#[test]
fn a_run_of_another_version_is_gone_on_with_by_that_version_alone() {
    let recording = Recording::new(3);
    assert!(recording.run(&[]).status.success());
    let own = concat!("\"version\": \"", env!("CARGO_PKG_VERSION"), "\"");
    recording.replace("out/run.json", own, "\"version\": \"0.0.1\"");
    let out = recording.path("out");
    let output = tessera(&[Path::new("resume"), &out]);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert_contains(&text, &["0.0.1", env!("CARGO_PKG_VERSION")]);
    // What it recorded is read.
    let output = tessera(&[Path::new("export"), &out]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

fn tessera(arguments: &[&Path]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tessera")).args(arguments).output().unwrap()
}
