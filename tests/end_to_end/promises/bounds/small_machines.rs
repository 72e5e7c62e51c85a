//! Machines that have too little of something: each lack has its outcome, and what was recorded
//! stays whole.

use crate::common::{Run, room};
use crate::requirements::missing;
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

const FRAMES: u64 = 120;

fn undisturbed() -> &'static Run {
    static RUN: OnceLock<Run> = OnceLock::new();
    RUN.get_or_init(|| {
        let run = room().frames(FRAMES);
        assert!(run.finish().success());
        run
    })
}

/// Runs a shell script with the run's command as `"$@"`.
fn run_in(shell: &[&str], script: &str, run: &Run) -> Output {
    let command = run.command();
    let environment = command.get_envs().filter_map(|(name, value)| Some((name, value?)));
    Command::new(shell[0])
        .args(&shell[1..])
        .args(["sh", "-c", script, "sh"])
        .arg(command.get_program())
        .args(command.get_args())
        .envs(environment)
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Goes on without the lack: the end is that of an undisturbed run.
fn assert_resumes(run: &Run, what: &str) {
    let output = Command::new(env!("CARGO_BIN_EXE_tessera"))
        .args(["resume", "--quiet"])
        .arg(run.out())
        .output()
        .unwrap();
    assert!(output.status.success(), "{what}: {}\n{}", errors(&output), run.log());
    run.assert_same_bytes(undisturbed(), what);
}

/// A mount namespace of its own, in which /dev/shm can be made small.
const NAMESPACE: [&str; 4] = ["unshare", "--mount", "--propagation", "private"];

fn has_namespaces() -> bool {
    let mount = ["mount", "-t", "tmpfs", "tmpfs", "/mnt"];
    let probe = Command::new(NAMESPACE[0]).args(&NAMESPACE[1..]).args(mount).output();
    let pgrep = Command::new("pgrep").arg("--version").output();
    let has = [probe, pgrep].into_iter().all(|tried| tried.is_ok_and(|output| output.status.success()));
    if !has {
        missing("namespaces", "none can be made here (unshare --mount), or there is no pgrep");
    }
    has
}

#[test]
fn shared_memory_that_is_too_small_is_told_before_the_start() {
    if !has_namespaces() {
        return;
    }
    let run = room().frames(FRAMES);
    let output = run_in(&NAMESPACE, r#"mount -t tmpfs -o size=4m tmpfs /dev/shm && exec "$@""#, &run);
    let text = errors(&output);
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(text.contains("/dev/shm has") && text.contains("this run needs"), "{text}");
    assert!(!run.out().exists(), "nothing was begun");
}

#[test]
fn shared_memory_that_fills_up_is_told_and_loses_nothing() {
    if !has_namespaces() {
        return;
    }
    // The aligner stops until the rest is taken and the sensor killed: its
    // successor finds room only where it is quicker than the thief.
    let run =
        room().frames(FRAMES).with(&["--set", "flow.hang_s=600"]).with_faults("align=journaled:20:stop");
    let script = r#"mount -t tmpfs -o size=32m tmpfs /dev/shm || exit 99
        "$@" & run=$!
        pid_of() { pgrep -P $run -f " stage $1 "; }
        until [ "$(sed 's/.*) //' /proc/$(pid_of align)/stat 2>/dev/null | cut -c1)" = T ]; do
            kill -0 $run || exit 98; sleep 0.01
        done
        hog() { dd if=/dev/zero bs=4k count=8192 2>/dev/null >> /dev/shm/hog; }
        hog; while kill -0 $run 2>/dev/null; do hog; sleep 0.001; done &
        kill -KILL $(pid_of sensor); kill -CONT $(pid_of align)
        wait $run"#;
    let output = run_in(&NAMESPACE, script, &run);
    let text = errors(&output);
    match output.status.code() {
        Some(0) => run.assert_same_bytes(undisturbed(), "in full shared memory"),
        Some(4) => {
            assert!(text.contains(" ended with ") && text.contains("tessera resume"), "{text}");
            assert_resumes(&run, "after shared memory was full");
        }
        other => panic!("{other:?}: {text}\n{}", run.log()),
    }
}

#[test]
fn too_few_open_files_are_told_before_the_start() {
    let run = room().frames(FRAMES);
    let output = run_in(&["env"], r#"ulimit -n 40; exec "$@""#, &run);
    let text = errors(&output);
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(text.contains("40 files open here, a run needs 128"), "{text}");
    // A soft limit alone is raised.
    assert!(run_in(&["env"], r#"ulimit -S -n 40; exec "$@""#, &run).status.success());
    run.assert_same_bytes(undisturbed(), "with a soft limit of 40 files");
}

#[test]
fn too_little_memory_is_told_and_loses_nothing() {
    // The aligner gets no more memory at frame 30, in each of its lives.
    let run = room().frames(FRAMES).with_faults("align=received:30:memory*");
    let output = run.command().output().unwrap();
    let text = errors(&output);
    assert_eq!(output.status.code(), Some(4), "{text}");
    assert!(text.contains("align ended with") && text.contains("memory"), "{text}");
    assert_resumes(&run, "after a lack of memory");
    // Enough for the program to be loaded and to name what failed, and too little for a run.
    let starts = |kilobytes: &u32| {
        let script = format!("ulimit -v {kilobytes}; exec {} --version", env!("CARGO_BIN_EXE_tessera"));
        Command::new("sh").args(["-c", &script]).output().unwrap().status.success()
    };
    let least = (10_000..400_000).step_by(2_000).find(starts).unwrap();
    let run = room().frames(FRAMES);
    let output = run_in(&["env"], &format!(r#"ulimit -v {}; exec "$@""#, least + 8_000), &run);
    assert!(!output.status.success() && !errors(&output).is_empty(), "{output:?}");
}

#[test]
fn a_disk_that_is_full_for_a_moment_loses_nothing() {
    let run = room().frames(FRAMES).with_faults("align=computed:30:full;optimise=received:0:full");
    assert!(run.finish().success());
    assert_eq!(run.n_deaths(), 2, "{}", run.log());
    run.assert_same_bytes(undisturbed(), "after a full disk");
}

/// Makes every look at the wall clock an hour earlier than the last.
const BACKWARDS: &str = r#"
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdatomic.h>
#include <time.h>
static atomic_long looks;
int clock_gettime(clockid_t id, struct timespec *time) {
    int (*real)(clockid_t, struct timespec *) = dlsym(RTLD_NEXT, "clock_gettime");
    int status = real(id, time);
    if (id == CLOCK_REALTIME) time->tv_sec -= 3600L * atomic_fetch_add(&looks, 1);
    return status;
}
"#;

#[test]
fn a_wall_clock_that_runs_backwards_changes_nothing() {
    let run = room().frames(FRAMES).with_faults("align=journaled:30;sensor=sent:50");
    let library = run.dir.path().join("backwards.so");
    let source = run.dir.path().join("backwards.c");
    std::fs::write(&source, BACKWARDS).unwrap();
    let built =
        Command::new("cc").args(["-shared", "-fPIC", "-o"]).arg(&library).arg(&source).arg("-ldl").status();
    if !built.is_ok_and(|status| status.success()) {
        missing("cc", "no C compiler called cc");
        return;
    }
    let run = run.with_env("LD_PRELOAD", &library.display().to_string());
    assert!(run.finish().success());
    assert_eq!(run.n_deaths(), 2);
    assert!(is_backwards(&run.log()), "the clock was to run backwards\n{}", run.log());
    run.assert_same_bytes(undisturbed(), "with a clock that runs backwards");
    assert_eq!(run.leftovers(), Vec::<std::path::PathBuf>::new());
    let summary: serde_json::Value = serde_json::from_slice(&run.output("summary.json")).unwrap();
    assert!(summary["wall_s"].as_f64().unwrap() < 600.0, "durations go by the monotonic clock: {summary}");
}

/// Whether some line of the log is older than the line before it.
fn is_backwards(log: &str) -> bool {
    let stamps: Vec<&str> = log.lines().filter_map(|line| line.split(' ').next()).collect();
    let is_stamp = |text: &str| text.len() > 20 && text.starts_with("20");
    stamps.windows(2).any(|pair| is_stamp(pair[0]) && is_stamp(pair[1]) && pair[1] < pair[0])
}

#[test]
fn the_optimiser_lets_the_other_stages_go_first() {
    // Longer than the test needs: it ends the run itself.
    let run = room().frames(1800).with(&["--live"]);
    let mut child = run.start();
    run.wait_until_busy();
    let nice = |stage: &str| {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", run.stage_pid(stage))).unwrap();
        let behind_name = stat.rsplit_once(") ").unwrap().1.to_owned();
        behind_name.split(' ').nth(16).unwrap().parse::<i32>().unwrap()
    };
    let [align, optimise] = ["align", "optimise"].map(nice);
    assert_eq!(nice("reconstruct"), align);
    assert_eq!(optimise, 19.min(align + 10));
    child.kill().unwrap();
    child.wait().unwrap();
}
