//! What an accelerometer is worth to roll and pitch where surfaces let them drift.

mod common;

use nalgebra::Vector3;
use rayon::prelude::*;
use tessera_geometry::{Camera, Pose};
use tessera_offline::{Method, RawFrame, Records, Run};
use tessera_sources::{SceneName, SimulatedSource, SimulationOptions, Source};

/// Frames of the walk, and each how many of them are taken.
const N_FRAMES: u64 = 4500;
const EVERY: usize = 5;

/// The building through a lens that is not the stated one: surfaces are bent, and poses lean more and more.
fn bent_building() -> SimulatedSource {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("camera.toml");
    let camera = Camera::pinhole((320, 240), [262.5, 262.5, 159.5, 119.5], 5000.0);
    std::fs::write(&file, toml::to_string(&camera).unwrap()).unwrap();
    let distortion = Some([-0.05, 0.0, 0.0, 0.0, 0.0]);
    let options = SimulationOptions { imu: true, distortion, ..SimulationOptions::default() };
    SimulatedSource::open(SceneName::Building, file.to_str(), Some(N_FRAMES), &options).unwrap()
}

fn run(source: &SimulatedSource, frames: &[RawFrame], has_up: bool) -> Records {
    let stated = Camera { distortion: [0.0; 5], ..source.camera().clone() };
    let mut run = Run::new(&stated, &Method::default()).unwrap();
    for frame in frames {
        let up = frame.up.filter(|_| has_up);
        run.push(&RawFrame { up, ..frame.clone() });
    }
    run.finish()
}

/// Angles between up at the frames and up at the first, by the truth, root mean square, radians.
fn tilt_rad(records: &Records, truth: &[Pose]) -> f64 {
    let poses = records.last().poses;
    let up = |(pose, truth): (&Pose, &Pose)| pose.rotation * (truth.rotation.inverse() * Vector3::z());
    let ups: Vec<Vector3<f64>> = poses.iter().zip(truth.iter().step_by(EVERY)).map(up).collect();
    let squares: f64 = ups.iter().map(|up| up.angle(&ups[0]) * up.angle(&ups[0])).sum();
    (squares / ups.len() as f64).sqrt()
}

#[test]
fn a_map_that_drifts_leans_less_with_an_accelerometer() {
    let source = bent_building();
    let indices: Vec<u64> = (0..N_FRAMES).step_by(EVERY).collect();
    let frames: Vec<RawFrame> =
        indices.par_iter().map(|&index| RawFrame::read(&source, index).unwrap()).collect();
    let truth = &source.ground_truth().unwrap().poses;
    let [without, with] = [false, true].map(|has_up| {
        let records = run(&source, &frames, has_up);
        let n_tracked = records.frames().filter(|f| f.state == tessera_slam::State::Tracking).count();
        assert_eq!(n_tracked, frames.len());
        tilt_rad(&records, truth)
    });
    assert!(with < 0.7 * without, "{with} rad rms, {without} without");
}
