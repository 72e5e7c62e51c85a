//! Submaps that were never joined: each has its own files, and the run says so.

use crate::common::{room, write_scenario};

#[test]
fn submaps_that_are_apart_are_counted_and_have_files_of_their_own() {
    let run = room().with(&["--set", "mapping.submaps.after_s=0.3"]);
    let mut frames: Vec<Option<u64>> = (0..40).map(Some).collect();
    frames.extend([None; 3]);
    frames.extend((110..140).map(Some));
    let folder = run.dir.path().join("recording");
    write_scenario(&folder, &run.dir.path().join("camera.toml"), &frames);
    let run = run.frames(frames.len() as u64).of(&folder);
    assert!(run.finish().success());

    let summary: serde_json::Value = serde_json::from_slice(&run.output("summary.json")).unwrap();
    for (key, expected) in [("submaps", 2), ("submaps_joined", 0), ("submaps_apart", 1)] {
        assert_eq!(summary[key], expected, "{key}: {}", summary["verdict"]);
    }
    let n_apart = summary["frames_apart"].as_u64().unwrap();
    assert!((15..30).contains(&n_apart), "{n_apart}");
    let verdict = summary["verdict"].to_string();
    let said = format!("1 submap was never joined: {n_apart} frames are in files of their own");
    assert!(summary["verdict"]["grade"] == "doubtful" && verdict.contains(&said), "{verdict}");
    let report = String::from_utf8(run.output("report.html")).unwrap();
    assert!(report.contains(&said), "the report names them");

    let n_rows = |name: &str| {
        let text = String::from_utf8(run.output(name)).unwrap();
        text.lines().filter(|line| !line.starts_with('#')).count() as u64
    };
    let n_frames = frames.len() as u64;
    assert_eq!(n_rows("trajectory_submap_1.txt"), n_apart);
    assert_eq!(n_rows("trajectory.txt"), n_frames - n_apart);
    assert_eq!((n_rows("trajectory_marked.txt"), n_rows("trajectory_online.txt")), (n_frames, n_frames));
    let marked = String::from_utf8(run.output("trajectory_marked.txt")).unwrap();
    let of_submap = |ending: &str| marked.lines().filter(|line| line.ends_with(ending)).count() as u64;
    assert_eq!((of_submap(" tracked 1"), of_submap(" predicted 1")), (n_apart, 0));
}
