//! A corridor of bare walls: its surfaces fit wherever along it they are tried.

mod common;

use common::ate_m;
use tessera_offline::Method;
use tessera_sources::Source;

/// Frames of the building: from a lobby down the corridor, 14 m.
const DOWN: std::ops::Range<u64> = 5450..5990;
const EVERY: usize = 2;

#[test]
fn a_corridor_of_bare_walls_keeps_its_length() {
    let source = common::small_building();
    let indices: Vec<u64> = DOWN.step_by(EVERY).collect();
    let frames = common::frames(&source, &indices);
    let records = common::run(&source, &Method::default(), &frames);
    assert_eq!(records.n_untracked(), 0);
    let last = records.last();
    let error_m = ate_m(&source, &indices, &last);
    assert!(error_m < 0.1, "{error_m} m");
    // No frame is away from those beside it.
    let poses = &last.poses;
    let step = |pair: &[tessera_geometry::Pose]| (pair[0].inverse() * pair[1]).translation.vector.norm();
    let longest_m = poses.windows(2).map(step).fold(0.0, f64::max);
    assert!(longest_m < 0.15, "a step of {longest_m} m");
    let truth = &source.ground_truth().unwrap().poses;
    let [first, end] = [indices[0], indices[indices.len() - 1]].map(|k| truth[k as usize]);
    let (way_m, true_m) = (step(&[poses[0], poses[poses.len() - 1]]), step(&[first, end]));
    assert!((way_m - true_m).abs() < 0.02 * true_m, "{way_m} m in place of {true_m} m");
}
