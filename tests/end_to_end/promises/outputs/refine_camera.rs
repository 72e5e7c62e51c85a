//! `run --refine-camera`: off unless asked for, the same bytes under kills, a camera file that
//! `--camera` reads.

use crate::common::{Run, room};
use std::process::Command;

const CAMERA_FILE: &str = "camera_refined.toml";

fn refining() -> Run {
    room().frames(120).with(&["--refine-camera"])
}

#[test]
fn a_refined_camera_comes_out_and_kills_change_no_byte() {
    let run = refining();
    assert!(run.finish().success());
    let summary: serde_json::Value = serde_json::from_slice(&run.output("summary.json")).unwrap();
    let refined = &summary["refinement"]["refined"];
    assert!(refined["moved_px"].as_f64().is_some_and(|px| px > 0.0), "{summary:#}");
    assert!(refined["final_before"]["ate_rmse_m"].is_number(), "{summary:#}");
    let file = run.out().join(CAMERA_FILE);
    let name = format!("{}-again", run.name);
    let again = Command::new(env!("CARGO_BIN_EXE_tessera"))
        .args(["run", "room", "--frames", "2", "--quiet", "--name", &name, "--set", "surface.step=2"])
        .args([
            "--camera".as_ref(),
            file.as_os_str(),
            "--out".as_ref(),
            run.dir.path().join("again").as_os_str(),
        ])
        .output()
        .unwrap();
    assert!(again.status.success(), "{}", String::from_utf8_lossy(&again.stderr));

    let plain = room().frames(120);
    assert!(plain.finish().success());
    assert!(!plain.out().join(CAMERA_FILE).exists());
    assert!(plain.output("trajectory_online.txt") == run.output("trajectory_online.txt"));
    assert!(plain.output("trajectory.txt") != run.output("trajectory.txt"));

    let n_requests = summary["global_optimisations"].as_u64().unwrap();
    let last = n_requests - 1;
    for plan in [
        format!("optimise=solving:{last}"),
        format!("optimise=journaled:{last};align=journaled:60"),
        "align=ended:120".to_owned(),
    ] {
        let killed = refining().with_faults(&plan);
        assert!(killed.finish().success(), "{plan}");
        assert!(killed.log().contains("it is started again"), "{plan}: nothing died");
        killed.assert_same_bytes(&run, &plan);
        assert!(killed.output(CAMERA_FILE) == run.output(CAMERA_FILE), "{plan}");
    }
}

#[test]
fn a_run_that_says_too_little_keeps_its_camera_and_says_why() {
    let run = room().frames(2).with(&["--refine-camera"]);
    assert!(run.finish().success());
    let summary: serde_json::Value = serde_json::from_slice(&run.output("summary.json")).unwrap();
    let reason = summary["refinement"]["kept"].as_str().unwrap_or_default();
    assert!(reason.contains("without a final optimisation"), "{summary:#}");
    assert!(!run.out().join(CAMERA_FILE).exists());
}
