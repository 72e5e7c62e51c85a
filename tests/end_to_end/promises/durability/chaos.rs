//! `tessera chaos` as a user calls it: random faults, an exact plan, a run that is going on.

use crate::common::room;
use std::path::Path;
use std::process::{Command, Output};

fn chaos(dir: &Path, arguments: &[&str]) -> Output {
    let camera = dir.join("camera.toml");
    Command::new(env!("CARGO_BIN_EXE_tessera"))
        .args(["chaos", "room", "--set", "surface.step=2", "--camera"])
        .arg(camera)
        .arg("--out")
        .arg(dir.join("chaos"))
        .args(arguments)
        .output()
        .unwrap()
}

fn lines(output: &Output) -> Vec<serde_json::Value> {
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{text}{errors}");
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn all_kinds_of_faults_change_nothing() {
    let run = room();
    let faults = "kill,stop,slow,sleep,segv,abort,memory,full,drop,corrupt,index-jump,sync-fails,flip,\
                  page-zeroed,store-cut,store-lost";
    let arguments = ["--frames", "300", "--kills", "20", "--faults", faults, "--json"];
    let arguments = [&arguments[..], &["--set", "flow.hang_s=5"]].concat();
    let lines = lines(&chaos(run.dir.path(), &arguments));
    let total = lines.last().unwrap();
    assert_eq!((&total["event"], &total["kept"]), (&"total".into(), &true.into()), "{total}");
    assert!(total["faults"].as_u64().unwrap() >= 20);
    let runs: Vec<_> = lines.iter().filter(|line| line["event"] == "run").collect();
    assert!(!runs.is_empty() && runs.iter().all(|run| run["identical"] == true && run["frames"] == 300));
    let n_faults = lines.iter().filter(|line| line["event"] == "fault").count() as u64;
    assert_eq!(total["faults"], n_faults);
    assert!(!run.dir.path().join("chaos").exists(), "nothing is left where the promise was kept");
}

/// Longer than a stage may be silent; deaths beside it are those that were planned.
#[test]
fn sleeps_between_kills_change_nothing() {
    let run = room();
    let arguments = ["--frames", "600", "--kills", "6", "--faults", "sleep,kill", "--interval-ms", "200"];
    let arguments = [&arguments[..], &["--set", "flow.hang_s=3", "--json"]].concat();
    let lines = lines(&chaos(run.dir.path(), &arguments));
    let sleeps: Vec<_> = lines.iter().filter(|line| line["fault"] == "sleep").collect();
    assert!(!sleeps.is_empty() && sleeps.iter().all(|fault| fault["outcome"] == "no death"), "{lines:?}");
    assert!(lines.last().unwrap()["kept"] == true, "{lines:?}");
}

#[test]
fn a_plan_strikes_exactly_where_it_says() {
    let run = room();
    let plan = "align 12 stored kill\nalign 12 journaled segv\nalign 30 computed full\nsensor 20 read drop\n\
                sensor 21 read corrupt\nreconstruct 25 computed corrupt\noptimise 0 journaled abort\n";
    // A point that frame 12 does not pass, for it makes no keyframe, would not strike.
    let plan = plan.replace("align 12 stored", "align 0 stored");
    let file = run.dir.path().join("plan");
    std::fs::write(&file, plan).unwrap();
    let lines =
        lines(&chaos(run.dir.path(), &["--frames", "60", "--plan", file.to_str().unwrap(), "--json"]));
    let faults: Vec<_> = lines.iter().filter(|line| line["event"] == "fault").collect();
    let mut places: Vec<String> = faults
        .iter()
        .map(|f| format!("{} {}", f["target"].as_str().unwrap(), f["place"].as_str().unwrap()))
        .collect();
    places.sort();
    assert_eq!(
        places,
        [
            "align computed:30:full",
            "align journaled:12:segv",
            "align stored:0:kill",
            "optimise journaled:0:abort",
            "reconstruct computed:25:corrupt",
            "sensor read:20:drop",
            "sensor read:21:corrupt",
        ]
    );
    let run = lines.iter().find(|line| line["event"] == "run").unwrap();
    assert_eq!((&run["identical"], &run["frames_lost"]), (&true.into(), &0.into()), "{run}");
    assert!(run["messages_refused"].as_u64().unwrap() >= 2, "{run}");
}

#[test]
fn a_run_that_is_going_on_is_disturbed_and_ends_as_it_would_have() {
    let undisturbed = room().frames(600);
    assert!(undisturbed.finish().success());
    let run = room().frames(600);
    let mut child = run.start();
    run.wait_until_busy();
    let arguments =
        ["chaos", "--attach", &run.name, "--kills", "3", "--interval-ms", "100", "--faults", "kill,stop"];
    let output = Command::new(env!("CARGO_BIN_EXE_tessera")).args(arguments).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && text.contains("faults in 1 runs"), "{text}");
    assert!(child.wait().unwrap().success(), "{}", run.log());
    run.assert_same_bytes(&undisturbed, "disturbed from outside");
}

