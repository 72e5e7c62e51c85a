//! A laptop that sleeps: all processes stand still for longer than a stage may be silent, and go on one after
//! the other, in any order.

use crate::common::{Run, room, signal, wait_for};
use std::process::Child;
use std::time::Duration;

/// Time without a sign of life, seconds: a stage on a machine ten times slower gives one sooner.
const HANG_S: &str = "flow.hang_s=3";
/// Longer than that.
const ASLEEP: Duration = Duration::from_secs(4);
const STAGES: [&str; 4] = ["sensor", "reconstruct", "align", "optimise"];

fn sleepy() -> Run {
    room().with(&["--set", HANG_S])
}

/// Supervisor and stages, the same however often it slept.
fn pids(run: &Run, child: &Child) -> Vec<u32> {
    [vec![child.id()], STAGES.map(|stage| run.stage_pid(stage)).to_vec()].concat()
}

/// Lets all of them sleep; they wake in this order.
fn sleep(order: &[u32], supervisor: u32) {
    // It first: what is stopped before it would be silent for longer.
    signal(supervisor, "STOP");
    order.iter().for_each(|pid| signal(*pid, "STOP"));
    std::thread::sleep(ASLEEP);
    for pid in order {
        signal(*pid, "CONT");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Frames are journaled again.
fn goes_on(run: &Run, child: &mut Child) {
    let before = run.n_processed();
    wait_for("frames after a sleep", || {
        assert_eq!(child.try_wait().unwrap(), None, "it went on\n{}", run.log());
        run.n_processed() > before
    });
}

fn assert_slept(run: &Run, n: usize) {
    assert_eq!(run.n_deaths(), 0, "{}", run.log());
    assert!(run.log().matches("] stood still for ").count() >= n, "{}", run.log());
    assert_eq!(run.leftovers(), Vec::<std::path::PathBuf>::new());
}

#[test]
fn a_recorded_room_keeps_its_bytes_and_its_processes_whoever_wakes_first() {
    let undisturbed = room().frames(1500);
    assert!(undisturbed.finish().success());
    let run = sleepy().frames(1500);
    let mut child = run.start();
    run.wait_until_busy();
    wait_for("all stages", || run.stage_pids().len() == 4);
    let before = pids(&run, &child);
    let mut order = before.clone();
    for _ in 0..order.len() {
        sleep(&order, child.id());
        goes_on(&run, &mut child);
        assert_eq!(pids(&run, &child), before, "{}", run.log());
        order.rotate_left(1);
    }
    assert!(child.wait().unwrap().success(), "{}", run.log());
    run.assert_same_bytes(&undisturbed, "after five sleeps");
    assert_slept(&run, order.len());
}

#[test]
fn a_live_room_goes_on_with_its_processes_and_counts_what_its_camera_dropped() {
    let run = sleepy().frames(100_000).with(&["--live"]);
    let mut child = run.start();
    run.wait_until_busy();
    wait_for("all stages", || run.stage_pids().len() == 4);
    let before = pids(&run, &child);
    let order = [3, 0, 4, 2, 1].map(|k| before[k]);
    sleep(&order, child.id());
    goes_on(&run, &mut child);
    assert_eq!(pids(&run, &child), before, "{}", run.log());
    signal(child.id(), "INT");
    assert_eq!(child.wait().unwrap().code(), Some(130), "{}", run.log());
    assert_slept(&run, 1);
    let summary: serde_json::Value = serde_json::from_slice(&run.output("summary.json")).unwrap();
    let count = |key: &str| summary[key].as_u64().unwrap();
    assert_eq!(count("frames_missing"), 0, "{summary}");
    assert_eq!(count("frames_read"), count("frames_processed") + count("frames_dropped"), "{summary}");
    // Those of four seconds, 30 a second, but for those that were read before it fell asleep.
    assert!(count("frames_dropped") > 100, "{summary}");
}
