//! How good the map of a run is: its own keyframes, fused at its own poses.

mod common;

use common::{Shot, kitchen, measure, open};
use tessera_evaluation::{AteOptions, ate};
use tessera_geometry::{Pose, Twist, Vector6};
use tessera_offline::{Method, RawFrame, Run};
use tessera_sources::Source;

/// The keyframes of a run over all frames, in the world of the ground truth: the final trajectory
/// is put on the true one as a whole, as for its ATE.
fn keyframes(source: &dyn Source) -> Vec<Shot> {
    let mut run = Run::new(source.camera(), &Method::default()).unwrap();
    let grid = run.grid();
    for index in 0..source.n_frames().unwrap() {
        run.push(&RawFrame::read(source, index).unwrap());
    }
    let (records, map) = run.finish_with_map();
    let truth = source.ground_truth().unwrap();
    let errors = ate(&records.last(), truth, &AteOptions::default()).unwrap();
    println!("ATE {:.1} mm", 1e3 * errors.statistics_m.rmse);
    let shot = |(keyframe, vertices): (&tessera_slam::KeyframeState, Vec<_>)| Shot {
        grid,
        vertices,
        world_from_camera: errors.groundtruth_from_estimate * Pose::from(&keyframe.world_from_camera),
        velocity: Twist::from_vector(&Vector6::from(keyframe.velocity)),
    };
    map.keyframes.iter().zip(map.surfaces).map(shot).collect()
}

#[test]
fn the_map_of_a_run_is_the_room() {
    let [accuracy, completeness] = measure("room", 12, &keyframes(&*open("room", true)));
    assert!(accuracy.0 < 8.0 && accuracy.1 < 30.0, "{accuracy:?}");
    assert!(completeness.0 < 8.0 && completeness.1 < 40.0, "{completeness:?}");
}

#[test]
fn the_map_of_a_run_is_the_kitchen() {
    let Some(folder) = kitchen() else { return };
    let [accuracy, completeness] = measure(&folder, 6, &keyframes(&*open(&folder, true)));
    assert!(accuracy.0 < 5.0 && accuracy.1 < 25.0, "{accuracy:?}");
    assert!(completeness.0 < 8.0 && completeness.1 < 40.0, "{completeness:?}");
}
