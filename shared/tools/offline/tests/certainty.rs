//! How well the covariance of a pose tells its true error, in the simulated scenes.

mod common;

use tessera_geometry::{Matrix6, Pose, Vector6, from_upper_triangle, log};
use tessera_offline::Records;
use tessera_slam::{Context, NoiseState, State};
use tessera_sources::{SceneName, SimulationOptions, Source};

/// A run over the first frames of a scene, with the true poses; of surfaces alone, without features.
fn run(name: SceneName, n_frames: u64) -> (Records, Vec<Pose>) {
    let source = common::scene(name, &SimulationOptions::default());
    let indices: Vec<u64> = (0..n_frames).collect();
    let records = common::run(&source, &common::surfaces_alone(), &common::frames(&source, &indices));
    (records, source.ground_truth().unwrap().poses.clone())
}

/// Error in the tangent of the estimate, covariance, and the record's reason, for each frame but
/// the first.
fn errors(name: SceneName, n_frames: u64) -> Vec<(Vector6, Matrix6, String)> {
    let (records, truth) = run(name, n_frames);
    records
        .frames()
        .zip(&truth)
        .skip(1)
        .map(|(frame, true_pose)| {
            assert_eq!(frame.state, State::Tracking, "frame {}: {}", frame.index, frame.reason());
            let estimate = Pose::from(&frame.pose.world_from_camera);
            let error = log(&(estimate.inverse() * truth[0].inverse() * true_pose)).to_vector();
            (error, from_upper_triangle(&frame.pose.covariance), frame.reason())
        })
        .collect()
}

fn mean_nees(errors: &[(Vector6, Matrix6, String)]) -> f64 {
    let nees = errors.iter().map(|(e, c, _)| e.dot(&(c.try_inverse().unwrap_or_else(Matrix6::zeros) * e)));
    nees.sum::<f64>() / errors.len() as f64
}

/// Share of frames whose error lies within three standard deviations along every axis.
fn share_within_3_sigma(errors: &[(Vector6, Matrix6, String)]) -> f64 {
    let within = errors.iter().filter(|(e, c, _)| (0..6).all(|k| e[k].abs() <= 3.0 * c[(k, k)].sqrt()));
    within.count() as f64 / errors.len() as f64
}

/// Standard deviations of a 3x3 block along its principal axes, smallest first.
fn principal_sigmas(c: &Matrix6, first: usize) -> [f64; 3] {
    let block = c.fixed_view::<3, 3>(first, first).into_owned();
    let mut sigmas: Vec<f64> =
        block.symmetric_eigen().eigenvalues.iter().map(|v| v.max(0.0).sqrt()).collect();
    sigmas.sort_by(f64::total_cmp);
    [sigmas[0], sigmas[1], sigmas[2]]
}

#[test]
fn a_room_leaves_nothing_free_and_the_errors_are_as_large_as_expected() {
    let all = errors(SceneName::Room, 100);
    assert!(all.iter().all(|e| e.2.is_empty()));
    let nees = mean_nees(&all);
    assert!((0.3 * 6.0..3.0 * 6.0).contains(&nees), "NEES {nees}");
}

/// Errors of each frame relative to its keyframe, with the covariance of that relative pose alone:
/// the inverse information of its matches with the keyframes of the window.
fn relative_errors(n_frames: u64) -> Vec<(Vector6, Matrix6, String)> {
    let (records, truth) = run(SceneName::Room, n_frames);
    let source = common::scene(SceneName::Room, &SimulationOptions::default());
    let method = common::surfaces_alone();
    let context = Context::new(source.camera(), &method.surface, &method.registration, &method.mapping);
    let scales =
        NoiseState::of_records(records.frames().filter_map(|frame| frame.evidence.noise.as_ref())).scales();
    let factor = context.matcher().metric_factor() * scales.surfaces;
    let mut keyframes = Vec::new();
    let mut errors = Vec::new();
    for frame in records.frames() {
        keyframes.extend(frame.change.new_keyframe.iter().map(|k| k.frame_index as usize));
        let Some(&at) = keyframes.get(frame.pose.keyframe as usize).filter(|at| **at < frame.index as usize)
        else {
            continue;
        };
        let estimate = Pose::from(&frame.pose.keyframe_from_camera);
        let information: Matrix6 = frame
            .evidence
            .blocks
            .iter()
            .map(|b| b.pair_block().unwrap().linearise(&Pose::from(&b.keyframe_from_camera)).0)
            .sum();
        let true_relative = truth[at].inverse() * truth[frame.index as usize];
        let error = log(&(estimate.inverse() * true_relative)).to_vector();
        errors.push((error, information.try_inverse().unwrap() * factor, String::new()));
    }
    errors
}

#[test]
fn errors_relative_to_the_keyframe_are_as_large_as_expected() {
    let nees = mean_nees(&relative_errors(100));
    assert!((0.3 * 6.0..3.0 * 6.0).contains(&nees), "NEES {nees}");
}

#[test]
fn a_corridor_leaves_the_way_along_it_free_and_says_so() {
    let all = errors(SceneName::Corridor, 60);
    assert!(all.iter().all(|e| e.2.contains("translation along")), "{}", all[0].2);
    assert!(share_within_3_sigma(&all) >= 0.95);
    for (k, (_, c, _)) in all.iter().enumerate() {
        let [_, middle, free] = principal_sigmas(c, 0);
        assert!(free >= 10.0 * middle, "frame {k}: {free} m along it, {middle} m across");
    }
}

#[test]
fn a_wall_leaves_two_translations_and_a_turn_free_and_says_so() {
    let all = errors(SceneName::Wall, 40);
    assert!(all.iter().all(|e| e.2.contains("rotation about")), "{}", all[0].2);
    assert!(share_within_3_sigma(&all) >= 0.95);
    for (k, (_, c, _)) in all.iter().enumerate() {
        let [off, free, _] = principal_sigmas(c, 0);
        let [_, tilt, turn] = principal_sigmas(c, 3);
        assert!(free >= 10.0 * off, "frame {k}: {free} m along the wall, {off} m off it");
        assert!(turn >= 10.0 * tilt, "frame {k}: {turn} rad about the normal, {tilt} rad of tilt");
    }
}
