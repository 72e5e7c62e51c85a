//! How runs end early: by a signal, by the supervisor's death, by a name that is taken.

use crate::common::{room, signal, wait_for};
use std::os::unix::fs::PermissionsExt;

#[test]
fn a_signal_ends_all_processes_and_writes_the_outputs() {
    let run = room().frames(100_000);
    let mut child = run.start();
    run.wait_until_busy();
    let pids = run.stage_pids();
    assert_eq!(pids.len(), 4);
    signal(child.id(), "INT");
    assert_eq!(child.wait().unwrap().code(), Some(130), "{}", run.log());
    assert!(run.stage_pids().is_empty());
    assert_eq!(run.leftovers(), Vec::<std::path::PathBuf>::new());
    assert!(run.output("trajectory.txt").len() > 100);
}

#[test]
fn stages_end_when_their_supervisor_is_killed() {
    let run = room().frames(100_000);
    let mut child = run.start();
    run.wait_until_busy();
    signal(child.id(), "KILL");
    child.wait().unwrap();
    wait_for("the stages to end", || run.stage_pids().is_empty());
    // What the dead run left is in no one's way: a run of the same name takes it over.
    let other = room().named(&run.name);
    assert!(other.finish().success());
    assert_eq!(run.leftovers(), Vec::<std::path::PathBuf>::new());
}

#[test]
fn a_name_in_use_is_refused() {
    let run = room().frames(100_000);
    let mut child = run.start();
    run.wait_until_busy();
    let second = room().named(&run.name);
    let output = second.command().output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && text.contains("is going on"), "{text}");
    signal(child.id(), "TERM");
    assert_eq!(child.wait().unwrap().code(), Some(130));
}

#[test]
fn what_a_run_writes_is_its_owners_alone() {
    let run = room().frames(100_000);
    let mut child = run.start();
    run.wait_until_busy();
    let prefix = run.prefix();
    let shared = std::fs::read_dir("/dev/shm").unwrap().flatten().map(|item| item.path());
    let shared = shared.filter(|path| path.file_name().unwrap().to_string_lossy().starts_with(&prefix));
    let durable = ["align.journal", "optimise.journal", "keyframes.store", "run.json", "log.txt"];
    let durable = durable.map(|name| run.out().join(name));
    let mut n = 0;
    for path in shared.chain(durable) {
        let Ok(meta) = std::fs::metadata(&path) else { continue };
        assert_eq!(meta.permissions().mode() & 0o077, 0, "{} is open to others", path.display());
        n += 1;
    }
    assert!(n > 10);
    signal(child.id(), "TERM");
    assert_eq!(child.wait().unwrap().code(), Some(130));
}

#[test]
fn a_hung_stage_is_killed_and_started_again() {
    // A frozen process gives no sign of life.
    let run = room()
        .with(&["--set", "flow.hang_s=1.0"])
        .with_env("TESSERA_KILL_PLAN", "reconstruct=computed:20:stop");
    assert!(run.finish().success());
    assert!(run.log().contains("no sign of life") || run.log().contains("hung"), "{}", run.log());
}
