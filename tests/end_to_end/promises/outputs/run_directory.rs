//! What a run leaves: every frame accounted for, the same bytes whatever the circumstances.

use crate::common::{FRAMES, Run, room, signal, wait_for};
use std::path::Path;
use std::process::Command;

fn tessera(arguments: &[&str]) -> std::process::Output {
    Command::new(env!("CARGO_BIN_EXE_tessera")).args(arguments).output().unwrap()
}

fn summary(run: &Run) -> serde_json::Value {
    serde_json::from_slice(&run.output("summary.json")).unwrap()
}

fn n_rows(text: &[u8]) -> usize {
    String::from_utf8_lossy(text).lines().filter(|line| !line.starts_with('#')).count()
}

#[test]
fn every_frame_has_its_row() {
    let run = room();
    assert!(run.finish().success());
    let n_frames: usize = FRAMES.parse().unwrap();
    for name in ["trajectory.txt", "trajectory_online.txt"] {
        assert_eq!(n_rows(&run.output(name)), n_frames, "{name}");
    }
    assert_eq!(n_rows(&run.output("states.csv")), n_frames + 1);
    let summary = summary(&run);
    assert_eq!(summary["ended"], "finished");
    for (key, expected) in [
        ("frames_read", n_frames),
        ("frames_processed", n_frames),
        ("frames_dropped", 0),
        ("frames_missing", 0),
    ] {
        assert_eq!(summary[key], expected, "{key}");
    }
    assert_eq!(summary["final_optimisation"], true);
    for stage in ["sensor", "reconstruct", "align", "optimise"] {
        assert_eq!(summary["restarts"][stage], 0);
        assert!(summary["cpu_ms_per_frame"][stage].as_f64().unwrap() > 0.0);
        assert!(summary["peak_rss_mb"][stage].as_f64().unwrap() > 1.0);
        let latency = &summary["latency_ms"][stage];
        assert!(latency["p50"].as_f64().unwrap() > 1e-4, "{stage}: {latency}");
        assert!(latency["max"].as_f64().unwrap() >= latency["p50"].as_f64().unwrap());
    }
    assert!(summary["shared_memory_mb"].as_f64().unwrap() > 0.1);
    for of in ["final", "online"] {
        assert_eq!(summary[of]["pairs"], n_frames);
        assert!(summary[of]["ate_rmse_m"].as_f64().unwrap() < 0.05, "{}", summary[of]);
    }
}

#[test]
fn two_runs_write_the_same_bytes() {
    let (one, other) = (room(), room());
    assert!(one.finish().success() && other.finish().success());
    one.assert_same_bytes(&other, "a second run of the same");
    // The configuration that a run writes is the run.
    let config = one.out().join("config.toml");
    let again = room().with(&["--config", config.to_str().unwrap()]);
    assert!(again.finish().success());
    one.assert_same_bytes(&again, "a run from the first one's config.toml");
}

#[test]
fn threads_do_not_change_a_byte() {
    let with_threads = |n: &str| room().with_env("RAYON_NUM_THREADS", n);
    let (one, two) = (with_threads("1"), with_threads("2"));
    assert!(one.finish().success() && two.finish().success());
    one.assert_same_bytes(&two, "1 and 2 threads");
}

#[test]
fn export_writes_the_same_bytes_again() {
    let run = room();
    assert!(run.finish().success());
    let elsewhere = run.dir.path().join("elsewhere");
    let output =
        tessera(&["export", run.out().to_str().unwrap(), "--out", elsewhere.to_str().unwrap(), "--json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    for name in crate::common::OUTPUTS.iter().chain(&["states.csv", "summary.json", "trajectory_marked.txt"])
    {
        assert!(run.output(name) == std::fs::read(elsewhere.join(name)).unwrap(), "{name} differs");
    }
    let printed: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(printed, summary(&run));
    let n_files = std::fs::read_dir(&elsewhere).unwrap().count();
    assert_eq!(n_files, 7, "an export leaves its seven outputs and nothing else");
}

#[test]
fn live_mode_accounts_for_every_frame() {
    let run = room().with(&["--live"]);
    assert!(run.finish().success());
    let summary = summary(&run);
    let number = |key: &str| summary[key].as_u64().unwrap();
    let n_frames: u64 = FRAMES.parse().unwrap();
    assert_eq!(number("frames_read"), n_frames);
    assert_eq!(number("frames_processed") + number("frames_dropped") + number("frames_missing"), n_frames);
    assert!(number("frames_processed") > 0);
    assert_eq!(n_rows(&run.output("trajectory.txt")) as u64, number("frames_processed"));
    assert_eq!(
        n_rows(&run.output("states.csv")) as u64,
        1 + number("frames_processed") + number("frames_dropped")
    );
}

#[test]
fn an_interrupted_run_resumes_to_the_same_bytes() {
    let whole = room();
    assert!(whole.finish().success());
    let run = room();
    let mut child = run.start();
    run.wait_until_busy();
    signal(child.id(), "TERM");
    let code = child.wait().unwrap().code();
    // A fast machine may have been done already.
    assert!(code == Some(130) || code == Some(0), "{code:?}\n{}", run.log());
    if code == Some(130) {
        assert_eq!(summary(&run)["ended"], "interrupted");
        assert_eq!(summary(&run)["final_optimisation"], false);
    }
    let output = tessera(&["resume", run.out().to_str().unwrap(), "--quiet"]);
    assert!(output.status.success(), "{}\n{}", String::from_utf8_lossy(&output.stderr), run.log());
    run.assert_same_bytes(&whole, "interrupted and resumed");
    assert_eq!(summary(&run)["ended"], "finished");
}

#[test]
fn status_shows_the_processes_of_a_run_that_is_going_on() {
    let run = room().with(&["--frames", "100000"]);
    let mut child = run.start();
    run.wait_until_busy();
    let mut status = serde_json::Value::Null;
    wait_for("all stages to be seen", || {
        let output = tessera(&["status", &run.name, "--json"]);
        status = serde_json::from_slice(&output.stdout).unwrap_or_default();
        let stages = status["stages"].as_array().cloned().unwrap_or_default();
        stages.len() == 4 && stages.iter().all(|stage| stage["pid"].is_u64())
    });
    let mut seen: Vec<u64> =
        status["stages"].as_array().unwrap().iter().map(|stage| stage["pid"].as_u64().unwrap()).collect();
    seen.sort_unstable();
    let mut pids: Vec<u64> = run.stage_pids().into_iter().map(u64::from).collect();
    pids.sort_unstable();
    assert_eq!(seen, pids, "{status}");
    assert_eq!(status["running"], true);
    for key in ["stage", "pid", "state", "restarts", "frames", "latency_ms", "queue"] {
        assert!(status["stages"][2].get(key).is_some(), "{key} is missing: {status}");
    }
    signal(child.id(), "INT");
    child.wait().unwrap();
}

#[test]
fn a_real_recording_is_processed_frame_by_frame() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/fr1_desk_9");
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let name = format!("test-desk-{}", std::process::id());
    let output = tessera(&[
        "run",
        folder.to_str().unwrap(),
        "--json",
        "--name",
        &name,
        "--out",
        out.to_str().unwrap(),
    ]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(summary["frames_processed"], 9);
    assert_eq!(summary["frames_untracked"], 0);
    assert!(summary["final"]["ate_rmse_m"].as_f64().unwrap() < 0.02, "{summary}");
}