#[test]
fn what_cannot_be_done_is_told() {
    let run = room();
    let plan = run.dir.path().join("plan");
    std::fs::write(&plan, "align 3 sent kill\n").unwrap();
    let plan = plan.to_str().unwrap();
    let cases: [(&[&str], &str); 5] = [
        (&["--stages", "aligner"], "no stage \"aligner\", expected one of sensor"),
        (&["--faults", "fire"], "no fault \"fire\", expected one of kill"),
        (&["--kills", "0"], "expected at least 1"),
        (&["--plan", plan], "line 1: kill point of align is \"sent\", expected one of opened"),
        (&["--plan", "no-such-plan"], "no-such-plan: No such file"),
    ];
    for (arguments, expected) in cases {
        let output = chaos(run.dir.path(), arguments);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {text}");
        assert!(text.contains(expected), "{arguments:?}: {text}");
    }
    let attach = |arguments: &[&str]| {
        let output =
            Command::new(env!("CARGO_BIN_EXE_tessera")).arg("chaos").args(arguments).output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (code, text) = attach(&["--attach", "no-such-run"]);
    assert!(code == Some(2) && text.contains("no run \"no-such-run\" is going on"), "{text}");
    let (code, text) = attach(&["--attach", "x", "--faults", "flip"]);
    assert!(
        code == Some(2) && text.contains("--attach cannot drop, corrupt, jump, fail syncs or damage files"),
        "{text}"
    );
}

/// The promise is judged, not assumed: a run that fails makes chaos fail.
#[test]
fn a_broken_promise_is_told() {
    let run = room();
    // No restarts: the first kill ends the run.
    let arguments = ["--frames", "300", "--kills", "1", "--stages", "align", "--set", "stages.restart=never"];
    let output = chaos(run.dir.path(), &arguments);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(4), "{text}");
    assert!(text.contains("the run failed") && text.contains("outputs differ"), "{text}");
    assert!(run.dir.path().join("chaos/run-1/log.txt").exists(), "the run stays for a look");
}

#[test]
fn a_camera_of_its_own_loses_nothing_that_was_journaled() {
    let run = room();
    // One that keeps its images: every byte is that of the undisturbed run. A live one: no frame is missing.
    for live in [None, Some("--live")] {
        let mut arguments = vec!["--external", "--kills", "6", "--seed", "5", "--frames", "120"];
        arguments.extend(["--faults", "kill,stop,index-jump", "--interval-ms", "150", "--json"]);
        arguments.extend(live);
        let lines = lines(&chaos(run.dir.path(), &arguments));
        let total = lines.last().unwrap();
        assert!(total["kept"] == true && total["faults"].as_u64().unwrap() >= 6, "{total}");
        let runs: Vec<_> = lines.iter().filter(|line| line["event"] == "run").collect();
        assert!(!runs.is_empty());
        for run in runs {
            assert_eq!(
                run["identical"],
                if live.is_some() { serde_json::Value::Null } else { true.into() },
                "{run}"
            );
            assert!(run["frames"].as_u64().unwrap() > 20, "{run}");
        }
    }
}
