//! How well the covariance of a pose tells its true error, in the simulated scenes.

use rayon::prelude::*;
use tessera_geometry::{Matrix6, Pose, Vector6, log};
use tessera_mapping::State;
use tessera_offline::{Method, RawFrame, Run};
use tessera_sources::{FrameBuffers, SceneName, SimulatedSource, SimulationOptions, Source};

/// Error in the tangent of the estimate, covariance, and the record's reason, for each frame but
/// the first.
fn errors(name: SceneName, n_frames: u64) -> Vec<(Vector6, Matrix6, String)> {
    let source = SimulatedSource::open(name, None, None, &SimulationOptions::default()).unwrap();
    let n = (source.camera().width * source.camera().height) as usize;
    let mut run = Run::new(source.camera(), &Method::default()).unwrap();
    let indices: Vec<u64> = (0..n_frames).collect();
    for some in indices.chunks(16) {
        let frames: Vec<RawFrame> = some
            .par_iter()
            .map(|&index| {
                let (mut depth, mut colour) = (vec![0; n], vec![0; 3 * n]);
                let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut colour };
                let info = source.read(index, &mut buffers).unwrap();
                RawFrame {
                    stamp_nanos: info.stamp_nanos,
                    rotation: info.rotation,
                    depth,
                    colour: Some(colour),
                }
            })
            .collect();
        frames.iter().for_each(|frame| run.push(frame));
    }
    let records = run.finish();
    let truth = &source.ground_truth().unwrap().poses;
    records
        .frames()
        .zip(truth)
        .skip(1)
        .map(|(frame, true_pose)| {
            assert_eq!(frame.state, State::Tracking, "frame {}: {}", frame.index, frame.reason);
            let estimate = Pose::from(&frame.world_from_camera);
            let error = log(&(estimate.inverse() * truth[0].inverse() * true_pose)).to_vector();
            (error, symmetric(&frame.covariance), frame.reason.clone())
        })
        .collect()
}

fn symmetric(triangle: &[f64]) -> Matrix6 {
    let mut m = Matrix6::zeros();
    let places = (0..6).flat_map(|r| (r..6).map(move |c| (r, c)));
    for ((r, c), value) in places.zip(triangle) {
        m[(r, c)] = *value;
        m[(c, r)] = *value;
    }
    m
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
