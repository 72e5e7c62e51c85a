//! Calibrates from a folder's frames and compares the errors of a run with the start, the found
//! and the folder's own camera.
//!
//! `cargo run --release -p tessera-offline --example calibrate_sequence -- FOLDER [--camera FILE] [--change fx*1.03] [--frames N] [--skip N] [--seeds N] [--start-px PX] [--fix NAMES] [key=value]...`
#![forbid(unsafe_code)]

use std::error::Error;
use tessera_calibration::Parameter;
use tessera_evaluation::{EvaluationOptions, evaluate};
use tessera_geometry::Camera;
use tessera_offline::{CalibrateOptions, Method, RawFrame, Run, calibrate};
use tessera_settings::Settings;
use tessera_sources::{Source, SourceOptions, SourceSpec, open};

fn main() -> Result<(), Box<dyn Error>> {
    let (mut source, mut overrides, mut frames, mut camera) = (None, Vec::new(), None, None);
    let (mut changes, mut seeds, mut skip) = (Vec::new(), 1, 0);
    let mut options = CalibrateOptions::default();
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--frames" => frames = Some(arguments.next().ok_or("--frames N")?.parse::<u64>()?),
            "--camera" => camera = arguments.next(),
            "--change" => changes.push(arguments.next().ok_or("--change fx=525")?),
            "--start-px" => options.start_px = arguments.next().ok_or("--start-px PX")?.parse()?,
            "--skip" => skip = arguments.next().ok_or("--skip N")?.parse()?,
            "--seeds" => seeds = arguments.next().ok_or("--seeds N")?.parse()?,
            "--passes" => options.max_passes = arguments.next().ok_or("--passes N")?.parse()?,
            "--neighbours" => options.neighbours = arguments.next().ok_or("--neighbours N")?.parse()?,
            "--fix" => {
                let names = arguments.next().ok_or("--fix k3,p1")?;
                let is_named = |p: &Parameter| names.split(',').any(|name| name == p.name());
                options.fixed = Parameter::ALL.into_iter().filter(is_named).collect();
            }
            a if a.contains('=') => overrides.push(argument),
            _ => source = Some(argument),
        }
    }
    let settings = Settings::load(None, &overrides)?;
    let method = Method {
        surface: settings.surface.clone(),
        registration: settings.registration.clone(),
        mapping: settings.mapping.clone(),
    };
    let spec = SourceSpec::parse(&source.ok_or("which sequence?")?);
    let source = open(
        &spec,
        &SourceOptions { frames, simulation: settings.simulation.clone(), ..SourceOptions::default() },
    )?;
    let mut start = match &camera {
        Some(file) => tessera_sources::named_camera(file)?,
        None => source.camera().clone(),
    };
    for change in &changes {
        apply(&mut start, change)?;
    }
    let mut decoded = decode(&*source)?;
    decoded.drain(..decoded.len().min(skip));
    let n = decoded.len() as u64;
    let mut read =
        |index: u64| Ok::<_, std::convert::Infallible>((index < n).then(|| decoded[index as usize].clone()));
    let found = calibrate(&start, &method, &options, &mut read, &mut || ())?;
    for pass in &found.passes {
        println!("{pass:?}");
    }
    println!("converged: {}, iterations {}", found.is_converged, found.calibration.n_iterations);
    let truth = source.camera();
    let [k1, k2, p1, p2, k3] = truth.distortion;
    let own =
        [truth.fx, truth.fy, truth.cx, truth.cy, k1, k2, p1, p2, k3, truth.readout_s, truth.depth_offset_m];
    for (e, own) in found.calibration.estimates.iter().zip(own) {
        println!(
            "{:>14} {:12.5} from {:10.5} own {:10.5} std {:9.5} error/std {:6.2} held {:.3}",
            e.parameter.name(),
            e.value,
            e.start,
            own,
            e.std,
            (e.value - own) / e.std,
            e.held
        );
    }
    for held in &found.calibration.held {
        println!("held, {:.2} px: {:.2?}", held.std_px, held.weights.as_slice());
    }
    for (name, camera) in [("start", &start), ("found", &found.calibration.camera), ("own", source.camera())]
    {
        let Some(truth) = source.ground_truth() else { continue };
        let (mut ate_m, mut rpe_m_per_s) = (Vec::new(), Vec::new());
        for seed in 0..seeds {
            let mut method = method.clone();
            method.registration.seed += seed;
            let mut run = Run::new(camera, &method)?;
            decoded.iter().for_each(|frame| drop(run.push(frame)));
            let score = evaluate(&run.finish().last(), truth, &EvaluationOptions::default())?;
            ate_m.push(score.ate_rmse_m);
            rpe_m_per_s.extend(score.rpe_translation_rmse_m_per_s);
        }
        println!("{name:6} ATE m {}  RPE m/s {}", spread(ate_m), spread(rpe_m_per_s));
    }
    Ok(())
}

/// Median, least and most.
fn spread(mut values: Vec<f64>) -> String {
    values.sort_by(f64::total_cmp);
    let at = |place: usize| values.get(place).copied().unwrap_or(f64::NAN);
    format!("{:.4} ({:.4} to {:.4})", at(values.len() / 2), at(0), at(values.len().saturating_sub(1)))
}

fn apply(camera: &mut Camera, change: &str) -> Result<(), Box<dyn Error>> {
    let (key, value) = change.split_once('=').ok_or("--change key=value")?;
    let value: f64 = value.parse()?;
    match key {
        "fx" => camera.fx = value,
        "fy" => camera.fy = value,
        "cx" => camera.cx = value,
        "cy" => camera.cy = value,
        "readout_s" => camera.readout_s = value,
        "distortion" => camera.distortion = [value; 5],
        "depth_offset_m" => camera.depth_offset_m = value,
        _ => return Err(format!("no {key} in a camera").into()),
    }
    Ok(())
}

fn decode(source: &dyn Source) -> Result<Vec<RawFrame>, Box<dyn Error>> {
    use rayon::prelude::*;
    let read = |index| RawFrame::read(source, index);
    Ok((0..source.n_frames().unwrap_or(0)).into_par_iter().map(read).collect::<Result<_, _>>()?)
}
