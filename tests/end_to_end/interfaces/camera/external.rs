//! Frames from a program that is none of ours: nothing it does changes a byte, stops a restart or
//! goes by without a word.

use super::foreign_camera::{AFTER_PAUSE, ASKED_AT, FRAMES, Foreign};
use crate::common::{Run, room, signal, wait_for};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use tessera_journal::Follower;
use tessera_slam::AlignRecord;
use tessera_stage::ALIGN_JOURNAL;
use tessera_transport::registered_runs;

fn external() -> Run {
    room().of(Path::new("external"))
}

fn words(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn undisturbed() -> Run {
    let run = room().frames(FRAMES);
    assert!(run.finish().success());
    run
}

fn finished(run: &Run, child: Child, reference: &Run, what: &str) {
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{what}: {}\n{}", words(&output), run.log());
    run.assert_same_bytes(reference, what);
    assert_eq!(run.leftovers(), Vec::<PathBuf>::new(), "{what}");
}

#[test]
fn a_camera_that_sends_again_loses_nothing_whatever_dies() {
    let reference = undisturbed();
    let plans = [
        "",
        "sensor=sent:9;sensor=read:20",
        "reconstruct=received:13",
        "align=computed:11",
        "align=acknowledged:17",
        "sensor=read:21:drop",
    ];
    for plan in plans {
        let run = external().with_faults(plan);
        let child = run.start();
        let _camera = Foreign::start(&run, 64, "ring");
        finished(&run, child, &reference, plan);
        let n_expected = usize::from(!plan.is_empty() && !plan.ends_with("drop"));
        assert_eq!(run.n_deaths(), n_expected, "{plan}\n{}", run.log());
    }
}

#[test]
fn a_camera_that_dies_and_comes_back_goes_on_where_it_was() {
    let reference = undisturbed();
    let run = external();
    let child = run.start();
    let mut first = Foreign::start(&run, 64, "ring=15");
    assert!(!first.0.wait().unwrap().success());
    let _second = Foreign::start(&run, 64, "ring");
    finished(&run, child, &reference, "after the camera died");
}

#[test]
fn a_camera_that_went_away_ends_the_run_in_words_and_resume_goes_on() {
    let reference = undisturbed();
    let run = external().with(&["--set", "run.camera_timeout_s=1.5"]);
    let child = run.start();
    let mut first = Foreign::start(&run, 64, "ring=15");
    assert!(!first.0.wait().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(3), "{}\n{}", words(&output), run.log());
    let expected = "the camera sent nothing usable for 1.5 s (run.camera_timeout_s), frame 16 is awaited: \
                    its program is not there";
    assert!(words(&output).contains(expected), "{}", words(&output));
    assert!(words(&output).contains("tessera resume"), "{}", words(&output));
    assert!(!run.output("trajectory.txt").is_empty());
    assert_eq!(run.leftovers(), Vec::<PathBuf>::new());

    let resumed = resume(&run);
    let _camera = Foreign::start(&run, 64, "ring");
    finished(&run, resumed, &reference, "after resume");
}

/// As with a laptop that is closed: all processes stand still for longer than a stage may be silent and than a
/// camera may send nothing, and the supervisor wakes first.
#[test]
fn a_machine_that_sleeps_costs_no_stage_and_no_byte() {
    let reference = undisturbed();
    let run = external().with(&["--set", "flow.hang_s=1.0", "--set", "run.camera_timeout_s=1.5"]);
    let child = run.start();
    let camera = Foreign::start(&run, 64, "ring");
    run.wait_until_busy();
    let sensor = run.stage_pid("sensor");
    let others: Vec<u32> = run.stage_pids().into_iter().filter(|pid| *pid != sensor).collect();
    let early = [child.id(), sensor];
    let late = [others, vec![camera.0.id()]].concat();
    early.iter().chain(&late).for_each(|pid| signal(*pid, "STOP"));
    std::thread::sleep(std::time::Duration::from_secs(4));
    early.iter().for_each(|pid| signal(*pid, "CONT"));
    std::thread::sleep(std::time::Duration::from_millis(300));
    late.iter().for_each(|pid| signal(*pid, "CONT"));
    finished(&run, child, &reference, "after a sleep");
    assert_eq!(run.n_deaths(), 0, "{}", run.log());
    assert!(run.log().contains("stood still for 4."), "{}", run.log());
}

/// Closed before its camera was there, for longer than that is waited for.
#[test]
fn a_machine_that_sleeps_while_it_waits_for_its_camera_waits_on() {
    let run = external().with(&["--set", "run.camera_timeout_s=8"]);
    let child = run.start();
    let name = &run.name;
    wait_for("the run's name", || registered_runs().unwrap().iter().any(|r| r.entry.name == *name));
    signal(child.id(), "STOP");
    std::thread::sleep(std::time::Duration::from_secs(9));
    signal(child.id(), "CONT");
    // Past the look at which the time would be over.
    std::thread::sleep(std::time::Duration::from_millis(200));
    let _camera = Foreign::start(&run, 64, "ring");
    finished(&run, child, &undisturbed(), "after a sleep before the first image");
}

/// Goes on with a run that was given up.
fn resume(run: &Run) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tessera"));
    command.args(["resume", "--quiet"]).arg(run.out()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Rows of `states.csv` that say that relocalisation was asked for.
fn asked(run: &Run) -> Vec<String> {
    let states = String::from_utf8(run.output("states.csv")).unwrap();
    let is_asked = |line: &&str| line.contains("a relocalisation was asked for");
    states.lines().filter(is_asked).map(str::to_owned).collect()
}

#[test]
fn relocalisation_that_is_asked_for_is_done_once_whatever_dies() {
    let reference = external();
    let child = reference.start();
    let camera = Foreign::start(&reference, 64, "asking");
    assert!(child.wait_with_output().unwrap().status.success(), "{}", reference.log());
    drop(camera);
    let rows = asked(&reference);
    assert_eq!(rows.len(), 1, "{rows:?}");
    assert!(rows[0].starts_with(&format!("{ASKED_AT},")) && rows[0].contains(",relocalising,"), "{rows:?}");
    assert!(rows[0].contains("found by") && !rows[0].contains("the last pose"), "{rows:?}");
    let line = "a relocalisation was asked for: the place is looked for";
    assert_eq!(reference.log().matches(line).count(), 1, "{}", reference.log());
    for plan in [
        "sensor=read:12",
        "reconstruct=received:12",
        "reconstruct=sent:12",
        "align=computed:12",
        "align=journaled:12",
        "align=acknowledged:12;reconstruct=computed:13",
        "sensor=read:12:drop",
    ] {
        let run = external().with_faults(plan);
        let child = run.start();
        let _camera = Foreign::start(&run, 64, "asking");
        finished(&run, child, &reference, plan);
        assert_eq!(asked(&run), rows, "{plan}");
    }
    // The camera dies too, the run is given up, and goes on later.
    let run = external().with(&["--set", "run.camera_timeout_s=1.5"]);
    let child = run.start();
    let mut first = Foreign::start(&run, 64, "asking=12");
    assert!(!first.0.wait().unwrap().success());
    assert_eq!(child.wait_with_output().unwrap().status.code(), Some(3), "{}", run.log());
    let resumed = resume(&run);
    let _camera = Foreign::start(&run, 64, "asking");
    finished(&run, resumed, &reference, "after resume");
    assert_eq!(asked(&run), rows);
}

#[test]
fn what_an_image_asks_for_is_not_dropped_with_it() {
    // The sensor stands still while the image comes, and sends that of frame 1003.
    for plan in ["", "sensor=read:1003", "reconstruct=received:1003", "align=computed:1003"] {
        let run = external().frames(1_000_000).with(&["--set", "flow.hang_s=600"]);
        let run = if plan.is_empty() { run } else { run.with_faults(plan) };
        let child = run.start();
        let _camera = Foreign::start(&run, 0, "overtaken");
        // That one begins a map, and nothing can be asked of it.
        wait_for("the first frame", || run.n_processed() >= 1);
        let sensor = run.stage_pid("sensor");
        signal(sensor, "STOP");
        run.wait_until_stopped("sensor");
        let session = || {
            let text = std::fs::read_to_string(run.out().join("camera.session")).unwrap();
            serde_json::from_str::<serde_json::Value>(&text).unwrap()
        };
        let beside = |name: &str| run.dir.path().join(name);
        std::fs::write(beside("tmp"), (session()["image"].as_u64().unwrap() + 1000).to_string()).unwrap();
        std::fs::rename(beside("tmp"), beside("ask")).unwrap();
        wait_for("the camera to ask", || beside("asked").exists());
        signal(sensor, "CONT");
        wait_for("the sensor to keep what is asked", || session()["relocalise_from"] == 1000);
        std::fs::write(beside("go_on"), "").unwrap();
        wait_for("frames after that", || run.n_processed() >= 6);
        std::fs::write(beside("enough"), "").unwrap();
        let output = child.wait_with_output().unwrap();
        assert!(output.status.success(), "{plan}: {}\n{}", words(&output), run.log());
        let rows = asked(&run);
        assert_eq!(rows.len(), 1, "{plan}: {rows:?}\n{}", run.log());
        let frame: u64 = rows[0].split(',').next().unwrap().parse().unwrap();
        assert!(frame >= 1003, "{plan}: {rows:?}");
        assert_eq!(run.n_deaths(), usize::from(!plan.is_empty()), "{plan}\n{}", run.log());
    }
}

#[test]
fn no_camera_is_told_and_leaves_nothing() {
    let run = external().with(&["--set", "run.camera_timeout_s=0.3"]);
    let output = run.command().output().unwrap();
    assert_eq!(output.status.code(), Some(3));
    assert!(words(&output).contains("no camera came within 0.3 s"), "{}", words(&output));
    assert!(words(&output).contains(&format!("service 'camera' of the run {}", run.name)));
    assert!(!run.out().exists() && !registered_runs().unwrap().iter().any(|r| r.entry.name == run.name));
    let skipping = external().with(&["--skip", "3"]).command().output().unwrap();
    assert_eq!(skipping.status.code(), Some(2));
    assert!(words(&skipping).contains("--skip cannot be used with the source external"));
    let checked = Command::new(env!("CARGO_BIN_EXE_tessera")).args(["check", "external"]).output().unwrap();
    assert_eq!(checked.status.code(), Some(3));
    assert!(words(&checked).contains("only `tessera run external` waits for it"), "{}", words(&checked));
}

#[test]
fn a_ring_that_is_none_is_told() {
    let run = external();
    let child = run.start();
    let _camera = Foreign::start(&run, 64, "forgetful");
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(3), "{}\n{}", words(&output), run.log());
    assert!(words(&output).contains("it must keep its last 8 frames"), "{}", words(&output));
}

#[test]
fn nonsense_is_refused_in_words() {
    let run = external().with(&["--set", "run.camera_timeout_s=1.5", "--set", "run.camera=\"\""]);
    // Without --camera, so that the camera's own numbers count.
    let mut command = run.command();
    let arguments: Vec<_> = command.get_args().map(std::ffi::OsStr::to_owned).collect();
    let at = arguments.iter().position(|argument| argument == "--camera").unwrap();
    command = Command::new(env!("CARGO_BIN_EXE_tessera"));
    command.args(&arguments[..at]).args(&arguments[at + 2..]).stderr(Stdio::piped());
    let child = command.spawn().unwrap();
    let _camera = Foreign::start(&run, 0, "nonsense");
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(3), "{}\n{}", words(&output), run.log());
    assert!(words(&output).contains("what it sends is refused: frame "), "{}", words(&output));
    assert!(run.log().contains("of the camera's images, the last: frame "), "{}", run.log());
    assert!(!run.log().contains("panicked"), "{}", run.log());
    assert_eq!(run.n_deaths(), 1, "only the sensor, at the end\n{}", run.log());
}

