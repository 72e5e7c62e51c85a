//! A map with a budget of keyframes: it stays within it, and the camera stays where it is.

mod common;

use common::{ate_m, frames, run, scene};
use std::collections::BTreeMap;
use tessera_geometry::Pose;
use tessera_offline::Method;
use tessera_slam::{AlignRecord, Context, Correction, Optimiser, PoseHistory, TrackerState};
use tessera_sources::{SceneName, SimulationOptions};

const BUDGET: u32 = 16;

fn named(correction: &Correction) -> Vec<u32> {
    correction.keyframes.iter().map(|k| k.id).collect()
}

#[test]
fn a_thinned_map_still_knows_where_the_camera_is() {
    let source = scene(SceneName::Room, &SimulationOptions::default());
    // Once round, and on into what has been seen.
    let indices: Vec<u64> = (0..360).chain(0..90).collect();
    let frames = frames(&source, &indices);
    let plain = Method::default();
    let mut thinned = plain.clone();
    thinned.mapping.keyframe.budget = BUDGET;
    let (all, some) = (run(&source, &plain, &frames), run(&source, &thinned, &frames));
    assert_eq!(some.n_untracked(), 0);
    assert!(some.n_keyframes() > 2 * BUDGET as usize, "{} keyframes are no test", some.n_keyframes());

    let mut state = TrackerState::default();
    let (mut poses, mut most_active) = (PoseHistory::default(), 0);
    let (mut asked, mut said) = (Vec::new(), BTreeMap::new());
    for record in &some.records {
        state.apply(record);
        poses.apply(record);
        let active: Vec<u32> = state.keyframes.iter().filter(|k| k.is_active()).map(|k| k.id).collect();
        match record {
            AlignRecord::Frame(frame) if frame.change.request.is_some() => asked.clone_from(&active),
            AlignRecord::Correction(applied) if state.is_ended => {
                let named = named(&applied.correction);
                assert!(active.iter().all(|id| named.contains(id)), "the last one names culled ones as well");
            }
            AlignRecord::Correction(applied) => {
                assert_eq!(named(&applied.correction), asked, "what was solved for and no more");
                for pair in &applied.correction.loops {
                    let now = (pair.verdict, pair.weight >= 0.5);
                    assert_ne!(said.insert((pair.newer, pair.older), now), Some(now), "said again: {pair:?}");
                }
            }
            _ => (),
        }
        most_active = most_active.max(active.len());
        // Whatever left the working map hangs on something in it.
        let anchors = state.keyframes.iter().filter_map(|k| k.anchored_to);
        assert!(anchors.into_iter().all(|id| active.binary_search(&id).is_ok()));
    }
    assert_eq!(most_active, BUDGET as usize);
    assert!(some.n_corrections() > 0, "nothing was optimised");
    assert!(!said.is_empty(), "no loop was judged on the way");
    let by_state: Vec<Pose> = state.keyframes.iter().map(|k| Pose::from(&k.world_from_camera)).collect();
    assert_eq!(poses.keyframe_poses().collect::<Vec<_>>(), by_state, "both folds move the culled ones alike");

    let (full_m, thin_m) = (ate_m(&source, &indices, &all.last()), ate_m(&source, &indices, &some.last()));
    // A keyframe every 22 degrees instead of every 6.
    assert!(full_m < 0.01 && thin_m < 0.02, "{thin_m} m with a budget, {full_m} m without");

    // The same from the records alone, as an optimiser that restarted reads them.
    let context = Context::new(
        tessera_sources::Source::camera(&source),
        &thinned.surface,
        &thinned.registration,
        &thinned.mapping,
    );
    let mut optimiser = Optimiser::new(context);
    some.records.iter().for_each(|record| optimiser.apply(record));
    assert_eq!(optimiser.state(), &state);
}
