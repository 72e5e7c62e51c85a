//! Wrong loops between rooms that look alike: the camera walks through the first two rooms of the
//! simulated building, which are the same to it, once for each seed.
//!
//! `cargo run --release -p tessera-offline --example look_alike -- [--seeds N] [--first SEED] [--every N] [--skip N] [--frames N] [key=value]...`
//!
//! A seed is that of the noise, the hand's tremor and the textures, and of the registration. Each `--every`th
//! frame is taken; the least distance of a loop in frames is that of the settings divided by it.
//! A loop is wrong where the optimiser accepts it and puts its two keyframes more than 1 m or 30 degrees
//! from where they truly are to each other.
//! Verified and accepted are the pairs of a correction's last iteration. What appearance alone proposed is
//! weighed in its first one: a wrong pair that is kept there shows in the poses, and so in the last.
#![forbid(unsafe_code)]

use rayon::prelude::*;
use std::collections::BTreeMap;
use std::error::Error;
use tessera_evaluation::{EvaluationOptions, evaluate};
use tessera_geometry::{Pose, translation_rotation_norms};
use tessera_offline::{Method, RawFrame, Records, Run};
use tessera_settings::Settings;
use tessera_slam::{AlignRecord, Correction, LoopVerdict};
use tessera_sources::{SceneName, SimulatedSource, SimulationOptions, Source};

/// A loop is wrong beyond these.
const WRONG_M: f64 = 1.0;
const WRONG_DEG: f64 = 30.0;
/// Wrong loops that are listed for a seed.
const MOST_LISTED: usize = 5;

/// What is walked.
struct WayPart {
    skip: u64,
    frames: u64,
    every: u64,
}

/// What became of the loops of one run.
#[derive(Clone, Copy, Debug, Default)]
struct LoopCounts {
    /// Pairs that appearance proposed, and those of them that show another place.
    proposed: usize,
    proposed_apart: usize,
    /// Pairs of the last correction that passed the tests of geometry.
    verified: usize,
    /// Pairs that it kept.
    accepted: usize,
    /// Kept pairs that are wrong, in the last correction and in any of them.
    wrong: usize,
    wrong_ever: usize,
    /// Corrections, and those in which a loop did not fit at full weight: graduated non-convexity decided.
    corrections: usize,
    decided: usize,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut walk = WayPart { skip: 230, frames: 1030, every: 4 };
    let (mut n_seeds, mut first, mut overrides) = (50, 1, Vec::new());
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut number =
            || arguments.next().ok_or(format!("{argument} N"))?.parse::<u64>().map_err(|e| e.to_string());
        match argument.as_str() {
            "--seeds" => n_seeds = number()?,
            "--first" => first = number()?,
            "--every" => walk.every = number()?.max(1),
            "--skip" => walk.skip = number()?,
            "--frames" => walk.frames = number()?,
            a if a.contains('=') => overrides.push(argument),
            other => {
                return Err(format!(
                    "{other}: expected --seeds, --first, --every, --skip, --frames or key=value"
                )
                .into());
            }
        }
    }
    let (mut sum, mut n_with_wrong) = (LoopCounts::default(), 0);
    for seed in first..first + n_seeds {
        let counts = run(&walk, seed, &overrides)?;
        n_with_wrong += usize::from(counts.wrong_ever > 0);
        sum = LoopCounts {
            proposed: sum.proposed + counts.proposed,
            proposed_apart: sum.proposed_apart + counts.proposed_apart,
            verified: sum.verified + counts.verified,
            accepted: sum.accepted + counts.accepted,
            wrong: sum.wrong + counts.wrong,
            wrong_ever: sum.wrong_ever + counts.wrong_ever,
            corrections: sum.corrections + counts.corrections,
            decided: sum.decided + counts.decided,
        };
    }
    println!("{n_seeds} seeds: {}; {n_with_wrong} seeds with a wrong loop", told(&sum));
    Ok(())
}

fn told(counts: &LoopCounts) -> String {
    format!(
        "{} proposed by appearance ({} of another place), {} verified, {} accepted, {} wrong at the end, {} in any \
         correction; {} of {} corrections decided by graduated non-convexity",
        counts.proposed,
        counts.proposed_apart,
        counts.verified,
        counts.accepted,
        counts.wrong,
        counts.wrong_ever,
        counts.decided,
        counts.corrections
    )
}

