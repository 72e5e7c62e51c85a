//! Runs that start in the map of an earlier run.

use crate::common::{FORGETFUL, OUTPUTS, Run, signal};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;
use tessera_evaluation::read_tum;
use tessera_geometry::{Pose, translation_rotation_norms};

/// Frames of the run that makes the map.
const MAPPED: u64 = 120;
/// The frame in the middle of it where the others start.
const MIDDLE: u64 = 60;

/// A larger camera than other tests have: a place is found by what can be seen of it.
fn room() -> Run {
    let run = crate::common::room().with(&["--set", "surface.step=4"]);
    let camera = "width = 320\nheight = 240\nfx = 262.5\nfy = 262.5\ncx = 159.5\ncy = 119.5\n\
                  units_per_metre = 5000.0\n";
    std::fs::write(run.dir.path().join("camera.toml"), camera).unwrap();
    run
}

/// The map.
fn mapped() -> &'static Run {
    static RUN: OnceLock<Run> = OnceLock::new();
    RUN.get_or_init(|| {
        let run = room().frames(MAPPED);
        assert!(run.finish().success());
        run
    })
}

/// A run from the middle of the mapped path to beyond its end.
fn second() -> Run {
    let map = mapped().out().display().to_string();
    room().frames(MAPPED).with(&["--skip", &MIDDLE.to_string(), "--map", &map])
}

/// A second run that nothing disturbs.
fn undisturbed() -> &'static Run {
    static RUN: OnceLock<Run> = OnceLock::new();
    RUN.get_or_init(|| {
        let before = contents(&mapped().out());
        let run = second();
        assert!(run.finish().success());
        assert!(contents(&mapped().out()) == before, "the earlier run was touched");
        run
    })
}

/// All files of a folder.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let files = std::fs::read_dir(folder).unwrap().map(|item| item.unwrap().path());
    files.map(|path| (path.clone(), std::fs::read(path).unwrap())).collect()
}

fn summary(run: &Run) -> serde_json::Value {
    serde_json::from_slice(&run.output("summary.json")).unwrap()
}

fn resume(run: &Run) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tessera")).args(["resume", "--quiet"]).arg(run.out()).output().unwrap()
}

fn refused(run: &Run, code: i32) -> String {
    let output = run.command().output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{text}");
    text
}

#[test]
fn a_run_in_a_levelled_map_is_level_as_the_map_is() {
    let levelled = room().with(&["--set", "mapping.world_up=gravity"]);
    let output = levelled.command().output().unwrap();
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && words.contains("no accelerometer was recorded"), "{words}");
    let states = String::from_utf8(levelled.output("states.csv")).unwrap();
    assert!(states.contains("levelled by the floor"), "{states}");
    let next = room().with(&["--map", &levelled.out().display().to_string()]);
    let output = next.command().output().unwrap();
    assert!(output.status.success(), "{}", next.log());
    let config = String::from_utf8(next.output("config.toml")).unwrap();
    assert!(config.contains("world_up = \"gravity\""), "{config}");
}

#[test]
fn a_start_in_the_middle_is_found_and_the_map_grows() {
    let run = undisturbed();
    let summary = summary(run);
    let count = |key: &str| summary[key].as_u64().unwrap();
    assert!(count("first_tracked") <= 30, "{summary}");
    let n_map = count("map_keyframes");
    assert!(n_map >= 2 && count("keyframes") > n_map, "{summary}");
    assert_eq!(summary["final_optimisation"], true);
    // In the frame of the old map: its first frame is the world's origin.
    let truth = read_tum(&run.out().join("groundtruth.txt")).unwrap();
    let world_from_map = truth.poses[0];
    let found = read_tum(&run.out().join("trajectory.txt")).unwrap();
    for (stamp, pose) in found.stamps_nanos.iter().zip(&found.poses).skip(30) {
        // Stamps in files are rounded.
        let place = truth.stamps_nanos.iter().position(|t| (t - stamp).abs() < 1_000_000).unwrap();
        let error: Pose = truth.poses[place].inverse() * (world_from_map * pose);
        let (m, r) = translation_rotation_norms(&error);
        assert!(m < 0.03 && r.to_degrees() < 1.0, "at {stamp}: {m} m, {r} rad");
    }
    // The map holds both parts, the list of keyframes this run's.
    assert!(run.output("map.ply").len() > mapped().output("map.ply").len());
    let rows = String::from_utf8(run.output("keyframes.txt")).unwrap();
    assert_eq!(rows.lines().count() as u64, 2 + count("keyframes") - n_map);
}

#[test]
fn deaths_and_forgetting_change_no_byte() {
    for plan in [
        "align=opened:0",
        "align=journaled:0;optimise=opened:0",
        "align=stored:40,acknowledged:90",
        "optimise=solving:0",
    ] {
        let run = second().with_faults(plan);
        assert!(run.finish().success(), "{plan}");
        run.assert_same_bytes(undisturbed(), plan);
        assert_eq!(run.leftovers(), Vec::<PathBuf>::new());
    }
    let run = second().with(&["--set", FORGETFUL]);
    assert!(run.finish().success());
    run.assert_same_bytes(undisturbed(), FORGETFUL);
}

