//! Each stage killed at each kill point: the outputs keep their bytes, nothing stays behind.

mod common;

use common::{Run, room};
use std::sync::OnceLock;

/// What comes out when nothing happens.
fn undisturbed() -> &'static Run {
    static RUN: OnceLock<Run> = OnceLock::new();
    RUN.get_or_init(|| {
        let run = room();
        assert!(run.finish().success());
        assert_eq!(run.leftovers(), Vec::<std::path::PathBuf>::new());
        run
    })
}

fn check(plan: &str) {
    let run = room().with_env("TESSERA_KILL_PLAN", plan);
    assert!(run.finish().success(), "{plan}");
    let n_kills = plan.split([',', ';']).count();
    let n_restarts = run.log().matches("it is started again").count();
    assert_eq!(n_restarts, n_kills, "{plan}\n{}", run.log());
    run.assert_same_bytes(undisturbed(), plan);
    assert_eq!(run.leftovers(), Vec::<std::path::PathBuf>::new(), "{plan}");
}

#[test]
fn sensor_dies() {
    ["sensor=opened:0", "sensor=read:7", "sensor=sent:20"].iter().for_each(|plan| check(plan));
}

#[test]
fn reconstruct_dies() {
    ["reconstruct=opened:0", "reconstruct=received:0", "reconstruct=computed:9", "reconstruct=sent:21"]
        .iter()
        .for_each(|plan| check(plan));
}

#[test]
fn align_dies() {
    [
        "align=opened:0",
        "align=received:3",
        "align=computed:0",
        "align=stored:0",
        "align=journaled:0",
        "align=journaled:17",
        "align=published:18",
        "align=acknowledged:30",
        "align=ended:40",
    ]
    .iter()
    .for_each(|plan| check(plan));
}

#[test]
fn optimise_dies() {
    ["optimise=opened:0", "optimise=received:0", "optimise=solving:0", "optimise=journaled:0"]
        .iter()
        .for_each(|plan| check(plan));
}

#[test]
fn several_die_at_once() {
    check("sensor=sent:12;reconstruct=computed:12;align=journaled:10");
    check("sensor=opened:0;reconstruct=opened:0;align=opened:0;optimise=opened:0");
}

#[test]
fn all_state_can_be_forgotten_after_each_frame() {
    let run = room().with(&["--forget-every", "1"]);
    assert!(run.finish().success());
    run.assert_same_bytes(undisturbed(), "--forget-every 1");
}

#[test]
fn two_runs_side_by_side_do_not_see_each_other() {
    let disturbed = room().with_env("TESSERA_KILL_PLAN", "align=journaled:5;reconstruct=sent:6");
    let quiet = room();
    let (mut first, mut second) = (disturbed.start(), quiet.start());
    assert!(first.wait().unwrap().success(), "{}", disturbed.log());
    assert!(second.wait().unwrap().success(), "{}", quiet.log());
    disturbed.assert_same_bytes(undisturbed(), "disturbed, beside another run");
    quiet.assert_same_bytes(undisturbed(), "beside a disturbed run");
}
