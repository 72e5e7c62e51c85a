//! More frames than can be worked: workload goes down, then frames are left out, and both are told;
//! it comes back by itself. In lossless mode workload never depends on time.

use crate::common::{Run, room, signal, wait_for, write_images, write_lists};
use std::process::{Child, Command, Stdio};
use tessera_journal::Follower;
use tessera_slam::AlignRecord;
use tessera_stage::ALIGN_JOURNAL;
use tessera_surface::WorkloadLevel;

/// Processes that burn cores for as long as they are held.
struct Burners(Vec<Child>);

impl Burners {
    fn start(n: usize) -> Self {
        let burn = || {
            let mut command = Command::new("sh");
            command.args(["-c", "while :; do :; done"]).stdin(Stdio::null()).spawn().unwrap()
        };
        Self((0..n).map(|_| burn()).collect())
    }
}

impl Drop for Burners {
    fn drop(&mut self) {
        for burner in &mut self.0 {
            let _ = burner.kill();
            let _ = burner.wait();
        }
    }
}

/// Different images of the recording; its frames show them in turn.
const N_IMAGES: u64 = 20;

/// A recording that comes at 1,000 frames a second, which nothing here can work, and then at 8.
fn rushed_recording(run: &Run, n_rushed: u64, n_calm: u64) {
    let folder = run.dir.path().join("recording");
    write_images(&folder, &run.dir.path().join("camera.toml"), N_IMAGES);
    let mut seconds = 0.0;
    let row = |index| {
        let row = (format!("{seconds:.6}"), index % N_IMAGES);
        seconds += if index < n_rushed { 0.001 } else { 0.125 };
        row
    };
    write_lists(&folder, (0..n_rushed + n_calm).map(row));
}

fn workloads(run: &Run) -> Vec<WorkloadLevel> {
    let path = run.out().join("align.journal");
    let mut journal = Follower::open(&path, ALIGN_JOURNAL).unwrap();
    let mut workloads = Vec::new();
    while let Some(record) = journal.next().unwrap() {
        if let AlignRecord::Frame(frame) = record {
            workloads.push(frame.workload);
        }
    }
    workloads
}

#[test]
fn workload_goes_down_under_overload_and_comes_back_by_itself() {
    // More calm frames than a slow machine takes to come back; the run is ended when it has.
    let (n_rushed, n_calm) = (20_000, 4000);
    let run = room();
    rushed_recording(&run, n_rushed, n_calm);
    let folder = run.dir.path().join("recording");
    let run = run.of(&folder).frames(n_rushed + n_calm).with(&["--live"]);
    let burners = Burners::start(2);
    let mut child = run.start();
    wait_for("the lowest level", || run.log().contains("workload is lowered to level 3 of 3"));
    // What comes in while it looks is all that `top` knows: on a busy machine it looks again.
    wait_for("a lower level in top", || {
        let look = Command::new(env!("CARGO_BIN_EXE_tessera"))
            .args(["top", &run.name, "--json", "--interval", "1", "--count", "1"])
            .output()
            .unwrap();
        let line = String::from_utf8(look.stdout).unwrap();
        let look: serde_json::Value = serde_json::from_str(line.trim()).unwrap();
        (1..=3).contains(&look["workload"].as_u64().unwrap())
    });
    drop(burners);
    let is_back = |log: &str| log.contains("workload is raised to level 0 of 3");
    wait_for("all of the workload", || {
        run.log().split_once("workload is lowered to level 3 of 3").is_some_and(|(_, rest)| is_back(rest))
    });
    signal(child.id(), "INT");
    assert_eq!(child.wait().unwrap().code(), Some(130), "{}", run.log());

    let summary: serde_json::Value = serde_json::from_slice(&run.output("summary.json")).unwrap();
    let count = |key: &str| summary[key].as_u64().unwrap();
    let n_left_out = count("frames_dropped") + count("frames_missing");
    assert_eq!(count("frames_processed") + n_left_out, count("frames_read"), "{summary}");
    assert!(n_left_out > n_rushed / 4, "{summary}");
    let workloads = workloads(&run);
    let at = |workload: WorkloadLevel| workloads.iter().filter(|found| **found == workload).count() as u64;
    let counts: Vec<u64> =
        summary["frames_at_workload"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).collect();
    assert_eq!(counts, WorkloadLevel::ALL.map(at), "the journal says the same");
    assert_eq!(counts.iter().sum::<u64>(), count("frames_processed"));
    assert!(counts.iter().all(|n| *n > 0), "every level was used: {counts:?}");
    assert!(run.log().contains("workload is lowered to level 1 of 3"), "{}", run.log());
}

#[test]
fn without_load_shedding_workload_stays() {
    let run = room();
    rushed_recording(&run, 1000, 0);
    let folder = run.dir.path().join("recording");
    let run = run.of(&folder).frames(1000).with(&["--live", "--set", "flow.load_shedding=false"]);
    assert!(run.finish().success());
    assert!(workloads(&run).iter().all(|workload| *workload == WorkloadLevel::Full));
    assert!(!run.log().contains("workload is"));
}

#[test]
fn in_lossless_mode_workload_never_depends_on_time() {
    let undisturbed = room();
    assert!(undisturbed.finish().success());
    let burners = Burners::start(2);
    let plan = "align=received:5:slow,received:6:slow,received:7:slow,received:8:slow,received:9:slow;\
                reconstruct=received:20:slow,received:21:slow";
    let run = room().with_faults(plan);
    assert!(run.finish().success());
    drop(burners);
    assert_eq!(run.log().matches("struck by received").count(), 7, "{}", run.log());
    assert!(workloads(&run).iter().all(|workload| *workload == WorkloadLevel::Full));
    run.assert_same_bytes(&undisturbed, "slow stages beside processes that burn both cores");
}
