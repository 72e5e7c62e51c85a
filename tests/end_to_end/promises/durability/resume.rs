//! Runs that were broken off and went on: the outputs keep their bytes.

use crate::common::{Run, room, signal, wait_for};
use std::os::unix::fs::MetadataExt;
use std::process::{Command, Output};
use std::sync::OnceLock;

const FRAMES: u64 = 60;

fn undisturbed() -> &'static Run {
    static RUN: OnceLock<Run> = OnceLock::new();
    RUN.get_or_init(|| {
        let run = room().frames(FRAMES);
        assert!(run.finish().success());
        run
    })
}

fn resume(run: &Run) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tessera")).args(["resume", "--quiet"]).arg(run.out()).output().unwrap()
}

fn assert_resumes(run: &Run, what: &str) {
    let output = resume(run);
    assert!(output.status.success(), "{what}: {}\n{}", String::from_utf8_lossy(&output.stderr), run.log());
    run.assert_same_bytes(undisturbed(), what);
    assert_eq!(run.leftovers(), Vec::<std::path::PathBuf>::new(), "{what}");
}

#[test]
fn after_an_interrupt() {
    let run = room().frames(FRAMES);
    let mut child = run.start();
    run.wait_until_busy();
    let inode = || std::fs::metadata(run.out().join("config.toml")).unwrap().ino();
    let before = inode();
    signal(child.id(), "INT");
    // Fast machines may have finished already.
    assert!(matches!(child.wait().unwrap().code(), Some(0 | 130)));
    assert_resumes(&run, "after an interrupt");
    // Half a configuration would be one of defaults: what is there is not written again.
    assert_eq!(inode(), before);
}

#[test]
fn after_the_whole_group_was_killed() {
    let run = room().frames(FRAMES);
    let mut child = run.start();
    run.wait_until_busy();
    signal(child.id(), "KILL");
    run.stage_pids().into_iter().for_each(|pid| {
        let _ = Command::new("kill").args(["-KILL", &pid.to_string()]).status();
    });
    child.wait().unwrap();
    assert_resumes(&run, "after all were killed");
}

#[test]
fn a_stage_frozen_when_its_supervisor_died_never_writes_again() {
    let run = room().frames(FRAMES).with_env("TESSERA_KILL_PLAN", "align=computed:20:stop");
    let mut child = run.start();
    run.wait_until_stopped("align");
    signal(child.id(), "KILL");
    child.wait().unwrap();
    // The kernel may wake and hang up a stopped process that its parent's death orphaned: then
    // none is left, and resume has none to end.
    wait_for("the others to end", || run.stage_pids().len() <= 1);
    assert_resumes(&run, "with a frozen aligner left");
    assert!(run.stage_pids().is_empty());
}

#[test]
fn with_torn_files() {
    let run = room().frames(FRAMES);
    assert!(run.finish().success());
    let journal = run.out().join("align.journal");
    let whole = std::fs::read(&journal).unwrap();
    for tenth in 0..10 {
        let cut = whole.len() * tenth / 10 + 7 * tenth;
        std::fs::write(&journal, &whole[..cut]).unwrap();
        assert_resumes(&run, &format!("align.journal cut at {cut} of {}", whole.len()));
    }
    // A page of the store that never reached the disk takes everything from its keyframe on.
    let store = run.out().join("keyframes.store");
    let mut bytes = std::fs::read(&store).unwrap();
    let page = bytes.len() / 2 / 4096 * 4096;
    bytes[page..page + 4096].fill(0);
    std::fs::write(&store, &bytes).unwrap();
    assert_resumes(&run, "a page of the store is zero");
    for name in ["optimise.journal", "keyframes.store", "align.journal"] {
        std::fs::write(run.out().join(name), "").unwrap();
        assert_resumes(&run, &format!("{name} is empty"));
    }
}

#[test]
fn a_full_disk_is_told_and_loses_nothing() {
    // With many keyframes the store is larger than any segment of shared memory.
    let many = ["--set", "mapping.keyframe.translation_m=0.02", "--set", "mapping.keyframe.rotation_deg=1"];
    let frames = 400;
    let whole = room().frames(frames).with(&many);
    assert!(whole.finish().success());
    let store_bytes = std::fs::metadata(whole.out().join("keyframes.store")).unwrap().len();
    let run = room().frames(frames).with(&many).with(&["--set", "flow.window=1"]);
    // A limit on the size of files, in kB, stands in for a full disk: the store is the largest file.
    let limit = store_bytes * 2 / 3 / 1024;
    let script = format!("trap '' XFSZ; ulimit -f {limit}; exec \"$@\"");
    let command = run.command();
    let output = Command::new("bash")
        .args(["-c", &script, "bash"])
        .arg(command.get_program())
        .args(command.get_args())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(4), "{text}");
    assert!(text.contains("keyframes.store") && text.contains("align ended with exit status 4"), "{text}");
    let output = resume(&run);
    assert!(output.status.success(), "{}\n{}", String::from_utf8_lossy(&output.stderr), run.log());
    run.assert_same_bytes(&whole, "after a full disk");
}
