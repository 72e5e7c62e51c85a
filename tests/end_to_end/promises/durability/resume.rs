//! Runs that were broken off and went on: the outputs keep their bytes.

use crate::common::{Run, room, signal, wait_for};
use std::collections::BTreeMap;
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
    let run = room().frames(FRAMES).with_faults("align=computed:20:stop");
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
    for tenth in 1..10 {
        let cut = whole.len() * tenth / 10 + 7 * tenth;
        std::fs::write(&journal, &whole[..cut]).unwrap();
        assert_resumes(&run, &format!("align.journal cut at {cut} of {}", whole.len()));
    }
}

/// Bytes of the three files that hold what was recorded.
fn recorded(run: &Run) -> [Option<Vec<u8>>; 3] {
    NAMES.map(|name| std::fs::read(run.out().join(name)).ok())
}

const NAMES: [&str; 3] = ["align.journal", "optimise.journal", "keyframes.store"];

#[test]
fn what_was_recorded_is_never_cut_off_without_consent() {
    let run = room().frames(FRAMES);
    assert!(run.finish().success());
    let whole = recorded(&run).map(Option::unwrap);
    let page_of = |name: &str| {
        let mut bytes = whole[NAMES.iter().position(|other| *other == name).unwrap()].clone();
        let page = bytes.len() / 2 / 4096 * 4096;
        let end = (page + 4096).min(bytes.len() - 600);
        bytes[page..end].fill(0);
        bytes
    };
    let short = whole[2][..whole[2].len() / 2].to_vec();
    let cases: [(&str, Option<Vec<u8>>, &str); 8] = [
        ("align.journal", Some(page_of("align.journal")), "align.journal is damaged at byte"),
        ("align.journal", Some(Vec::new()), "align.journal is damaged at byte 0"),
        ("align.journal", None, "align.journal is not there"),
        ("optimise.journal", None, "optimise.journal is not there"),
        ("keyframes.store", Some(page_of("keyframes.store")), "have checksum"),
        ("keyframes.store", Some(short), "lie behind its end"),
        ("keyframes.store", Some(Vec::new()), "are missing"),
        ("keyframes.store", None, "keyframes.store is not there"),
    ];
    for (name, bytes, words) in cases {
        let path = run.out().join(name);
        match bytes {
            Some(bytes) => std::fs::write(&path, bytes).unwrap(),
            None => std::fs::remove_file(&path).unwrap(),
        }
        let before = recorded(&run);
        for _ in 0..2 {
            let output = resume(&run);
            let text = String::from_utf8_lossy(&output.stderr).into_owned();
            assert_eq!(output.status.code(), Some(3), "{name}, {words}: {text}");
            assert!(text.contains(words) && text.contains("--drop-damaged"), "{text}");
            assert!(recorded(&run) == before, "{name}: nothing is changed");
        }
        let verified = run.tessera(&["verify"]);
        assert_eq!(verified.status.code(), Some(3), "{}", String::from_utf8_lossy(&verified.stdout));
        let output = run.tessera(&["resume", "--quiet", "--drop-damaged"]);
        assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
        run.assert_same_bytes(undisturbed(), &format!("{name}, {words}, without what was damaged"));
        assert!(run.tessera(&["verify"]).status.success());
        let copies = copies_beside(&run);
        let kept = |bytes: &Vec<u8>| copies.values().any(|copy| copy == bytes);
        // Each file that was cut, with records or surfaces in it, is there as it was.
        let journal = before[0].as_ref().filter(|bytes| !bytes.is_empty());
        if name != "optimise.journal" {
            assert!(journal.is_none_or(kept), "{name}: {:?}", copies.keys());
        }
        let store = before[2].as_ref().filter(|bytes| bytes.len() > 4096 && name != "optimise.journal");
        assert!(store.is_none_or(kept), "{name}: {:?}", copies.keys());
        copies.keys().for_each(|name| std::fs::remove_file(run.out().join(name)).unwrap());
        for (name, bytes) in NAMES.iter().zip(&whole) {
            std::fs::write(run.out().join(name), bytes).unwrap();
        }
    }
}

/// Files that `--drop-damaged` set aside.
fn copies_beside(run: &Run) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(run.out()).unwrap().map(Result::unwrap);
    let names = entries.map(|entry| entry.file_name().into_string().unwrap());
    let copies = names.filter(|name| name.contains(".damaged-"));
    copies.map(|name| (name.clone(), std::fs::read(run.out().join(name)).unwrap())).collect()
}

#[test]
fn a_stage_that_finds_damage_ends_the_run_and_cuts_nothing() {
    // A bit flips in the journal while the aligner is dead: its successor must not cut there.
    let run = room().frames(FRAMES).with_faults("align=computed:40:stop");
    let mut child = run.start();
    let stopped = run.wait_until_stopped("align");
    let path = run.out().join("align.journal");
    let mut bytes = std::fs::read(&path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&path, &bytes).unwrap();
    for name in ["align.checkpoint", "optimise.checkpoint"] {
        let _ = std::fs::remove_file(run.out().join(name));
    }
    signal(stopped, "KILL");
    assert_eq!(child.wait().unwrap().code(), Some(3), "{}", run.log());
    assert!(run.log().contains("align.journal is damaged at byte"), "{}", run.log());
    assert_eq!(std::fs::read(&path).unwrap(), bytes);
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
