//! How well the variances of two poses with their references fixed tell the error of the motion between them, from which
//! a velocity is published.

mod common;

use tessera_geometry::{Matrix6, Pose, Vector6, adjoint, log};
use tessera_offline::Method;
use tessera_slam::FrameRecord;
use tessera_sources::{SceneName, SimulationOptions, Source};

/// A base 1 m below the camera and 0.2 m behind it, as seen from a camera that looks forward.
fn camera_from_base() -> Pose {
    Pose::translation(0.0, 1.0, -0.2)
}

/// Error of the base's motion from each frame to the next, and its covariance.
fn steps(method: &Method) -> Vec<(Vector6, Matrix6)> {
    let source = common::scene(SceneName::Room, &SimulationOptions::default());
    let indices: Vec<u64> = (0..120).collect();
    let records = common::run(&source, method, &common::frames(&source, &indices));
    let truth = &source.ground_truth().unwrap().poses;
    let frames: Vec<&FrameRecord> = records.frames().collect();
    let to_base = adjoint(&camera_from_base().inverse());
    let odom = |frame: &FrameRecord| {
        Pose::from(&frame.pose.world_from_odom).inverse() * Pose::from(&frame.pose.world_from_camera)
    };
    let variance = |frame: &FrameRecord| {
        let step = frame.evidence.noise.and_then(|noise| noise.step_variance);
        step.map(|step| Matrix6::from_diagonal(&Vector6::from(step)))
    };
    let step = |k: usize| {
        let [before, now] = [frames[k - 1], frames[k]];
        let moved = odom(before).inverse() * odom(now);
        let error = log(&(moved.inverse() * truth[k - 1].inverse() * truth[k])).to_vector();
        let back = adjoint(&moved.inverse());
        let sum = back * variance(before)? * back.transpose() + variance(now)?;
        Some((to_base * error, to_base * sum * to_base.transpose()))
    };
    (1..frames.len()).filter_map(step).collect()
}

#[test]
fn the_motion_between_frames_errs_as_the_variances_with_fixed_references_state() {
    for (what, method) in [("features", Method::default()), ("surfaces", common::surfaces_alone())] {
        let all = steps(&method);
        assert!(all.len() >= 110, "{what}: {} steps have a variance", all.len());
        let is_within =
            |(error, c): &&(Vector6, Matrix6)| (0..6).all(|k| error[k].abs() <= 3.0 * c[(k, k)].sqrt());
        let share = all.iter().filter(is_within).count() as f64 / all.len() as f64;
        assert!(share >= 0.95, "{what}: {share} of the steps lie within three standard deviations");
        let nees: f64 =
            all.iter().map(|(error, c)| error.dot(&(c.try_inverse().unwrap() * error))).sum::<f64>();
        let nees = nees / (6 * all.len()) as f64;
        assert!((0.4..1.6).contains(&nees), "{what}: NEES {nees}");
        for k in 0..6 {
            let squared: f64 = all.iter().map(|(error, _)| error[k] * error[k]).sum();
            let stated: f64 = all.iter().map(|(_, c)| c[(k, k)]).sum();
            let ratio = (stated / squared).sqrt();
            assert!(ratio < 2.0, "{what}, axis {k}: the stated deviation is {ratio} times the error");
        }
    }
}
