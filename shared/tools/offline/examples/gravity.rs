//! Tilt and error of simulated runs with and without an accelerometer, on the same frames.
//!
//! `cargo run --release -p tessera-offline --example gravity -- SCENE [--frames N] [--every N] [--seeds N] [--distort K1]`
//!
//! A seed is that of the simulation: of the instrument's constant errors as well. Images are of 320x240 pixels.
//! `--distort` renders through a lens of that radial distortion and states none, so that surfaces are bent and poses
//! drift. Tilt is the angle between up at a frame and up at the first, by the truth.
#![forbid(unsafe_code)]

use nalgebra::Vector3;
use rayon::prelude::*;
use std::error::Error;
use tessera_evaluation::{EvaluationOptions, evaluate};
use tessera_offline::{Camera, Method, RawFrame, Records, Run, Source, Trajectory};
use tessera_sources::{SceneName, SimulatedSource, SimulationOptions};

/// Frames that are rendered at a time.
const CHUNK: usize = 64;

fn main() -> Result<(), Box<dyn Error>> {
    let (mut scene, mut frames, mut every, mut n_seeds, mut k1) = (None, None, 1, 1, 0.0);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{argument} has no value"));
        match argument.as_str() {
            "--frames" => frames = Some(value()?.parse::<u64>()?),
            "--every" => every = value()?.parse::<u64>()?.max(1),
            "--seeds" => n_seeds = value()?.parse::<u64>()?,
            "--distort" => k1 = value()?.parse::<f64>()?,
            name => {
                scene = SceneName::ALL.into_iter().find(|scene| format!("{scene:?}").to_lowercase() == name)
            }
        }
    }
    let scene = scene.ok_or("no scene of this name")?;
    for seed in 1..=n_seeds {
        let distortion = Some([k1, 0.0, 0.0, 0.0, 0.0]);
        let options = SimulationOptions { imu: true, seed, distortion, ..SimulationOptions::default() };
        let camera = Camera::pinhole((320, 240), [262.5, 262.5, 159.5, 119.5], 5000.0);
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("camera.toml");
        std::fs::write(&file, toml::to_string(&camera)?)?;
        let source = SimulatedSource::open(scene, file.to_str(), frames, &options)?;
        let stated = Camera { distortion: [0.0; 5], ..source.camera().clone() };
        let mut runs = [false, true].map(|has_up| (has_up, Run::new(&stated, &Method::default())));
        let indices: Vec<u64> = (0..source.n_frames().unwrap_or(0)).step_by(every as usize).collect();
        for some in indices.chunks(CHUNK) {
            let read = |&index: &u64| RawFrame::read(&source, index);
            let chunk: Vec<RawFrame> = some.par_iter().map(read).collect::<Result<_, _>>()?;
            runs.par_iter_mut().for_each(|(has_up, run)| {
                for frame in &chunk {
                    let up = frame.up.filter(|_| *has_up);
                    if let Ok(run) = run {
                        run.push(&RawFrame { up, ..frame.clone() });
                    }
                }
            });
        }
        for (has_up, run) in runs {
            report(&format!("{scene:?} seed {seed} up {has_up:5}"), &source, &run?.finish())?;
        }
    }
    Ok(())
}

fn report(name: &str, source: &dyn Source, records: &Records) -> Result<(), Box<dyn Error>> {
    let truth = source.ground_truth().ok_or("no truth")?;
    let found = records.last();
    let Trajectory { stamps_nanos, poses } = &found;
    let ups: Vec<Vector3<f64>> = stamps_nanos
        .iter()
        .zip(poses)
        .filter_map(|(stamp, pose)| {
            let true_pose = &truth.poses[truth.stamps_nanos.binary_search(stamp).ok()?];
            Some(pose.rotation * (true_pose.rotation.inverse() * Vector3::z()))
        })
        .collect();
    let tilts: Vec<f64> = ups.iter().map(|up| up.angle(&ups[0]).to_degrees()).collect();
    let rms = (tilts.iter().map(|tilt| tilt * tilt).sum::<f64>() / tilts.len() as f64).sqrt();
    let end = tilts.last().copied().unwrap_or(f64::NAN);
    let ate_m = evaluate(&found, truth, &EvaluationOptions::default())?.ate_rmse_m;
    println!(
        "{name}: tilt {rms:.3} deg rms, {end:.3} deg at the end, ATE {ate_m:.4} m; {} keyframes, {} submaps, {} untracked",
        records.n_keyframes(),
        records.submaps().n(),
        records.n_untracked()
    );
    Ok(())
}
