//! Each stage killed at each kill point: the outputs keep their bytes, nothing stays behind.

use crate::common::{FORGETFUL, Run, room, signal, wait_for};
use rustix::process::{Pid, Resource, Rlimit, prlimit};
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
    let run = room().with_faults(plan);
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
    [
        "reconstruct=opened:0",
        "reconstruct=received:0",
        "reconstruct=extracted:5",
        "reconstruct=computed:9",
        "reconstruct=sent:21",
    ]
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

/// Checkpoints as often as there can be.
const CHECKPOINTS: [&str; 2] = ["--set", "flow.checkpoint_kb=1"];

/// Records of align's journal that restarted stages did not have to read.
fn n_from_checkpoints(run: &Run, stage: &str) -> u64 {
    let log = run.log();
    let lines = log.lines().filter(|line| line.contains(&format!(" {stage}[")));
    let spared = lines.filter_map(|line| line.split("a checkpoint spares ").nth(1));
    spared.filter_map(|rest| rest.split(' ').next()?.parse::<u64>().ok()).sum()
}

#[test]
fn a_successor_goes_on_from_a_checkpoint() {
    let plan = "align=checkpointed:1+,received:30+;optimise=checkpointed:0+";
    let run = room().with(&CHECKPOINTS).with_faults(plan);
    assert!(run.finish().success(), "{}", run.log());
    assert_eq!(run.log().matches("it is started again").count(), 3, "{}", run.log());
    assert!(n_from_checkpoints(&run, "align") > 10, "{}", run.log());
    assert!(n_from_checkpoints(&run, "optimise") > 0, "{}", run.log());
    run.assert_same_bytes(undisturbed(), plan);
    assert_eq!(run.leftovers(), Vec::<std::path::PathBuf>::new());
    assert!(!run.out().join("align.checkpoint").exists(), "it is not needed any more");
}

#[test]
fn all_state_can_be_forgotten_and_checkpoints_damaged() {
    let run = room().with(&CHECKPOINTS).with(&["--set", FORGETFUL]);
    let mut child = run.start();
    let mut older = Vec::new();
    let mut n_damaged = 0;
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        let path = run.out().join(["align.checkpoint", "optimise.checkpoint"][n_damaged % 2]);
        if let Ok(mut bytes) = std::fs::read(&path) {
            let middle = bytes.len() / 2;
            match n_damaged % 5 {
                0 => drop(std::fs::remove_file(&path)),
                1 => bytes.truncate(middle),
                2 => bytes.iter_mut().skip(middle).take(1).for_each(|byte| *byte ^= 16),
                3 if n_damaged % 2 == 1 && !older.is_empty() => std::mem::swap(&mut bytes, &mut older),
                _ => older.clone_from(&bytes),
            }
            if n_damaged % 5 != 0 {
                let _ = std::fs::write(&path, bytes);
            }
            n_damaged += 1;
        }
        std::thread::sleep(std::time::Duration::from_millis(3));
    };
    assert!(status.success(), "{}", run.log());
    assert!(n_damaged > 5, "{n_damaged} checkpoints were damaged");
    assert!(n_from_checkpoints(&run, "align") > 10, "none was whole");
    run.assert_same_bytes(undisturbed(), "checkpoints damaged, all state forgotten");
}

#[test]
fn several_die_at_once() {
    check("sensor=sent:12;reconstruct=computed:12;align=journaled:10");
    check("sensor=opened:0;reconstruct=opened:0;align=opened:0;optimise=opened:0");
}

#[test]
fn all_state_can_be_forgotten_after_each_frame() {
    let run = room().with(&["--set", FORGETFUL]);
    assert!(run.finish().success());
    run.assert_same_bytes(undisturbed(), FORGETFUL);
}

#[test]
fn two_runs_side_by_side_do_not_see_each_other() {
    let disturbed = room().with_faults("align=journaled:5;reconstruct=sent:6");
    let quiet = room();
    let (mut first, mut second) = (disturbed.start(), quiet.start());
    assert!(first.wait().unwrap().success(), "{}", disturbed.log());
    assert!(second.wait().unwrap().success(), "{}", quiet.log());
    disturbed.assert_same_bytes(undisturbed(), "disturbed, beside another run");
    quiet.assert_same_bytes(undisturbed(), "beside a disturbed run");
}

/// A stage without memory cannot map what a partner that is started again has made: it read from none, for ever.
#[test]
fn a_stage_that_cannot_connect_with_a_new_partner_is_started_again() {
    let cases = [
        ("sensor", "read", "reconstruct"),
        ("reconstruct", "received", "align"),
        ("align", "received", "sensor"),
    ];
    for (partner, point, stage) in cases {
        let run = room().with_faults(&format!("{partner}={point}:20:stop"));
        let mut child = run.start();
        let stopped = run.wait_until_stopped(partner);
        let pid = Pid::from_raw(run.stage_pid(stage).try_into().unwrap());
        prlimit(pid, Resource::As, Rlimit { current: Some(0), maximum: Some(0) }).unwrap();
        signal(stopped, "KILL");
        let mut status = None;
        wait_for("the end of the run", || {
            status = child.try_wait().unwrap();
            status.is_some()
        });
        assert!(status.unwrap().success(), "{}", run.log());
        assert!(run.log().contains(&format!("{stage} died")), "{}", run.log());
        run.assert_same_bytes(undisturbed(), stage);
    }
}
