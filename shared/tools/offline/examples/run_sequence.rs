//! Runs whole sequences in one process and prints their errors.
//!
//! `cargo run --release -p tessera-offline --example run_sequence -- SEQUENCE... [--frames N] [--seeds N] [--every N] [--reverse] [--holes SHARE] [--colour FAULT] [--colour-of SEQUENCE] [--camera FILE] [--simulation 'KEY = VALUE'] [--skip N] [--json] [key=value]...`
//!
//! A SEQUENCE is a folder or a simulated scene. `--every 6` takes each sixth frame, `--reverse` goes
//! backwards in time, `--holes 0.37` takes the depth of that share of pixels away, at random,
//! `--colour-of` takes the colour images of another sequence of the same size, and `--camera` takes
//! another camera: a folder's frames are as they are, a scene is rendered with it. `--json` prints a line of
//! figures for each run, which `scripts/accuracy.py` reads.
#![forbid(unsafe_code)]

use std::error::Error;
use tessera_evaluation::{EvaluationOptions, Trajectory, evaluate, write_tum_row};
use tessera_geometry::{Pose, adjoint, from_upper_triangle, log};
use tessera_offline::{Method, RawFrame, Records, Run, State};
use tessera_settings::Settings;
use tessera_slam::{AlignRecord, FrameRecord, LoopRecord};
use tessera_sources::{SimulationOptions, Source, SourceOptions, SourceSpec};
use tessera_surface::{Reconstructor, Vertex};

fn main() -> Result<(), Box<dyn Error>> {
    let (mut sequences, mut overrides, mut frames, mut n_seeds) = (Vec::new(), Vec::new(), None, 1);
    let mut arguments = std::env::args().skip(1);
    let mut out = None;
    let (mut every, mut is_reversed, mut hole_share, mut camera) = (1, false, 0.0, None);
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
            "--holes" => hole_share = arguments.next().ok_or("--holes SHARE")?.parse::<f64>()?,
            "--colour" => colour_fault = arguments.next(),
            "--colour-of" => colour_of = arguments.next(),
            "--camera" => camera = arguments.next(),
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
            let started = cpu_ms();
            let mut run = Run::new(source.camera(), &method)?;
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

/// Turns time round: the last frame comes first, and the truth goes along.
fn reverse(frames: &mut [RawFrame], truth: Option<&mut Trajectory>) {
    let both_ends = |first: Option<i64>, last: Option<i64>| first.unwrap_or(0) + last.unwrap_or(0);
    let sum = both_ends(frames.first().map(|f| f.stamp_nanos), frames.last().map(|f| f.stamp_nanos));
    frames.reverse();
    frames.iter_mut().for_each(|f| f.stamp_nanos = sum - f.stamp_nanos);
    if let Some(truth) = truth {
        truth.stamps_nanos.reverse();
        truth.poses.reverse();
        truth.stamps_nanos.iter_mut().for_each(|stamp| *stamp = sum - *stamp);
    }
}

/// Takes the depth of a share of all pixels away: the same pixels on each run.
fn pierce(frames: &mut [RawFrame], share: f64) {
    let limit = (share * 2f64.powi(32)) as u64;
    // Numerical Recipes' linear congruential generator; its high bits are even enough.
    let mut state = 1u64;
    let mut is_hole = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        state >> 32 < limit
    };
    let depth = frames.iter_mut().flat_map(|frame| &mut frame.depth);
    depth.for_each(|depth| *depth = if is_hole() { 0 } else { *depth });
}

