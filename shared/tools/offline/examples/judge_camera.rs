//! What excerpts of recordings tell of the focal length and the units of their camera, and whether the judge
//! raises an alarm.
//!
//! `cargo run --release -p tessera-offline --example judge_camera -- SEQUENCE... [--length N] [--every N] [--frames N] [--seeds N] [--focal FACTOR]... [--units FACTOR]... [--camera FILE] [--simulation 'KEY = VALUE'] [--no-truth] [key=value]...`
//!
//! Excerpts of `--length` frames begin every `--every` frames. `--focal` and `--units` plant errors: the camera
//! is taken to have those values times the factor. The last lines count alarms with each factor, and print the
//! root mean square of what features and ground truth find over what they state: 1 where the constants of
//! the judge fit (`shared/data/frames/src/judge/focal.rs`).
#![forbid(unsafe_code)]

use std::collections::BTreeMap;
use std::error::Error;
use tessera_evaluation::{Trajectory, lateral_scale};
use tessera_geometry::Camera;
use tessera_offline::{Method, RawFrame, Run, focal_of_features};
use tessera_settings::Settings;
use tessera_sources::judge::{FocalEvidence, FocalSource, judge_focal, student_inflation};
use tessera_sources::{SimulationOptions, Source, SourceOptions, SourceSpec, doubt_units, summarise_image};

fn main() -> Result<(), Box<dyn Error>> {
    let (mut sequences, mut overrides, mut focal, mut units) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let (mut length, mut every, mut n_seeds, mut options) =
        (100_usize, 100_usize, 1, SourceOptions::default());
    let mut has_truth = true;
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut next = || arguments.next().ok_or_else(|| format!("{argument} VALUE"));
        match argument.as_str() {
            "--length" => length = next()?.parse()?,
            "--every" => every = next()?.parse::<usize>()?.max(1),
            "--seeds" => n_seeds = next()?.parse::<u64>()?,
            "--frames" => options.frames = Some(next()?.parse::<u64>()?),
            "--focal" => focal.push(next()?.parse::<f64>()?),
            "--units" => units.push(next()?.parse::<f64>()?),
            "--camera" => options.camera = Some(next()?),
            "--simulation" => options.simulation = toml::from_str::<SimulationOptions>(&next()?)?,
            "--no-truth" => has_truth = false,
            a if a.contains('=') => overrides.push(argument),
            _ => sequences.push(argument),
        }
    }
    let right = if focal.is_empty() && units.is_empty() { vec![(1.0, 1.0)] } else { Vec::new() };
    let planted = focal.into_iter().map(|f| (f, 1.0)).chain(units.into_iter().map(|u| (1.0, u)));
    let planted: Vec<(f64, f64)> = right.into_iter().chain(planted).collect();
    let mut counts = Alarms::default();
    for sequence in &sequences {
        let source = tessera_sources::open(&SourceSpec::parse(sequence), &options)?;
        let decoded = decode(&*source)?;
        let name = sequence.rsplit('/').next().unwrap_or(sequence);
        for first in (0..decoded.len()).step_by(every) {
            let excerpt = &decoded[first..(first + length).min(decoded.len())];
            if first > 0 && excerpt.len() < length {
                break;
            }
            for &(focal, units) in &planted {
                for seed in 0..n_seeds {
                    let mut settings = Settings::load(None, &overrides)?;
                    settings.registration.seed += seed;
                    let mut camera = source.camera().clone();
                    (camera.fx, camera.fy) = (camera.fx * focal, camera.fy * focal);
                    camera.units_per_metre *= units;
                    let truth = source.ground_truth().filter(|_| has_truth);
                    let words = one(&camera, excerpt, &settings, truth, (focal, &mut counts))?;
                    println!("{name} {first} focal x{focal} units x{units} seed {seed}: {words}");
                }
            }
        }
    }
    counts.print();
    Ok(())
}

/// Runs and alarms by the planted factor, and the squares of normalised errors.
#[derive(Default)]
struct Alarms {
    alarms: BTreeMap<String, (u32, u32)>,
    squares: BTreeMap<&'static str, (f64, u32)>,
}

