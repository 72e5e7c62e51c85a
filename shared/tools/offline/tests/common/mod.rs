//! What tests of the whole method share: simulated frames, and the errors of a run over them.
#![allow(dead_code, reason = "each test file uses its own part")]

use rayon::prelude::*;
use tessera_evaluation::{EvaluationOptions, Trajectory, evaluate};
use tessera_geometry::{Camera, Pose};
use tessera_offline::{Method, RawFrame, Records, Run};
use tessera_sources::{FrameBuffers, SceneName, SimulatedSource, SimulationOptions, Source};

/// The method without features: what surfaces alone say.
pub(crate) fn surfaces_alone() -> Method {
    let mut method = Method::default();
    method.mapping.features.enabled = false;
    method
}

/// A simulated scene.
pub(crate) fn scene(name: SceneName, options: &SimulationOptions) -> SimulatedSource {
    SimulatedSource::open(name, None, None, options).unwrap()
}

/// The building, seen by a camera of 320x240 pixels.
pub(crate) fn small_building() -> SimulatedSource {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("camera.toml");
    let camera = Camera::pinhole((320, 240), [262.5, 262.5, 159.5, 119.5], 5000.0);
    std::fs::write(&file, toml::to_string(&camera).unwrap()).unwrap();
    let options = SimulationOptions::default();
    SimulatedSource::open(SceneName::Building, Some(file.to_str().unwrap()), None, &options).unwrap()
}

/// One step of a scenario: a frame of the scene, or a covered lens.
#[derive(Clone, Copy)]
pub(crate) enum Step {
    See(u64),
    Covered,
}

/// What the step shows, as the `k`th frame at 30 Hz.
pub(crate) fn step_frame(source: &SimulatedSource, k: usize, step: Step) -> RawFrame {
    let n = (source.camera().width * source.camera().height) as usize;
    let (mut depth, mut colour) = (vec![0; n], vec![0; 3 * n]);
    if let Step::See(index) = step {
        source.read(index, &mut FrameBuffers { depth: &mut depth, colour: &mut colour }).unwrap();
    }
    RawFrame {
        stamp_nanos: 1_000_000_000 + k as i64 * 33_333_333,
        rotation: None,
        up: None,
        depth,
        colour: Some(colour),
    }
}

/// These frames of a scene, in this order, 1/30 s apart whatever their indices.
pub(crate) fn frames(source: &SimulatedSource, indices: &[u64]) -> Vec<RawFrame> {
    let n = (source.camera().width * source.camera().height) as usize;
    indices
        .par_iter()
        .enumerate()
        .map(|(k, &index)| {
            let (mut depth, mut colour) = (vec![0; n], vec![0; 3 * n]);
            let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut colour };
            source.read(index, &mut buffers).unwrap();
            RawFrame { stamp_nanos: stamp_nanos(k), rotation: None, up: None, depth, colour: Some(colour) }
        })
        .collect()
}

fn stamp_nanos(k: usize) -> i64 {
    k as i64 * 1_000_000_000 / 30
}

/// Runs the method over frames.
pub(crate) fn run(source: &SimulatedSource, method: &Method, frames: &[RawFrame]) -> Records {
    let mut run = Run::new(source.camera(), method).unwrap();
    frames.iter().for_each(|frame| drop(run.push(frame)));
    run.finish()
}

/// Absolute error of an estimate over frames made by [`frames`] from these indices, metres.
pub(crate) fn ate_m(source: &SimulatedSource, indices: &[u64], estimate: &Trajectory) -> f64 {
    let all = &source.ground_truth().unwrap().poses;
    let poses: Vec<Pose> = indices.iter().map(|&i| all[i as usize]).collect();
    let truth = Trajectory { stamps_nanos: (0..indices.len()).map(stamp_nanos).collect(), poses };
    evaluate(estimate, &truth, &EvaluationOptions::default()).unwrap().ate_rmse_m
}
