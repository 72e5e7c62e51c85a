//! What was seen long ago contradicts what was seen just now: the extended window.

mod common;

use common::{frames, run, scene, surfaces_alone};
use tessera_geometry::{Pose, translation_rotation_norms};
use tessera_offline::Records;
use tessera_slam::FrameRecord;
use tessera_sources::{SceneName, SimulationOptions, Source};

/// Once round the room and a little on, with so few matches that drift shows, and no correction
/// but what the extended window does.
fn go_round(extended_window: bool) -> (Records, Vec<u64>) {
    let source = scene(SceneName::Room, &SimulationOptions::default());
    let indices: Vec<u64> = (0..400).step_by(3).map(|k| k % 360).collect();
    let mut method = surfaces_alone();
    method.mapping.window.size = 3;
    method.mapping.window.match_budget = 300;
    method.mapping.loops.min_frames = 80;
    method.mapping.loops.conflict_translation_m = 0.0005;
    method.mapping.loops.conflict_rotation_deg = 0.1;
    method.mapping.loops.min_similarity = 1.0;
    method.mapping.loops.delay_frames = 1000;
    method.mapping.loops.extended_window = extended_window;
    (run(&source, &method, &frames(&source, &indices)), indices)
}

#[test]
fn a_conflict_is_settled_between_the_frame_and_its_window() {
    let source = scene(SceneName::Room, &SimulationOptions::default());
    let truth = &source.ground_truth().unwrap().poses;
    let (records, indices) = go_round(true);
    let (without, _) = go_round(false);
    let is_settled = |f: &FrameRecord| f.reason.contains("conflict of");
    assert!(!without.frames().any(is_settled));
    let (at, settled) = records.frames().enumerate().find(|(_, f)| is_settled(f)).expect("a conflict");
    assert!(!settled.moved.is_empty());
    assert!(settled.request.is_some(), "the optimiser is asked at once");
    assert!(settled.moved.iter().all(|k| k.id != 0), "the origin stays");
    // Up to there both runs are the same; then the frame comes nearer to where it really is.
    let error_m = |records: &Records| {
        let frame = records.frames().nth(at).unwrap();
        let pose = Pose::from(&frame.world_from_camera);
        let true_pose = truth[indices[0] as usize].inverse() * truth[indices[at] as usize];
        translation_rotation_norms(&(pose.inverse() * true_pose)).0
    };
    let (with_m, without_m) = (error_m(&records), error_m(&without));
    assert!(with_m < without_m, "{with_m} m with, {without_m} m without");
    // What hangs on the moved keyframes and what is published agree.
    let before = records.frames().nth(at - 1).unwrap();
    let odom = |frame: &tessera_slam::FrameRecord| {
        Pose::from(&frame.world_from_odom).inverse() * Pose::from(&frame.world_from_camera)
    };
    let step = translation_rotation_norms(&(odom(before).inverse() * odom(settled)));
    let true_step = translation_rotation_norms(
        &(truth[indices[at - 1] as usize].inverse() * truth[indices[at] as usize]),
    );
    assert!((step.0 - true_step.0).abs() < 0.02, "odometry jumps by {} m", step.0);
}
