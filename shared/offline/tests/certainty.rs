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
                RawFrame { stamp_nanos: info.stamp_nanos, depth, colour: Some(colour) }
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

#[test]
fn explore() {
    for (name, n) in [(SceneName::Room, 100), (SceneName::Corridor, 90), (SceneName::Wall, 60)] {
        let all = errors(name, n);
        eprintln!(
            "{}: NEES {:.2}, within 3 sigma {:.3}, free in {}",
            name.name(),
            mean_nees(&all),
            share_within_3_sigma(&all),
            all.iter().filter(|e| !e.2.is_empty()).count()
        );
        for k in [0, 1, 4, 9, 19, 29, 59, 89, 118] {
            if let Some((e, c, r)) = all.get(k) {
                let s: Vec<String> =
                    (0..6).map(|i| format!("{:+.5}/{:.5}", e[i], c[(i, i)].sqrt())).collect();
                eprintln!("  {k} {} | {r}", s.join(" "));
            }
        }
    }
}