#[test]
fn an_index_that_jumps_costs_its_frame_alone_and_a_pause_is_one_record() {
    let run = external().frames(1_000_000).with(&["--set", "flow.load_shedding=false"]);
    let child = run.start();
    let _camera = Foreign::start(&run, 0, "jumping");
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}\n{}", words(&output), run.log());
    assert_eq!(run.n_deaths(), 0, "{}", run.log());
    let log = run.log();
    assert!(log.contains("its index leaves out") && log.contains("indices count images one by one"), "{log}");
    let summary: serde_json::Value = serde_json::from_slice(&run.output("summary.json")).unwrap();
    let n_read = summary["frames_read"].as_u64().unwrap();
    // Counting begins with the first image that the sensor hears: a few before it says so.
    assert!((AFTER_PAUSE..=AFTER_PAUSE + 30).contains(&n_read), "{summary}");
    let mut journal = Follower::open(&run.out().join("align.journal"), ALIGN_JOURNAL).unwrap();
    let mut n_skipped = Vec::new();
    while let Some(record) = journal.next().unwrap() {
        if let AlignRecord::Skipped(skipped) = record {
            n_skipped.push(skipped.n());
        }
    }
    // The pause is one record, or two where frames at its borders were dropped for another reason.
    let in_pause = n_skipped.iter().filter(|n| **n >= (AFTER_PAUSE - 20) / 2).count();
    assert_eq!(in_pause, 1, "{n_skipped:?}");
    assert!(n_skipped.len() < 40, "{n_skipped:?}");
    let states = String::from_utf8(run.output("states.csv")).unwrap();
    assert_eq!(states.lines().count() as u64, 1 + n_read, "each frame has its row");
}

#[test]
fn live_counts_what_was_not_taken_and_goes_on_with_another_camera() {
    let run = external().frames(1_000_000).with_faults("sensor=sent:8+");
    let child = run.start();
    let mut first = Foreign::start(&run, 0, "endless");
    wait_for("the sensor's death", || run.n_deaths() == 1);
    let before = run.n_processed();
    wait_for("frames of its successor", || run.n_processed() >= before + 10);
    signal(first.0.id(), "KILL");
    let _ = first.0.wait();
    let _second = Foreign::start(&run, 0, "live=1000000");
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}\n{}", words(&output), run.log());
    let summary: serde_json::Value = serde_json::from_slice(&run.output("summary.json")).unwrap();
    let count = |key: &str| summary[key].as_u64().unwrap();
    let (processed, read) = (count("frames_processed"), count("frames_read"));
    assert!(processed >= 10, "{summary}");
    assert_eq!(read, processed + count("frames_dropped") + count("frames_missing"), "{summary}");
    assert!(run.log().matches("in a new session").count() >= 2, "{}", run.log());
    assert_eq!(run.leftovers(), Vec::<PathBuf>::new());
}