impl Alarms {
    fn print(&self) {
        for (factor, (n, alarms)) in &self.alarms {
            println!("{factor}: {alarms} alarms in {n} runs");
        }
        for (name, (squares, n)) in &self.squares {
            println!(
                "{name}: root mean square error {:.2} stated deviations, {n} estimates",
                (squares / f64::from(*n)).sqrt()
            );
        }
    }
}

/// Runs an excerpt with a camera whose focal length is `planted` times the right one.
fn one(
    camera: &Camera,
    frames: &[RawFrame],
    settings: &Settings,
    truth: Option<&Trajectory>,
    (planted, counts): (f64, &mut Alarms),
) -> Result<String, Box<dyn Error>> {
    let method = Method {
        surface: settings.surface.clone(),
        registration: settings.registration.clone(),
        mapping: settings.mapping.clone(),
    };
    let mut run = Run::new(camera, &method)?;
    for frame in frames {
        run.push(frame);
    }
    let colour = run.colour().model;
    let (records, map) = run.finish_with_map();
    let seen = focal_of_features(camera, &map, &method, colour);
    let features = seen.map(|seen| FocalEvidence::features(seen.ratio, seen.sigma, seen.n_pairs));
    let lateral = truth.and_then(|truth| lateral_scale(&records.last(), truth));
    let of_truth = lateral.map(|lateral| {
        let sigma = lateral.sigma * student_inflation(lateral.n_groups as f64 - 1.0);
        FocalEvidence::ground_truth(lateral.scale, sigma, lateral.turn_per_metre)
    });
    let evidence: Vec<FocalEvidence> = [features, of_truth].into_iter().flatten().collect();
    let mut words = format!("{} keyframes", map.keyframes.len());
    for one in &evidence {
        let name = if one.source == FocalSource::Features { "features" } else { "ground truth" };
        let (squares, n) = counts.squares.entry(name).or_default();
        *squares += ((one.log_ratio + planted.ln()) / one.sigma).powi(2);
        *n += 1;
        words += &format!(", {name} {:+.3} +- {:.3}", one.log_ratio, one.sigma);
    }
    if let (Some(seen), Some(_)) = (seen, features) {
        words += &format!(
            " (raw {:+.3} +- {:.3}, {} pairs)",
            seen.ratio.ln(),
            seen.sigma / seen.ratio,
            seen.n_pairs
        );
    }
    if let Some(lateral) = lateral {
        words += &format!(
            " (lateral +- {:.3}, {} groups, {:.2} rad/m)",
            lateral.sigma, lateral.n_groups, lateral.turn_per_metre
        );
    }
    let found = judge_focal(&evidence);
    if let Some(found) = &found {
        words += &format!(", {:.1} sigmas", found.sigmas);
    }
    let lens = found.is_some_and(|found| found.is_wrong);
    let middle: Vec<u16> = frames.iter().step_by(20).flat_map(|frame| frame.depth.iter().copied()).collect();
    let depth = summarise_image(&middle, camera);
    let doubt = doubt_units(&depth, camera);
    words += &format!(
        ", median {:.2} m, near {:.2} m, lattice {}",
        depth.median_m.unwrap_or(0.0),
        depth.near_m.unwrap_or(0.0),
        depth.lattice.map_or("none".to_owned(), |l| format!("{:.5}", l.q_per_raw * camera.units_per_metre))
    );
    let alarm = lens || doubt.is_some();
    if lens {
        words += ", ALARM focal length";
    }
    if let Some(doubt) = doubt {
        words += &format!(", ALARM {doubt}");
    }
    let (n, alarms) =
        counts.alarms.entry(format!("focal x{planted}, {} units", camera.units_per_metre)).or_default();
    (*n, *alarms) = (*n + 1, *alarms + u32::from(alarm));
    Ok(words)
}

fn decode(source: &dyn Source) -> Result<Vec<RawFrame>, Box<dyn Error>> {
    use rayon::prelude::*;
    let read = |index| RawFrame::read(source, index);
    Ok((0..source.n_frames().unwrap_or(0)).into_par_iter().map(read).collect::<Result<_, _>>()?)
}
