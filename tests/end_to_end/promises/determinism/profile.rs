//! One stage by itself on its recorded input: the bits of the pipeline, and what is refused.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};
use tessera_journal::{Follower, fingerprint};
use tessera_slam::{AlignRecord, OptimiseRecord, StoreSlot};
use tessera_stage::{ALIGN_JOURNAL, OPTIMISE_JOURNAL};

fn tessera(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tessera")).args(arguments).output().unwrap()
}

/// What a profile says as JSON.
fn profile(stage: &str, file: &Path, more: &[&str]) -> Value {
    let output = tessera(&[&["profile", stage, file.to_str().unwrap(), "--json"], more].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Names of the steps that took any time.
fn steps(profile: &Value) -> Vec<&str> {
    profile["steps"].as_array().unwrap().iter().map(|step| step["name"].as_str().unwrap()).collect()
}

/// A profile whose steps' sum is the whole within 3 %. Another program may have the core between two steps: one of ten
/// profiles has to be so.
fn named_profile(stage: &str, file: &Path) -> Value {
    let mut found = profile(stage, file, &[]);
    for _ in 1..10 {
        let shares = found["steps"].as_array().unwrap().iter().map(|step| step["share"].as_f64().unwrap());
        let sum: f64 = shares.sum();
        assert!((found["unnamed_share"].as_f64().unwrap() - (1.0 - sum)).abs() < 1e-9, "{found}");
        if (0.97..=1.0).contains(&sum) {
            return found;
        }
        found = profile(stage, file, &[]);
    }
    panic!("more than 3 % have no name: {found}")
}

/// As the profile sums up its results.
fn digest(fingerprints: impl Iterator<Item = u32>) -> String {
    format!("{:08x}", fingerprints.fold(0u32, |sum, found| sum.rotate_left(1) ^ found))
}

fn aligned(run: &crate::common::Run) -> String {
    let mut journal = Follower::open(&run.out().join("align.journal"), ALIGN_JOURNAL).unwrap();
    let mut found = Vec::new();
    while let Some(mut record) = journal.next().unwrap() {
        let AlignRecord::Frame(frame) = &mut record else { continue };
        // Where a surface lies in the store is the pipeline's own.
        if let Some(keyframe) = &mut frame.change.new_keyframe {
            keyframe.slot = StoreSlot::default();
        }
        found.push(fingerprint(&record).unwrap());
    }
    assert_eq!(found.len().to_string(), crate::common::FRAMES);
    digest(found.into_iter())
}

fn optimised(run: &crate::common::Run) -> String {
    let mut journal = Follower::open(&run.out().join("optimise.journal"), OPTIMISE_JOURNAL).unwrap();
    let mut found = Vec::new();
    while let Some(record) = journal.next().unwrap() {
        let record: OptimiseRecord = record;
        found.push(fingerprint(record.correction()).unwrap());
    }
    assert!(!found.is_empty());
    digest(found.into_iter())
}

#[test]
fn a_stage_alone_gives_the_bits_of_the_pipeline() {
    let run = crate::common::room();
    assert!(run.finish().success());
    let config = run.out().join("config.toml");
    let record = |stage: &str| {
        let file = run.dir.path().join(stage);
        let arguments = ["record", "room", "--stage", stage, "--out", file.to_str().unwrap()];
        let output = tessera(&[&arguments[..], &["--config", config.to_str().unwrap()]].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        file
    };
    let align = named_profile("align", &record("align"));
    assert_eq!(align["output"].as_str().unwrap(), aligned(&run));
    for step in
        ["sampling", "dynamic", "match", "prepare", "search", "reject", "accumulate", "solve", "keyframe"]
    {
        assert!(steps(&align).contains(&step), "{align}");
    }
    // Steps that are not measured, and repetition, change nothing but the counts.
    let bare = profile("align", &run.dir.path().join("align"), &["--no-steps", "--repeat", "2"]);
    assert_eq!((steps(&bare).len(), bare["ms"]["n"].as_u64()), (0, Some(80)), "{bare}");

    assert_eq!(profile("optimise", &record("optimise"), &[])["output"].as_str().unwrap(), optimised(&run));
    let reconstruct = named_profile("reconstruct", &record("reconstruct"));
    assert_eq!(steps(&reconstruct), ["cloud", "mesh", "normals", "filter", "vertices", "features"]);
    assert_eq!(reconstruct["frames"].to_string(), crate::common::FRAMES);
}

#[test]
fn what_cannot_be_profiled_is_refused_by_name() {
    let dir = tempfile::tempdir().unwrap();
    crate::common::write_camera(&dir.path().join("camera.toml"));
    let file = dir.path().join("input");
    let name = file.to_str().unwrap();
    let camera = dir.path().join("camera.toml");
    let room = ["record", "room", "--camera", camera.to_str().unwrap(), "--frames", "3", "--out", name];
    let refusal = |arguments: &[&str], code: i32| {
        let output = tessera(arguments);
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {text}");
        text
    };
    let text = refusal(&[&room[..], &["--stage", "sensor"]].concat(), 2);
    assert!(text.contains("no stage \"sensor\" to record, expected one of reconstruct, align, optimise"));
    assert!(refusal(&["profile", "align", name], 3).contains("input"), "a file that is not there");
    assert!(tessera(&[&room[..], &["--stage", "align"]].concat()).status.success());
    let text = refusal(&["profile", "reconstruct", name], 3);
    assert!(text.contains("holds the input of align, expected that of reconstruct"), "{text}");
    refusal(&["profile", "align", name, "--repeat", "0"], 2);

    let whole = std::fs::read(&file).unwrap();
    std::fs::write(&file, &whole[..whole.len() - 1]).unwrap();
    assert!(refusal(&["profile", "align", name], 3).contains("is cut short after 4 entries"));
    std::fs::write(&file, b"0.1 rgb/1.png\n").unwrap();
    assert!(refusal(&["profile", "align", name], 3).contains("does not begin as a recording"));
}
