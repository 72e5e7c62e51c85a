//! A camera that starts where surfaces leave a direction open keeps its colour: they cannot judge it.

mod common;

use common::ate_m;
use tessera_offline::Method;
use tessera_sources::{SceneName, SimulatedSource, SimulationOptions};

/// Error of the frames of a source as finally corrected, metres; all of them must be tracked.
fn error_m(source: &SimulatedSource, indices: &[u64]) -> f64 {
    let frames = common::frames(source, indices);
    let records = common::run(source, &Method::default(), &frames);
    assert_eq!(records.n_untracked(), 0);
    ate_m(source, indices, &records.last())
}

#[test]
fn a_start_in_a_corridor_at_a_walk() {
    let indices: Vec<u64> = (2400..2700).step_by(5).collect();
    let error_m = error_m(&common::small_building(), &indices);
    assert!(error_m < 0.05, "{error_m} m");
}

#[test]
fn a_start_before_one_wall() {
    let source = common::scene(SceneName::Wall, &SimulationOptions::default());
    let indices: Vec<u64> = (0..300).step_by(5).collect();
    let error_m = error_m(&source, &indices);
    assert!(error_m < 0.005, "{error_m} m");
}
