//! Maps of several runs, made by the program itself: joined where they share a place, apart where not.

use crate::processes::{base, copy_of, fleet, free_port, map_files, status, uplink, wait_for};
use crate::requirements::data;
use crate::robot::tessera;
use crate::run::assert_same;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use tessera_evaluation::{EvaluationOptions, evaluate, read_tum};
use tessera_fleet::summary::{JoinVerdict, Summary};

/// A run of a simulated scene or of a recording, in a folder.
fn run_of(tessera: &Path, folder: &Path, source: &str, (skip, frames): (u64, u64)) -> PathBuf {
    let scene = Path::new(source).file_name().unwrap().to_str().unwrap();
    let name = format!("{scene}-{skip}-{}", std::process::id());
    let out = folder.join(format!("{scene}-{skip}"));
    let (skip, frames) = (skip.to_string(), frames.to_string());
    let done = Command::new(tessera)
        .args(["run", source, "--quiet", "--skip", &skip, "--frames", &frames, "--name", &name, "--out"])
        .arg(&out)
        .status()
        .unwrap();
    assert!(done.success(), "{scene}");
    out
}

/// The map of runs from disk.
fn map_of(folder: &Path, runs: &[&PathBuf]) -> Summary {
    let mut command = fleet(&["base", folder.to_str().unwrap(), "--quiet"]);
    for run in runs {
        command.arg("--add").arg(run);
    }
    assert!(command.status().unwrap().success());
    Summary::read(&folder.join("map")).unwrap()
}

fn ate_m(trajectory: &Path, run: &Path) -> f64 {
    let truth = read_tum(&run.join("groundtruth.txt")).unwrap();
    let estimate = read_tum(trajectory).unwrap();
    evaluate(&truth, &estimate, &EvaluationOptions::default()).unwrap().ate_rmse_m
}

#[test]
fn halves_of_a_room_become_one_map_no_worse_than_each_and_another_room_stays_apart() {
    let Some(tessera) = tessera() else { return };
    let dir = tempfile::tempdir().unwrap();
    let first = run_of(&tessera, dir.path(), "room", (0, 60));
    let second = run_of(&tessera, dir.path(), "room", (40, 60));
    let elsewhere = run_of(&tessera, dir.path(), "house", (0, 40));
    let before = std::fs::read(first.join("align.journal")).unwrap();
    let folder = dir.path().join("base");
    let summary = map_of(&folder, &[&first, &second, &elsewhere]);
    assert_eq!(std::fs::read(first.join("align.journal")).unwrap(), before, "the run is only read");
    assert_eq!(summary.components.len(), 2, "{summary:?}");
    assert_eq!(summary.components[0].runs.len(), 2);
    assert_eq!(summary.joins.len(), 1);
    assert_eq!(summary.joins[0].verdict, JoinVerdict::Held);
    assert!(summary.joins[0].keyframes_agree >= 3 && summary.loops_between_runs_closed > 0);
    for (run, summary) in [&first, &second].into_iter().zip(&summary.runs) {
        let joint = folder.join("map").join(format!("trajectory_{}.txt", summary.label));
        let (alone, joint) = (ate_m(&run.join("trajectory.txt"), run), ate_m(&joint, run));
        assert!(joint <= alone * 1.1 + 5e-4, "{}: {alone} m alone, {joint} m joint", summary.label);
    }
    // Once more, added one after the other: the same runs in the same order.
    let other = dir.path().join("again");
    map_of(&other, &[&first]);
    map_of(&other, &[&second]);
    map_of(&other, &[&elsewhere]);
    assert!(map_files(&other) == map_files(&folder), "the same runs in the same order have the same map");
}

#[test]
fn halves_of_a_kitchen_become_one_map_no_worse_than_each() {
    let (Some(tessera), Some(kitchen)) = (tessera(), data("kitchen_450")) else { return };
    let dir = tempfile::tempdir().unwrap();
    let kitchen = kitchen.to_str().unwrap();
    let first = run_of(&tessera, dir.path(), kitchen, (0, 250));
    let second = run_of(&tessera, dir.path(), kitchen, (200, 250));
    let folder = dir.path().join("base");
    let summary = map_of(&folder, &[&first, &second]);
    assert_eq!(summary.components.len(), 1, "{summary:?}");
    for (run, summary) in [&first, &second].into_iter().zip(&summary.runs) {
        let joint = folder.join("map").join(format!("trajectory_{}.txt", summary.label));
        let (alone, joint) = (ate_m(&run.join("trajectory.txt"), run), ate_m(&joint, run));
        assert!(joint <= alone, "{}: {alone} m alone, {joint} m joint", summary.label);
    }
}

#[test]
fn a_run_is_followed_while_it_goes_on_and_alone_it_is_its_own_map() {
    let Some(tessera) = tessera() else { return };
    let dir = tempfile::tempdir().unwrap();
    let (run, folder, port) = (dir.path().join("run"), dir.path().join("base"), free_port());
    let mut bases = base(&folder, port, 1);
    let _robot = uplink(&run, "a", port);
    let name = format!("followed-{}", std::process::id());
    let mut going_on = Command::new(&tessera)
        .args(["run", "room", "--frames", "60", "--quiet", "--name", &name, "--out"])
        .arg(&run)
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    wait_for("the first frames", || status(&folder).runs.first().is_some_and(|run| run.frames > 0));
    assert!(going_on.wait().unwrap().success());
    bases.wait_for_success("the base");
    assert_same(&run, &copy_of(&folder, "a"));
    let rows = |path: PathBuf| {
        let text = std::fs::read_to_string(path).unwrap();
        text.lines().filter(|line| !line.starts_with('#')).map(str::to_owned).collect::<Vec<_>>()
    };
    let label = format!("a_{name}");
    let joint = rows(folder.join("map").join(format!("trajectory_{label}.txt")));
    assert_eq!(joint.len(), 60);
    assert_eq!(joint, rows(run.join("trajectory.txt")));
    assert_eq!(map_files(&folder)["map.ply"], std::fs::read(run.join("map.ply")).unwrap());
}