#[test]
fn a_run_broken_off_goes_on_and_a_lost_journal_begins_in_the_same_map() {
    let run = second().with_faults("align=computed:30:stop");
    let mut child = run.start();
    run.wait_until_stopped("align");
    signal(child.id(), "KILL");
    child.wait().unwrap();
    assert!(resume(&run).status.success(), "{}", run.log());
    run.assert_same_bytes(undisturbed(), "resumed");
    for name in ["align.journal", "keyframes.store"] {
        std::fs::write(run.out().join(name), "").unwrap();
        assert_eq!(resume(&run).status.code(), Some(3), "{name}: {}", run.log());
        let output = run.tessera(&["resume", "--quiet", "--drop-damaged"]);
        assert!(output.status.success(), "{name}: {}", run.log());
        run.assert_same_bytes(undisturbed(), &format!("{name} was lost"));
    }
}

#[test]
fn a_map_that_changed_is_not_taken_for_the_one_before() {
    let map = room().frames(40);
    assert!(map.finish().success());
    let path = map.out().display().to_string();
    let run = room().frames(10).with(&["--skip", "20", "--map", &path]);
    assert!(run.finish().success());
    // The same place, another map.
    std::fs::remove_dir_all(map.out()).unwrap();
    let map = map.with(&["--set", "simulation.seed=99"]);
    assert!(map.finish().success());
    std::fs::write(run.out().join("align.journal"), "").unwrap();
    let output = run.tessera(&["resume", "--quiet", "--drop-damaged"]);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && text.contains("has changed since this run began"), "{text}");
}

#[test]
fn a_camera_that_is_elsewhere_is_told_and_spoils_nothing() {
    let map = mapped().out().display().to_string();
    // Another place that is not in the map.
    let run = room().frames(12).with(&["--map", &map]);
    let mut command = run.command();
    let arguments: Vec<_> = command.get_args().map(ToOwned::to_owned).collect();
    let house = arguments.iter().map(|word| if word == "room" { "house".into() } else { word.clone() });
    command = Command::new(command.get_program());
    let output = command.args(house).args(["--skip", "200"]).output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(5), "{text}\n{}", run.log());
    assert!(text.contains("no frame was found in the map of"), "{text}");
    let summary = summary(&run);
    assert!(summary["first_tracked"].is_null() && summary["frames_untracked"] == 12, "{summary}");
    assert_eq!(summary["keyframes"], summary["map_keyframes"]);
    assert!(run.output("map.ply") == mapped().output("map.ply"));
}

#[test]
fn what_cannot_be_used_is_refused_in_words() {
    let map = mapped().out().display().to_string();
    let cases: [(&[&str], &str); 5] = [
        (&["--map", "no-such-run"], "no run \"no-such-run\""),
        (&["--map", &map, "--set", "surface.step=1"], "was made with another grid"),
        (&["--map", &map, "--at", "1 2 3"], "expected seven numbers"),
        (&["--map", &map, "--set", "mapping.relocalise.enabled=false"], "relocalise.enabled = true"),
        (&["--at", "0 0 0 0 0 0 1"], "--map"),
    ];
    for (arguments, expected) in cases {
        let run = room().with(arguments);
        let text = refused(&run, 2);
        assert!(text.contains(expected), "{arguments:?}: {text}");
        assert!(!run.out().exists(), "{arguments:?} left a folder");
    }
    let run = room().with(&["--map", &map]);
    let camera = run.dir.path().join("camera.toml");
    let text = std::fs::read_to_string(&camera).unwrap().replace("width = 320", "width = 312");
    std::fs::write(&camera, text).unwrap();
    let text = refused(&run, 2);
    assert!(
        text.contains("another kind of camera") && text.contains("320x240") && text.contains("312x240"),
        "{text}"
    );
    // A run that is going on still changes its map.
    let going_on = room().frames(100_000);
    let mut child = going_on.start();
    going_on.wait_until_busy();
    let run = room().with(&["--map", &going_on.out().display().to_string()]);
    let text = refused(&run, 2);
    assert!(text.contains("is going on") && text.contains(&going_on.name), "{text}");
    signal(child.id(), "TERM");
    child.wait().unwrap();
}

#[test]
fn a_start_that_is_said_is_used() {
    let truth = read_tum(&mapped().out().join("groundtruth.txt")).unwrap();
    let start = truth.poses[0].inverse() * truth.poses[MIDDLE as usize];
    let (t, q) = (start.translation.vector, start.rotation.coords);
    let at = format!("{} {} {} {} {} {} {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w);
    // Features, which are tried first, would find the place by themselves.
    let run = second().with(&["--at", &at, "--set", "mapping.features.enabled=false"]);
    assert!(run.finish().success());
    assert!(summary(&run)["first_tracked"].as_u64().unwrap() <= 30);
    let states = String::from_utf8(run.output("states.csv")).unwrap();
    assert!(states.lines().nth(1).unwrap().contains("found by the start"), "{states}");
}

#[test]
fn an_updated_map_and_the_one_before_change_places() {
    let map = room().frames(60);
    assert!(map.finish().success());
    let path = map.out().display().to_string();
    let run = room().frames(60).with(&["--skip", "30", "--map", &path, "--map-update"]);
    let before: Vec<Vec<u8>> = OUTPUTS.iter().map(|name| map.output(name)).collect();
    assert!(run.finish().success());
    assert!(summary(&map)["map_keyframes"].as_u64().unwrap() > 0);
    let after: Vec<Vec<u8>> = OUTPUTS.iter().map(|name| run.output(name)).collect();
    assert!(before == after, "the map before is kept");
}
