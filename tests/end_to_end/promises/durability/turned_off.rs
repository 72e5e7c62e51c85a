//! A live run on a robot that is turned off without shutdown, again and again.

use crate::common::{Run, room, wait_for};
use std::process::{Child, Command, Stdio};
use tessera_journal::Follower;
use tessera_slam::AlignRecord;
use tessera_stage::ALIGN_JOURNAL;

const N_TIMES: usize = 10;
/// Keyframes by which the map grows before each time.
const GROWTH: usize = 2;

/// Keyframes in the aligner's journal so far.
fn n_keyframes(run: &Run) -> usize {
    let Ok(mut journal) = Follower::open(&run.out().join("align.journal"), ALIGN_JOURNAL) else { return 0 };
    let records = std::iter::from_fn(|| journal.next().ok().flatten());
    records
        .filter(|record| matches!(record, AlignRecord::Frame(f) if f.change.new_keyframe.is_some()))
        .count()
}

fn resume(run: &Run) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tessera"));
    command.args(["resume", "--quiet"]).arg(run.out()).stdin(Stdio::null()).spawn().unwrap()
}

/// Ends the supervisor and all stages in one blow: no process has time to notice that of another.
fn turn_off(run: &Run, mut supervisor: Child) {
    let pids = run.stage_pids().into_iter().chain([supervisor.id()]);
    Command::new("kill").arg("-KILL").args(pids.map(|pid| pid.to_string())).status().unwrap();
    supervisor.wait().unwrap();
    wait_for("the end of all stages", || run.stage_pids().is_empty());
}

#[test]
fn ten_times_in_a_row_the_map_grows_through_all_of_them() {
    let run = room().frames(720).with(&["--live"]);
    let mut supervisor = run.start();
    let mut before = 0;
    for time in 0..N_TIMES {
        wait_for("a larger map", || n_keyframes(&run) >= before + GROWTH);
        turn_off(&run, supervisor);
        let now = n_keyframes(&run);
        assert!(now >= before + GROWTH, "{time}: {now} keyframes after {before}\n{}", run.log());
        before = now;
        supervisor = resume(&run);
    }
    assert!(supervisor.wait().unwrap().success(), "{}", run.log());
    assert!(n_keyframes(&run) > before);
    let summary: serde_json::Value = serde_json::from_slice(&run.output("summary.json")).unwrap();
    // Whatever was missed between two lives, and left out by a busy machine, the camera is where the map has it.
    assert_eq!(summary["frames_apart"], 0, "{summary}");
    let ate_m = summary["final"]["ate_rmse_m"].as_f64().unwrap();
    assert!(ate_m < 0.05, "{summary}");
    assert_eq!(run.leftovers(), Vec::<std::path::PathBuf>::new());
}