/// Plants a fault in all colour images: `off`, `frozen` (the first for all), `late` (of ten frames
/// before), `foreign` (of frames far away in time), `dark` (a 64th), `dim` (half), `halved` (every second image repeated
/// for two seconds), `noise`, or `blurred` (along the rows).
fn spoil_colour(frames: &mut [RawFrame], fault: Option<&str>, width: usize) -> Result<(), Box<dyn Error>> {
    let Some(fault) = fault else { return Ok(()) };
    let images: Vec<Option<Vec<u8>>> = frames.iter().map(|frame| frame.colour.clone()).collect();
    let mut state = 1u64;
    let mut byte = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 56) as u8
    };
    for (k, frame) in frames.iter_mut().enumerate() {
        frame.colour = match fault {
            "off" => None,
            "frozen" => images[0].clone(),
            "late" => images[k.saturating_sub(10)].clone(),
            "foreign" => images[(k * 37 + images.len() / 2) % images.len()].clone(),
            "dark" => images[k].as_ref().map(|image| image.iter().map(|b| b / 64).collect()),
            // Half the rate from a third of the sequence on for two seconds at 30 Hz, as a camera in the dark.
            "halved" if (images.len() / 3..images.len() / 3 + 60).contains(&k) => images[k - k % 2].clone(),
            "halved" => images[k].clone(),
            "dim" => images[k].as_ref().map(|image| image.iter().map(|b| b / 2).collect()),
            "blurred" => images[k].as_deref().map(|image| blurred(image, width)),
            "noise" => images[k].as_ref().map(|image| image.iter().map(|_| byte()).collect()),
            other => {
                return Err(format!(
                    "--colour is {other}, expected off, frozen, late, foreign, dark, dim, halved, noise or blurred"
                )
                .into());
            }
        };
    }
    Ok(())
}