/// Walks once and prints what became of the loops.
fn run(walk: &WayPart, seed: u64, overrides: &[String]) -> Result<LoopCounts, Box<dyn Error>> {
    let options = SimulationOptions { seed, ..SimulationOptions::default() };
    let last = walk.skip + walk.frames;
    let source = SimulatedSource::open(SceneName::Building, None, Some(last), &options)?;
    let mut settings = Settings::load(None, overrides)?;
    settings.registration.seed += seed;
    settings.mapping.loops.min_frames = (settings.mapping.loops.min_frames / walk.every).max(1);
    let (surface, registration, mapping) = (settings.surface, settings.registration, settings.mapping);
    let mut run = Run::new(source.camera(), &Method { surface, registration, mapping })?;
    let indices: Vec<u64> = (walk.skip..last).step_by(walk.every as usize).collect();
    for some in indices.chunks(16) {
        let read = |index: &u64| RawFrame::read(&source, *index);
        let frames: Vec<RawFrame> = some.par_iter().map(read).collect::<Result<_, _>>()?;
        frames.iter().for_each(|frame| drop(run.push(frame)));
    }
    let records = run.finish();
    let truth = source.ground_truth().ok_or("the building has ground truth")?;
    let true_pose = |frame: u64| truth.poses[indices[frame as usize] as usize];
    let counts = counted(&records, &true_pose);
    let ate_m = evaluate(&records.last(), truth, &EvaluationOptions::default())?.ate_rmse_m;
    println!("seed {seed}: {}; {} frames untracked, ATE {ate_m:.4} m", told(&counts), records.n_untracked());
    Ok(counts)
}

fn counted(records: &Records, true_pose: &dyn Fn(u64) -> Pose) -> LoopCounts {
    // The frame of each keyframe, by its id: ids count from 0 in order.
    let keyframes: Vec<_> = records.frames().filter_map(|frame| frame.change.new_keyframe.as_ref()).collect();
    let frames: Vec<u64> = keyframes.iter().map(|keyframe| keyframe.frame_index).collect();
    let truly = |newer: u32, older: u32| {
        let [newer, older] = [newer, older].map(|id| true_pose(frames[id as usize]));
        older.inverse() * newer
    };
    let mut counts = LoopCounts::default();
    for (id, keyframe) in keyframes.iter().enumerate() {
        let is_elsewhere = |older: &&u32| is_apart(&truly(id as u32, **older));
        counts.proposed += keyframe.alike.len();
        counts.proposed_apart += keyframe.alike.iter().filter(is_elsewhere).count();
    }
    for record in &records.records {
        let AlignRecord::Correction(applied) = record else { continue };
        let correction = &applied.correction;
        counts.corrections += 1;
        counts.decided += usize::from(correction.n_graduated_rounds > 0);
        let of = |verdict: LoopVerdict| correction.loops.iter().filter(move |l| l.verdict == verdict).count();
        counts.accepted = of(LoopVerdict::Accepted);
        counts.verified = counts.accepted + of(LoopVerdict::Outvoted);
        let wrong = wrong_loops(correction, &truly);
        for (newer, older, metres) in wrong.iter().take(MOST_LISTED) {
            let [newer, older] = [newer, older].map(|id| frames[*id as usize]);
            println!("    frames {newer} and {older} of the run: {metres:.2} m from the truth");
        }
        counts.wrong = wrong.len();
        counts.wrong_ever += wrong.len();
    }
    counts
}

/// Loops that a correction accepted and that are wrong: newer and older keyframe, and by how many metres.
fn wrong_loops(correction: &Correction, truly: &dyn Fn(u32, u32) -> Pose) -> Vec<(u32, u32, f64)> {
    let poses: BTreeMap<u32, Pose> =
        correction.keyframes.iter().map(|k| (k.id, Pose::from(&k.world_from_camera))).collect();
    let accepted = correction.loops.iter().filter(|l| l.verdict == LoopVerdict::Accepted);
    accepted
        .filter_map(|l| {
            let older_from_newer = poses.get(&l.older)?.inverse() * poses.get(&l.newer)?;
            let error = truly(l.newer, l.older).inverse() * older_from_newer;
            is_apart(&error).then(|| (l.newer, l.older, translation_rotation_norms(&error).0))
        })
        .collect()
}

fn is_apart(motion: &Pose) -> bool {
    let (metres, radians) = translation_rotation_norms(motion);
    metres > WRONG_M || radians.to_degrees() > WRONG_DEG
}
