//! A stage's place on the machine: cores, priority and locked memory, or a line that says why not.

use crate::common::{Run, room, signal};

const STAGES: [&str; 4] = ["sensor", "reconstruct", "align", "optimise"];

/// A field of `/proc/PID/status`.
fn status(pid: u32, field: &str) -> String {
    let text = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap();
    let line = text.lines().find(|line| line.starts_with(&format!("{field}:"))).unwrap();
    line.split_once(':').unwrap().1.trim().to_owned()
}

/// A field of `/proc/PID/stat`, as `man proc` counts them.
fn stat(pid: u32, field: usize) -> String {
    let text = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap();
    let rest = text.rsplit_once(") ").unwrap().1;
    rest.split_whitespace().nth(field - 3).unwrap().to_owned()
}

/// Whether a stage got what it asked for; if not, it must have said why.
fn is_granted(run: &Run, stage: &str, wish: &str) -> bool {
    let log = run.log();
    let mut lines = log.lines().filter(|line| line.contains(&format!(" {stage}[")));
    let granted = lines.clone().any(|line| line.contains(" placed: ") && line.contains(wish));
    let refused = lines.any(|line| line.contains(" WARN ") && line.contains(&format!("without {wish}: ")));
    assert!(granted != refused, "{stage}, {wish}: granted {granted}, refused {refused}\n{log}");
    granted
}

#[test]
fn each_stage_takes_its_place_and_changes_no_byte() {
    let mut arguments = vec!["--set".to_owned(), "flow.hang_s=60".to_owned()];
    // The last core that the test itself may use.
    let allowed = status(std::process::id(), "Cpus_allowed_list");
    let core = allowed.rsplit([',', '-']).next().unwrap().to_owned();
    for stage in STAGES {
        for wish in [&format!("cores=[{core}]")[..], "threads=1", "lock_memory=true"] {
            arguments.extend(["--set".to_owned(), format!("stages.{stage}.{wish}")]);
        }
    }
    for wish in ["sensor.nice=5", "reconstruct.nice=-5", "align.fifo=20", "optimise.nice=10"] {
        arguments.extend(["--set".to_owned(), format!("stages.{wish}")]);
    }
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let run = room().with(&arguments).with_env("TESSERA_KILL_PLAN", "align=acknowledged:20:stop");
    let mut child = run.start();
    let stopped = run.wait_until_stopped("align");
    for stage in STAGES {
        let pid = run.stage_pid(stage);
        assert!(is_granted(&run, stage, &format!("cores {core}")), "{}", run.log());
        assert_eq!(status(pid, "Cpus_allowed_list"), core, "{stage}");
        assert!(is_granted(&run, stage, "1 threads"), "{}", run.log());
        let is_locked = is_granted(&run, stage, "locked memory");
        let locked_kb: u64 = status(pid, "VmLck").trim_end_matches(" kB").parse().unwrap();
        assert_eq!(locked_kb > 0, is_locked, "{stage}");
    }
    for (stage, nice) in [("sensor", "5"), ("reconstruct", "-5"), ("optimise", "10")] {
        let is_nice = is_granted(&run, stage, &format!("niceness {nice}"));
        assert_eq!(stat(run.stage_pid(stage), 19) == nice, is_nice, "{stage}");
    }
    let is_real_time = is_granted(&run, "align", "SCHED_FIFO priority 20");
    let (priority, policy) = (stat(stopped, 40), stat(stopped, 41));
    let expected = if is_real_time { ("20", "1") } else { ("0", "0") };
    assert_eq!((priority.as_str(), policy.as_str()), expected);
    signal(stopped, "CONT");
    assert!(child.wait().unwrap().success(), "{}", run.log());
    let plain = room();
    assert!(plain.finish().success());
    run.assert_same_bytes(&plain, "each stage in its place");
}

#[test]
fn a_map_with_a_budget_survives_deaths_to_the_bit() {
    const BUDGET: &str = "mapping.keyframe.budget=10";
    let plain = room().frames(240).with(&["--set", BUDGET]);
    assert!(plain.finish().success());
    let mut state = tessera_slam::TrackerState::default();
    let path = plain.out().join("align.journal");
    let mut journal = tessera_journal::Follower::open(&path, "align").unwrap();
    while let Some(record) = journal.next().unwrap() {
        state.apply(&record);
    }
    let n_active = state.keyframes.iter().filter(|k| k.is_active()).count();
    assert!(n_active == 10 && state.keyframes.len() > 13, "{n_active} of {}", state.keyframes.len());

    let forgetful = room().frames(240).with(&["--set", BUDGET, "--forget-every", "1"]);
    assert!(forgetful.finish().success());
    forgetful.assert_same_bytes(&plain, "a budget, and all state forgotten after each frame");
    let killed = room().frames(240).with(&["--set", BUDGET]).with_env(
        "TESSERA_KILL_PLAN",
        "align=journaled:90+,computed:180+;optimise=solving:0;reconstruct=computed:120;sensor=sent:200",
    );
    assert!(killed.finish().success());
    assert!(killed.n_deaths() == 5, "{}", killed.log());
    killed.assert_same_bytes(&plain, "a budget, and deaths");
}

#[test]
fn the_preset_runs_live_to_its_end() {
    let run = room().with(&["--config", "onboard"]);
    assert!(run.finish().success());
    let summary: serde_json::Value = serde_json::from_slice(&run.output("summary.json")).unwrap();
    let count = |key: &str| summary[key].as_u64().unwrap();
    assert_eq!(
        count("frames_processed") + count("frames_dropped") + count("frames_lost"),
        crate::common::FRAMES.parse::<u64>().unwrap()
    );
    assert!(count("frames_processed") > 0, "{summary}");
    let config = String::from_utf8(run.output("config.toml")).unwrap();
    assert!(config.contains("live = true") && config.contains("cores = [1]"), "{config}");
}