/// Each pixel the mean of those within 12 px in its row.
fn blurred(image: &[u8], width: usize) -> Vec<u8> {
    let mut out = Vec::with_capacity(image.len());
    for row in image.chunks_exact(3 * width) {
        for column in 0..width {
            let span = column.saturating_sub(12)..(column + 13).min(width);
            let sum = |c: usize| span.clone().map(|k| u32::from(row[3 * k + c])).sum::<u32>();
            out.extend((0..3).map(|c| (sum(c) / span.len() as u32) as u8));
        }
    }
    out
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

fn report(sequence: &str, seed: u64, truth: Option<&Trajectory>, records: &Records, n: usize) {
    println!(
        "{sequence} seed {seed}: {n} frames, {} keyframes ({} culled), {} corrections, {} untracked",
        records.n_keyframes(),
        records.n_culled(),
        records.n_corrections(),
        records.n_untracked()
    );
    let n_free = records.frames().filter(|f| f.reason.contains("degenerate")).count();
    println!("    {n_free} frames with a degenerate direction");
    report_submaps(records);
    report_loops(records);
    let Some(truth) = truth else { return };
    let line =
        |name: &str, estimate: &Trajectory| match evaluate(estimate, truth, &EvaluationOptions::default()) {
            Ok(e) => println!(
                "    {name:7} ATE {:.5} m  RPE {:.5} m/s  {:.3} deg/s  end {:.4} m  ({} pairs)",
                e.ate_rmse_m,
                e.rpe_translation_rmse_m_per_s.unwrap_or(f64::NAN),
                e.rpe_rotation_rmse_deg_per_s.unwrap_or(f64::NAN),
                e.end_error_m,
                e.pairs
            ),
            Err(error) => println!("    {name}: {error}"),
        };
    line("online", &of_main_map(records, records.online()));
    report_certainty(records, truth);
    line("final", &of_main_map(records, records.last()));
    if let Some(refined) = records.refined_camera() {
        line("as was", &of_main_map(records, records.before_refinement()));
        let [before, after] = refined.residual_sigmas;
        println!(
            "    {:?}, moved {:.2} px, {} directions held, residual {before:.4} before, {after:.4} after",
            refined.camera, refined.moved_px, refined.n_held
        );
    }
}

/// The component with most tracked frames.
fn main_component(records: &Records) -> u32 {
    let mut n_frames = std::collections::BTreeMap::<u32, usize>::new();
    for (component, frame) in records.components().into_iter().zip(records.frames()) {
        *n_frames.entry(component).or_default() += usize::from(frame.state == State::Tracking);
    }
    // Of as many the first.
    n_frames.into_iter().rev().max_by_key(|(_, n)| *n).map_or(0, |(component, _)| component)
}

/// Frames that were tracked outside of the main map: their poses have a gauge of their own.
fn n_apart(records: &Records) -> usize {
    let main = main_component(records);
    let all = records.components().into_iter().zip(records.frames());
    all.filter(|(component, frame)| *component != main && frame.state == State::Tracking).count()
}

/// The poses of the main map's frames.
fn of_main_map(records: &Records, all: Trajectory) -> Trajectory {
    let main = main_component(records);
    let mut kept = Trajectory::default();
    let poses = all.stamps_nanos.into_iter().zip(all.poses);
    for ((stamp_nanos, pose), component) in poses.zip(records.components()) {
        if component == main {
            kept.stamps_nanos.push(stamp_nanos);
            kept.poses.push(pose);
        }
    }
    kept
}

/// One line of figures as JSON, those that need ground truth only where there is one.
fn print_figures(sequence: &str, seed: u64, truth: Option<&Trajectory>, records: &Records) {
    let mut figures = serde_json::json!({
        "sequence": sequence,
        "seed": seed,
        "untracked": records.n_untracked(),
        "apart": n_apart(records),
        "keyframes": records.n_keyframes(),
    });
    let Some(truth) = truth else { return println!("{figures}") };
    for (name, estimate) in [("online", records.online()), ("final", records.last())] {
        let estimate = of_main_map(records, estimate);
        let Ok(e) = evaluate(&estimate, truth, &EvaluationOptions::default()) else { continue };
        figures[format!("ate_{name}_m")] = e.ate_rmse_m.into();
        figures[format!("rpe_{name}_m_per_s")] = e.rpe_translation_rmse_m_per_s.into();
    }
    let certainty = certainty(records, truth);
    figures["within_3_sigma"] = certainty.within.into();
    figures["normalised_error"] = certainty.normalised.into();
    println!("{figures}");
}

/// Submaps with what began and joined them, where there is more than one.
fn report_submaps(records: &Records) {
    let submaps = records.submaps();
    if submaps.n() < 2 {
        return;
    }
    println!("    {} submaps in {} components", submaps.n(), submaps.n_components());
    for frame in records.frames().filter(|f| f.change.join.is_some() || f.reason.contains("begins")) {
        println!("      frame {}: {}", frame.index, frame.reason);
    }
    for submap in 0..submaps.n() {
        let n = records.frames().filter(|f| f.submap == submap && f.state == State::Tracking).count();
        println!("      submap {submap} of component {}: {n} tracked frames", submaps.component(submap));
    }
}

/// How well the stated deviations tell the errors of relative poses over one second: the squared
/// error of each axis over its stated variance, that of the two frames' covariances together. Submaps have gauges of
/// their own: a pair is of one.
fn report_certainty(records: &Records, truth: &Trajectory) {
    let c = certainty(records, truth);
    println!(
        "    over 1 s: {:.1} % within 3 sigma, mean squared normalised error {:.2} (translation {:.2}), median error {:.4} m, stated {:.4} m",
        100.0 * c.within,
        c.normalised,
        c.translation,
        c.median_error_m,
        c.median_stated_m
    );
}

/// See [`report_certainty`].
struct Certainty {
    within: f64,
    normalised: f64,
    translation: f64,
    median_error_m: f64,
    median_stated_m: f64,
}

fn certainty(records: &Records, truth: &Trajectory) -> Certainty {
    let tracked: Vec<_> = records.frames().filter(|f| f.pose.covariance.len() == 21).collect();
    let (mut n, mut n_within, mut normalised, mut translation) = (0, 0, 0.0, 0.0);
    let (mut error_m, mut sigma_m) = (Vec::new(), Vec::new());
    for (k, first) in tracked.iter().enumerate() {
        let due = first.stamp_nanos + 1_000_000_000;
        let Some(second) = tracked[k..].iter().find(|f| f.stamp_nanos >= due) else { break };
        if first.submap != second.submap {
            continue;
        }
        let at = |f: &FrameRecord| true_pose(truth, f.stamp_nanos);
        let (Some(first_true), Some(second_true)) = (at(first), at(second)) else { continue };
        let [from, to] = [first, second].map(|f| Pose::from(&f.pose.world_from_camera));
        let relative = from.inverse() * to;
        let error = log(&(relative.inverse() * first_true.inverse() * second_true)).to_vector();
        let carry = adjoint(&relative.inverse());
        let covariance = from_upper_triangle(&second.pose.covariance)
            + carry * from_upper_triangle(&first.pose.covariance) * carry.transpose();
        let squared: Vec<f64> = (0..6).map(|i| error[i] * error[i] / covariance[(i, i)]).collect();
        n += 1;
        n_within += usize::from(squared.iter().all(|s| *s <= 9.0));
        normalised += squared.iter().sum::<f64>() / 6.0;
        translation += squared[..3].iter().sum::<f64>() / 3.0;
        error_m.push(error.fixed_rows::<3>(0).norm());
        sigma_m.push((0..3).map(|i| covariance[(i, i)]).sum::<f64>().sqrt());
    }
    error_m.sort_by(f64::total_cmp);
    sigma_m.sort_by(f64::total_cmp);
    let middle = |values: &[f64]| values.get(values.len() / 2).copied().unwrap_or(f64::NAN);
    let n = n as f64;
    Certainty {
        within: n_within as f64 / n,
        normalised: normalised / n,
        translation: translation / n,
        median_error_m: middle(&error_m),
        median_stated_m: middle(&sigma_m),
    }
}

/// The true pose at a time, between its two neighbours.
fn true_pose(truth: &Trajectory, stamp_nanos: i64) -> Option<Pose> {
    let after = truth.stamps_nanos.partition_point(|stamp| *stamp < stamp_nanos);
    let before = after.checked_sub(1)?;
    let (t0, t1) = (truth.stamps_nanos[before], *truth.stamps_nanos.get(after)?);
    let share = (stamp_nanos - t0) as f64 / (t1 - t0) as f64;
    (t1 - t0 < 100_000_000).then(|| truth.poses[before].lerp_slerp(&truth.poses[after], share))
}

/// Quantiles of the loop pairs' tests in the last correction.
fn report_loops(records: &Records) {
    let last = records.records.iter().rev().find_map(|r| match r {
        AlignRecord::Correction(applied) => Some(&applied.correction.loops),
        _ => None,
    });
    let Some(loops) = last.filter(|l| !l.is_empty()) else { return };
    let mut verdicts = std::collections::BTreeMap::new();
    loops.iter().for_each(|l| *verdicts.entry(format!("{:?}", l.verdict)).or_insert(0) += 1);
    println!("    {} loop pairs: {verdicts:?}", loops.len());
    let quantiles = |name: &str, value: fn(&LoopRecord) -> f64| {
        let mut values: Vec<f64> = loops.iter().map(value).collect();
        values.sort_by(f64::total_cmp);
        let at = |q: f64| values[((values.len() - 1) as f64 * q) as usize];
        println!(
            "      {name:22} 1 % {:.3}  10 % {:.3}  median {:.3}  90 % {:.3}  99 % {:.3}",
            at(0.01),
            at(0.1),
            at(0.5),
            at(0.9),
            at(0.99)
        );
    };
    quantiles("overlap", |l| l.overlap);
    quantiles("in front", |l| l.in_front);
    quantiles("inconsistency sigmas", |l| l.inconsistency_sigmas);
    quantiles("residual sigmas", |l| l.residual_sigmas);
}
