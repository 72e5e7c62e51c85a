//! `tessera ablate`: both tables, from the real executable.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

const FRAMES: &str = "45";

fn ablate(dir: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tessera"))
        .arg("ablate")
        .args(arguments)
        .current_dir(dir)
        .output()
        .unwrap()
}

fn refusal(dir: &Path, arguments: &[&str], code: i32) -> String {
    let output = ablate(dir, arguments);
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {text}");
    text
}

/// The simulated room through a small camera.
fn room(dir: &Path, arguments: &[&str]) -> Output {
    crate::common::write_camera(&dir.join("camera.toml"));
    let room = ["room", "--camera", "camera.toml", "--frames", FRAMES, "--set", "surface.max_depth_m=7"];
    let output = ablate(dir, &[&room, arguments].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

#[test]
fn the_columns_differ_and_the_whole_system_is_tessera_run() {
    let dir = tempfile::tempdir().unwrap();
    let set = "mapping.keyframe.translation_m=0.08";
    let output = room(dir.path(), &["--json", "--set", set]);
    let tables: Value = serde_json::from_slice(&output.stdout).unwrap();
    let row = &tables["rows"][0];
    assert_eq!((row["sequence"].as_str(), row["frames"].as_u64()), (Some("room"), Some(45)));
    let errors: Vec<f64> = row["cells"]
        .as_array()
        .unwrap()
        .iter()
        .map(|cell| cell["rpe_m_per_s"]["median"].as_f64().unwrap())
        .collect();
    assert_eq!(errors.len(), 11);
    for (place, error) in errors.iter().enumerate() {
        assert!((1e-5..1.0).contains(error), "{errors:?}");
        assert!(!errors[..place].contains(error), "two columns are the same run: {errors:?}");
    }
    let improvement = tables["average_improvement_percent"][10].as_f64().unwrap();
    assert!((improvement - 100.0 * (1.0 - errors[10] / errors[2])).abs() < 1e-9);

    let run = Command::new(env!("CARGO_BIN_EXE_tessera"))
        .args(["run", "room", "--json", "--camera", "camera.toml", "--frames", FRAMES, "--out", "run"])
        .args(["--name", &format!("test-{}-ablate", std::process::id())])
        .args(["--set", "surface.max_depth_m=7", "--set", set])
        .current_dir(dir.path())
        .output()
        .unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let summary: Value = serde_json::from_slice(&run.stdout).unwrap();
    // The run's figures come from its files, which hold nine digits.
    for (found, expected) in [
        (&row["whole"]["ate_m"]["median"], &summary["final"]["ate_rmse_m"]),
        (&row["whole"]["rpe_online_m_per_s"]["median"], &summary["online"]["rpe_translation_rmse_m_per_s"]),
    ] {
        let (found, expected) = (found.as_f64().unwrap(), expected.as_f64().unwrap());
        assert!((found - expected).abs() < 1e-8, "{found} instead of {expected}");
    }
}

#[test]
fn seeds_give_a_spread_and_markdown_is_what_people_get() {
    let dir = tempfile::tempdir().unwrap();
    let output = room(dir.path(), &["--seeds", "2"]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("Median (least to most) over 2 sampling seeds."), "{text}");
    let row = text.lines().find(|line| line.starts_with("| room |")).unwrap();
    let last = row.trim_end_matches(" |").rsplit('|').next().unwrap().trim();
    let (least, most) = last.split_once('(').unwrap().1.trim_end_matches(')').split_once(" to ").unwrap();
    assert!(least.parse::<f64>().unwrap() <= most.parse::<f64>().unwrap(), "{row}");
    assert!(text.contains("| average improvement |") && text.contains("| Tessera |"), "{text}");
}

#[test]
fn what_cannot_be_measured_is_refused_before_the_work() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    assert!(refusal(here, &["nowhere"], 3).contains("no source"), "a folder that is not there");
    assert!(refusal(here, &["room", "--set", "surface.stepp=2"], 2).contains("surface.step"));
    assert!(refusal(here, &["room", "--config", "papers"], 2).contains("papers"));
    assert!(refusal(here, &["room", "--seeds", "0"], 2).contains("--seeds"));
    assert!(refusal(here, &["room", "--frames", "0"], 2).contains("--frames"));
    assert!(refusal(here, &[], 2).contains("SEQUENCE"));
    crate::common::write_camera(&here.join("camera.toml"));
    let short = ["room", "--camera", "camera.toml", "--frames", "9"];
    let text = refusal(here, &short, 3);
    assert!(text.contains("9 frames over 0.27 s, expected poses one second apart"), "{text}");

    std::fs::create_dir(here.join("blind")).unwrap();
    crate::common::write_camera(&here.join("blind/camera.toml"));
    for list in ["rgb.txt", "depth.txt"] {
        std::fs::write(here.join("blind").join(list), "0.1 a.png\n").unwrap();
    }
    assert!(refusal(here, &["blind"], 3).contains("blind has no ground truth"));
}
