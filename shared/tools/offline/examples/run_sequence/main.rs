//! Runs whole sequences in one process and prints their errors.
//!
//! `cargo run --release -p tessera-offline --example run_sequence -- SEQUENCE... [--frames N] [--seeds N] [--every N] [--reverse] [--passes N] [--holes SHARE] [--colour FAULT] [--colour-of SEQUENCE] [--camera FILE] [--readout SECONDS] [--simulation 'KEY = VALUE'] [--skip N] [--json] [key=value]...`
//!
//! A SEQUENCE is a folder or a simulated scene. `--every 6` takes each sixth frame, `--reverse` goes
//! backwards in time, `--passes 6` goes there and back so many times over it in all, `--holes 0.37` takes the depth of that share of pixels away, at random,
//! `--colour-of` takes the colour images of another sequence of the same size, and `--camera` takes
//! another camera: a folder's frames are as they are, a scene is rendered with it; `--readout` states another readout of
//! frames as they are. `--json` prints a line of
//! figures for each run, which `scripts/accuracy.py` reads.
#![forbid(unsafe_code)]

mod figures;
mod spoil;

use figures::{print_figures, report};
use spoil::{pierce, reverse, spoil_colour, there_and_back};
use std::error::Error;
use tessera_evaluation::write_tum_row;
use tessera_offline::{Method, RawFrame, Run};
use tessera_settings::Settings;
use tessera_sources::{SimulationOptions, Source, SourceOptions, SourceSpec};
use tessera_surface::{Reconstructor, Vertex};

fn main() -> Result<(), Box<dyn Error>> {
    let (mut sequences, mut overrides, mut frames, mut n_seeds) = (Vec::new(), Vec::new(), None, 1);
    let mut arguments = std::env::args().skip(1);
    let mut out = None;
    let mut n_passes = 1;
    let (mut every, mut is_reversed, mut hole_share, mut camera) = (1, false, 0.0, None);
    let mut readout_s = None;
    let mut simulation = SimulationOptions::default();
    let (mut colour_fault, mut colour_of) = (None, None);
    let (mut skip, mut is_json) = (0, false);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--frames" => frames = Some(arguments.next().ok_or("--frames N")?.parse::<u64>()?),
            "--seeds" => n_seeds = arguments.next().ok_or("--seeds N")?.parse::<u64>()?,
            "--out" => out = arguments.next(),
            "--every" => every = arguments.next().ok_or("--every N")?.parse::<usize>()?.max(1),
            "--reverse" => is_reversed = true,
            "--passes" => n_passes = arguments.next().ok_or("--passes N")?.parse::<usize>()?,
            "--holes" => hole_share = arguments.next().ok_or("--holes SHARE")?.parse::<f64>()?,
            "--colour" => colour_fault = arguments.next(),
            "--colour-of" => colour_of = arguments.next(),
            "--camera" => camera = arguments.next(),
            "--readout" => readout_s = Some(arguments.next().ok_or("--readout SECONDS")?.parse::<f64>()?),
            "--skip" => skip = arguments.next().ok_or("--skip N")?.parse::<u64>()?,
            "--json" => is_json = true,
            "--simulation" => {
                let table = arguments.next().ok_or("--simulation 'key = value'")?;
                simulation = toml::from_str::<SimulationOptions>(&table)?;
            }
            a if a.contains('=') => overrides.push(argument),
            _ => sequences.push(argument),
        }
    }
    for sequence in &sequences {
        let options = SourceOptions {
            frames,
            skip,
            camera: camera.clone(),
            simulation: simulation.clone(),
            ..SourceOptions::default()
        };
        let source = tessera_sources::open(&SourceSpec::parse(sequence), &options)?;
        let source = source.as_ref();
        let mut decoded = decode(source)?;
        let mut truth = source.ground_truth().cloned();
        if is_reversed {
            reverse(&mut decoded, truth.as_mut());
        }
        let mut decoded: Vec<RawFrame> = decoded.into_iter().step_by(every).collect();
        there_and_back(&mut decoded, truth.as_mut(), n_passes);
        pierce(&mut decoded, hole_share);
        spoil_colour(&mut decoded, colour_fault.as_deref(), source.camera().width as usize)?;
        if let Some(other) = &colour_of {
            let other = tessera_sources::open(&SourceSpec::parse(other), &options)?;
            let images = decode(&*other)?;
            for (frame, image) in decoded.iter_mut().zip(images.into_iter().cycle()) {
                frame.colour = image.colour;
            }
        }
        reconstruction_alone(source, &decoded, &Settings::load(None, &overrides)?)?;
        for seed in 0..n_seeds {
            let mut settings = Settings::load(None, &overrides)?;
            settings.registration.seed += seed;
            let method = Method {
                surface: settings.surface.clone(),
                registration: settings.registration.clone(),
                mapping: settings.mapping.clone(),
            };
            let mut stated = source.camera().clone();
            stated.readout_s = readout_s.unwrap_or(stated.readout_s);
            let started = cpu_ms();
            let mut run = Run::stamped(&stated, &method, source.pairing().stamp_sigma_s())?;
            for frame in &decoded {
                run.push(frame);
            }
            let tracked = cpu_ms() - started;
            let colour = run.colour();
            let records = run.finish();
            println!("    colour: {colour:?} {:?}", colour.estimate());
            report(sequence, seed, truth.as_ref(), &records, decoded.len());
            if is_json {
                print_figures(sequence, seed, truth.as_ref(), &records);
            }
            println!(
                "    {:.2} ms CPU a frame, {:.2} with the final optimisation",
                tracked / decoded.len() as f64,
                (cpu_ms() - started) / decoded.len() as f64
            );
            if let Some(out) = &out {
                let mut file = std::fs::File::create(out)?;
                let last = records.last();
                for (stamp, pose) in last.stamps_nanos.iter().zip(&last.poses) {
                    write_tum_row(&mut file, *stamp, pose)?;
                }
            }
        }
    }
    Ok(())
}

fn decode(source: &dyn Source) -> Result<Vec<RawFrame>, Box<dyn Error>> {
    use rayon::prelude::*;
    let read = |index| RawFrame::read(source, index);
    Ok((0..source.n_frames().unwrap_or(0)).into_par_iter().map(read).collect::<Result<_, _>>()?)
}

/// CPU time of this process so far: unlike the wall clock it does not see the machine's load.
fn cpu_ms() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec as f64 * 1e3 + time.tv_nsec as f64 * 1e-6
}

fn reconstruction_alone(
    source: &dyn Source,
    frames: &[RawFrame],
    settings: &Settings,
) -> Result<(), Box<dyn Error>> {
    let mut reconstructor = Reconstructor::new(source.camera(), &settings.surface)?;
    let mut out = vec![Vertex::default(); reconstructor.grid().len()];
    let mut times_ms: Vec<f64> = frames
        .iter()
        .map(|frame| {
            let started = cpu_ms();
            reconstructor.reconstruct(&frame.depth, frame.colour.as_deref(), &mut out);
            cpu_ms() - started
        })
        .collect();
    times_ms.sort_by(f64::total_cmp);
    println!("    reconstruction alone: median {:.3} ms", times_ms[times_ms.len() / 2]);
    Ok(())
}
