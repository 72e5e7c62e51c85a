//! Stages that die of their own doing: what is told, and when the run is given up.

use crate::common::{Run, room};

/// Runs a plan that cannot end well; answers the exit code and what was said.
fn fail(run: &Run) -> (Option<i32>, String) {
    let output = run.command().output().unwrap();
    assert_eq!(run.leftovers(), Vec::<std::path::PathBuf>::new());
    // What was recorded before is there all the same.
    assert!(run.output("trajectory.txt").len() > 100);
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn a_frame_that_panics_ends_the_run_by_name() {
    let (code, text) = fail(&room().with_faults("align=computed:9:panic*"));
    assert_eq!(code, Some(4), "{text}");
    for word in ["align", "exit status 101", "3 times at frame 9", "told to panic at computed:9"] {
        assert!(text.contains(word), "{word:?} is not in: {text}");
    }
}

#[test]
fn a_frame_that_crashes_ends_the_run_by_name() {
    let (code, text) = fail(&room().with_faults("reconstruct=received:12:segv*"));
    assert_eq!(code, Some(4), "{text}");
    assert!(text.contains("reconstruct ended with signal 11 (SIGSEGV), 3 times at frame 12"), "{text}");
}

#[test]
fn a_frame_that_hangs_ends_the_run_by_name() {
    let run = room().with(&["--set", "flow.hang_s=2"]).with_faults("align=received:9:hang*");
    let (code, text) = fail(&run);
    assert_eq!(code, Some(4), "{text}");
    assert!(text.contains("no sign of life") && text.contains("3 times at frame 9"), "{text}");
}

#[test]
fn one_panic_is_survived() {
    let run = room().with_faults("reconstruct=computed:9:panic,received:11:stop");
    assert!(run.with(&["--set", "flow.hang_s=2"]).finish().success());
}

#[test]
fn a_policy_of_no_restarts_is_kept() {
    let run = room().with(&["--set", "stages.restart=never"]).with_faults("align=acknowledged:9");
    let (code, text) = fail(&run);
    assert_eq!(code, Some(4), "{text}");
    assert!(text.contains("align ended with signal 9 (SIGKILL)"), "{text}");
}

#[test]
fn the_log_has_the_reason_and_the_last_words_of_the_dead() {
    let run = room().with_faults("align=acknowledged:9;sensor=sent:10");
    assert!(run.finish().success());
    let log = run.log();
    let told = log.lines().find(|line| line.contains("align died: signal 9 (SIGKILL); it is started again"));
    assert!(told.is_some_and(|line| line.contains("last_line=") && line.contains(" align[")), "{log}");
    assert!(log.contains("sensor died: signal 9 (SIGKILL); it is started again"), "{log}");
}

#[test]
fn a_stage_that_needs_more_memory_than_it_may_use_is_named() {
    let run = room().frames(50_000).with(&["--preload", "--set", "stages.memory_mb=100"]);
    let output = run.command().output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(4), "{text}");
    let told = "sensor ended with signal 6 (SIGABRT): it needs more memory than stages.memory_mb = 100";
    assert!(text.contains(told), "{text}");
    assert_eq!(run.log().matches("it is started again").count(), 2, "{}", run.log());
    // Enough is no limit at all.
    let run = room().with(&["--preload", "--set", "stages.memory_mb=1000"]);
    assert!(run.finish().success());
}

#[test]
fn mixed_versions_are_refused() {
    let run = room();
    assert!(run.finish().success());
    let path = run.out().join("run.json");
    let text = std::fs::read_to_string(&path).unwrap();
    let own = env!("CARGO_PKG_VERSION");
    std::fs::write(&path, text.replace(&format!("\"version\": \"{own}\""), "\"version\": \"9.9.9\""))
        .unwrap();
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_tessera"))
        .args(["stage", "align", "--run-dir"])
        .arg(run.out())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2));
    assert!(text.contains(&format!("this is Tessera {own}, the run was started by Tessera 9.9.9")), "{text}");
}
