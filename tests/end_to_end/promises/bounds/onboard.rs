//! The preset `onboard`: threads that change no byte, a map with a budget, a live run to its end.

use crate::common::{FORGETFUL, Run, room};
use tessera_slam::KeyframeState;
use tessera_stage::ALIGN_JOURNAL;

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
    let mut journal = tessera_journal::Follower::open(&path, ALIGN_JOURNAL).unwrap();
    while let Some(record) = journal.next().unwrap() {
        state.apply(&record);
    }
    let n_active = state.keyframes.iter().filter(|k| k.is_active()).count();
    assert!(n_active == 10 && state.keyframes.len() > 13, "{n_active} of {}", state.keyframes.len());

    let forgetful = room().frames(240).with(&["--set", BUDGET, "--set", FORGETFUL]);
    assert!(forgetful.finish().success());
    forgetful.assert_same_bytes(&plain, "a budget, and all state forgotten after each frame");
    let killed = room().frames(240).with(&["--set", BUDGET]).with_faults(
        "align=journaled:90+,computed:180+;optimise=solving:0;reconstruct=computed:120;sensor=sent:200",
    );
    assert!(killed.finish().success());
    assert!(killed.n_deaths() == 5, "{}", killed.log());
    killed.assert_same_bytes(&plain, "a budget, and deaths");
    surfaces_are_given_up(&plain, &state, BUDGET);
}

/// What becomes of the culled keyframes of `plain`, with its `budget`, where none of their surfaces is
/// kept.
fn surfaces_are_given_up(plain: &Run, state: &tessera_slam::TrackerState, budget: &str) {
    let none_kept = ["--set", budget, "--set", "flow.culled_mb=0"];
    let sparse = room().frames(240).with(&none_kept).with(&["--set", FORGETFUL]);
    assert!(sparse.finish().success(), "{}", sparse.log());
    for name in ["trajectory.txt", "trajectory_online.txt", "keyframes.txt"] {
        assert!(sparse.output(name) == plain.output(name), "{name}: what is given up moves nothing");
    }
    let store = tessera_journal::StoreView::open(&sparse.out().join("keyframes.store")).unwrap();
    // The next frames would look back at those of the last seconds.
    let newest = state.keyframes.last().unwrap().stamp_nanos;
    let is_recent = |k: &KeyframeState| newest - k.stamp_nanos <= 5_000_000_000;
    assert!(state.keyframes.iter().any(|k| !k.is_active() && !is_recent(k)));
    for keyframe in &state.keyframes {
        let is_there = store.read(&tessera_stage::journal_slot(&keyframe.slot)).unwrap().is_some();
        assert_eq!(is_there, keyframe.is_active() || is_recent(keyframe), "keyframe {}", keyframe.id);
    }
    assert!(sparse.output("map.ply").len() < plain.output("map.ply").len());
    let killed = room()
        .frames(240)
        .with(&none_kept)
        .with_faults("align=journaled:90+,stored:180+,ended:240;optimise=solving:0");
    assert!(killed.finish().success(), "{}", killed.log());
    killed.assert_same_bytes(&sparse, "surfaces given up, and deaths");
    // A map without them is a map; whether so small a camera finds its place in it is another matter.
    let next = room().with(&["--map", sparse.out().to_str().unwrap()]);
    next.finish();
    let summary: serde_json::Value = serde_json::from_slice(&next.output("summary.json")).unwrap();
    assert_eq!(summary["map_keyframes"], state.keyframes.len(), "{}", next.log());
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
