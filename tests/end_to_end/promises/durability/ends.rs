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

/// One waited for ever in an opening of iceoryx2, for shared memory that another had left without a size.
#[test]
fn a_stage_that_hangs_ends_with_its_supervisor() {
    let run = room().frames(100_000).with(&["--set", "flow.hang_s=600"]).with_faults("sensor=read:9:hang");
    let mut child = run.start();
    wait_for("a stage to hang", || run.log().contains("struck by read:9:hang"));
    signal(child.id(), "KILL");
    child.wait().unwrap();
    wait_for("the stages to end", || run.stage_pids().is_empty());
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
    let run = room().with(&["--set", "flow.hang_s=1.0"]).with_faults("reconstruct=computed:20:stop");
    assert!(run.finish().success());
    assert!(run.log().contains("no sign of life") || run.log().contains("hung"), "{}", run.log());
}

#[test]
fn two_runs_that_begin_at_once_in_one_folder_are_one_run() {
    for _ in 0..3 {
        let first = room();
        let out = first.out().display().to_string();
        let second = room().with(&["--out", &out]);
        let mut second = second.command();
        // The folder of the first, a name of its own.
        let arguments: Vec<_> = second.get_args().map(std::ffi::OsStr::to_owned).collect();
        let at = arguments.iter().position(|argument| argument == "--out").unwrap();
        let rest = arguments[..at].iter().chain(&arguments[at + 2..]);
        second = std::process::Command::new(env!("CARGO_BIN_EXE_tessera"));
        second.args(rest).stdout(std::process::Stdio::null()).stderr(std::process::Stdio::piped());
        let children = [first.start(), second.spawn().unwrap()];
        let outputs = children.map(|child| child.wait_with_output().unwrap());
        let texts = outputs.each_ref().map(|output| String::from_utf8_lossy(&output.stderr).into_owned());
        let n_done = outputs.iter().filter(|output| output.status.success()).count();
        assert_eq!(n_done, 1, "{texts:?}");
        let loser = outputs.iter().position(|output| !output.status.success()).unwrap();
        assert_eq!(outputs[loser].status.code(), Some(2), "{texts:?}");
        let words = ["another run goes on in", "holds a run already"];
        assert!(words.iter().any(|words| texts[loser].contains(words)), "{texts:?}");
        assert!(first.tessera(&["verify"]).status.success());
    }
}

#[test]
fn the_end_of_the_source_is_counted_as_no_frame() {
    let run = room().frames(20);
    assert!(run.finish().success());
    let statistics: serde_json::Value = serde_json::from_slice(&run.output("statistics.json")).unwrap();
    for stage in ["sensor", "reconstruct", "align"] {
        assert_eq!(statistics["stages"][stage]["frames"], 20, "{stage}: {statistics}");
    }
    let again = run.tessera(&["resume"]);
    let text = String::from_utf8_lossy(&again.stdout).into_owned();
    assert!(again.status.success() && text.contains("had finished: what it recorded is read"), "{text}");
}
