//! Calibration from the frames themselves, where the true camera is known.

#[path = "../../../../tests/requirements.rs"]
mod requirements;

use std::convert::Infallible;
use tessera_evaluation::{EvaluationOptions, evaluate};
use tessera_geometry::Camera;
use tessera_offline::{CalibrateError, CalibrateOptions, Calibrated, Method, RawFrame, Run, calibrate};
use tessera_sources::{FolderSource, SceneName, SimulatedSource, SimulationOptions, Source};

fn frames(source: &dyn Source, step: u64) -> Vec<RawFrame> {
    use rayon::prelude::*;
    let indices: Vec<u64> = (0..source.n_frames().unwrap()).step_by(step as usize).collect();
    let read = |index: &u64| RawFrame::read(source, *index).unwrap();
    indices.par_iter().map(read).collect()
}

fn solve(frames: &[RawFrame], start: &Camera, options: &CalibrateOptions) -> Calibrated {
    try_solve(frames, start, options).unwrap()
}

fn try_solve(
    frames: &[RawFrame],
    start: &Camera,
    options: &CalibrateOptions,
) -> Result<Calibrated, CalibrateError<Infallible>> {
    let mut read = |index: u64| Ok(frames.get(index as usize).cloned());
    calibrate(start, &Method::default(), options, &mut read, &mut || ())
}

fn ate_m(source: &dyn Source, frames: &[RawFrame], camera: &Camera) -> f64 {
    let mut run = Run::new(camera, &Method::default()).unwrap();
    frames.iter().for_each(|frame| drop(run.push(frame)));
    let truth = source.ground_truth().unwrap();
    evaluate(&run.finish().last(), truth, &EvaluationOptions::default()).unwrap().ate_rmse_m
}

#[test]
fn a_camera_three_per_cent_off_is_recovered_from_a_rendered_kitchen() {
    let Some(folder) = requirements::data("kitchen_exact_120") else { return };
    let source = FolderSource::open(&folder, None, None).unwrap();
    let frames = frames(&source, 1);
    let truth = source.camera().clone();
    let start = Camera {
        fx: 1.03 * truth.fx,
        fy: 1.03 * truth.fy,
        cx: truth.cx + 6.0,
        cy: truth.cy - 6.0,
        ..truth.clone()
    };
    let found = solve(&frames, &start, &CalibrateOptions::default()).calibration;
    let camera = &found.camera;
    assert!((camera.fx / truth.fx - 1.0).abs() < 0.003, "fx {}", camera.fx);
    assert!((camera.fy / truth.fy - 1.0).abs() < 0.003, "fy {}", camera.fy);
    assert!((camera.cx - truth.cx).abs() < 1.0, "cx {}", camera.cx);
    assert!((camera.cy - truth.cy).abs() < 1.0, "cy {}", camera.cy);
    assert_eq!(camera.units_per_metre, truth.units_per_metre, "depth's scale cannot be known");
    let ate_m = ate_m(&source, &frames, camera);
    assert!(ate_m < 0.0008, "ATE {ate_m}");
    // What is claimed to be known is known that well.
    let own = [truth.fx, truth.fy, truth.cx, truth.cy];
    for (estimate, own) in found.estimates.iter().zip(own) {
        let sigmas = (estimate.value - own).abs() / estimate.std;
        assert!(sigmas < 5.0, "{}: {sigmas} standard deviations", estimate.parameter.name());
    }
}

#[test]
fn motion_before_a_wall_determines_no_focal_length_and_the_start_is_kept() {
    let source =
        SimulatedSource::open(SceneName::Wall, None, Some(90), &SimulationOptions::default()).unwrap();
    let frames = frames(&source, 1);
    let start = Camera { fx: 540.0, fy: 540.0, ..source.camera().clone() };
    let options = CalibrateOptions { max_passes: 1, ..CalibrateOptions::default() };
    let found = solve(&frames, &start, &options).calibration;
    assert!(!found.held.is_empty());
    for estimate in &found.estimates[..2] {
        assert!(estimate.held > 0.5, "{estimate:?}");
    }
}

#[test]
fn a_sequence_that_says_too_little_is_refused() {
    let source =
        SimulatedSource::open(SceneName::Room, None, Some(2), &SimulationOptions::default()).unwrap();
    let camera = source.camera().clone();
    let options = CalibrateOptions::default();
    let error = try_solve(&frames(&source, 1), &camera, &options).unwrap_err().to_string();
    assert!(error.contains("pairs of keyframes see the same surfaces, expected at least 3"), "{error}");
    let error = try_solve(&[], &camera, &options).unwrap_err().to_string();
    assert!(error.contains("0 of 0 frames were tracked"), "{error}");
}

#[test]
fn a_planted_lens_and_readout_are_found_in_the_room() {
    let options = SimulationOptions {
        distortion: Some([0.1, -0.2, 0.0, 0.0, 0.0]),
        readout_s: Some(0.03),
        ..SimulationOptions::default()
    };
    let source = SimulatedSource::open(SceneName::Room, None, None, &options).unwrap();
    let frames = frames(&source, 1);
    let truth = source.camera();
    let start = Camera { distortion: [0.0; 5], readout_s: 0.0, ..truth.clone() };
    let found = solve(&frames, &start, &CalibrateOptions::default()).calibration;
    let camera = &found.camera;
    assert!((camera.readout_s - truth.readout_s).abs() < 0.002, "readout {} s", camera.readout_s);
    assert!((camera.distortion[0] - truth.distortion[0]).abs() < 0.02, "{:?}", camera.distortion);
    assert!((camera.distortion[1] - truth.distortion[1]).abs() < 0.06, "{:?}", camera.distortion);
    assert!((camera.fx / truth.fx - 1.0).abs() < 0.005, "fx {}", camera.fx);
}
