//! The preset `onboard`: threads that change no byte, a map with a budget, a live run to its end.

use crate::common::room;

#[test]
fn one_thread_in_each_stage_changes_no_byte() {
    let run = room().with(&["--set", "stages.threads=1"]);
    assert!(run.finish().success(), "{}", run.log());
    let plain = room();
    assert!(plain.finish().success());
    run.assert_same_bytes(&plain, "one thread in each stage");
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
        count("frames_processed") + count("frames_dropped") + count("frames_missing"),
        crate::common::FRAMES.parse::<u64>().unwrap()
    );
    assert!(count("frames_processed") > 0, "{summary}");
    let config = String::from_utf8(run.output("config.toml")).unwrap();
    assert!(config.contains("live = true") && config.contains("threads = 1"), "{config}");
}
