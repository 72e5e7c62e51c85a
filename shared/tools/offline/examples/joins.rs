//! Whether two runs over parts of one sequence become one map: joins, right and wrong, for each seed.
//!
//! `cargo run --release -p tessera-offline --example joins -- SEQUENCE A..B C..D [--every N] [--seeds N] [--first SEED]`
//!
//! SEQUENCE is a folder or the name of a world. A seed is that of the registration and, in a world, of its noise and
//! textures. Each join is printed with its error by the ground truth, metres and degrees.
#![forbid(unsafe_code)]

use std::error::Error;
use std::ops::Range;
use std::path::Path;
use tessera_geometry::{Pose, translation_rotation_norms};
use tessera_offline::{Feature, Method, RawFrame, Run, Vertex};
use tessera_slam::{Context, JointMap, KeyframeSurfaces, TrackerState};
use tessera_sources::{FolderSource, SceneName, SimulatedSource, SimulationOptions, Source};

/// Surfaces and features of the keyframes of both runs.
#[derive(Default)]
struct BothRuns(Vec<Vec<Vertex>>, Vec<Vec<Feature>>);

impl KeyframeSurfaces for BothRuns {
    fn vertices(&self, keyframe: u32) -> &[Vertex] {
        &self.0[keyframe as usize]
    }

    fn features(&self, keyframe: u32) -> &[Feature] {
        &self.1[keyframe as usize]
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (mut positional, mut every, mut n_seeds, mut first) = (Vec::new(), 1, 1, 0);
    while let Some(argument) = arguments.next() {
        let mut number =
            || arguments.next().ok_or("a number is missing")?.parse::<u64>().map_err(|_| "no number");
        match argument.as_str() {
            "--every" => every = number()?.max(1),
            "--seeds" => n_seeds = number()?,
            "--first" => first = number()?,
            _ => positional.push(argument),
        }
    }
    let [sequence, a, b] = &positional[..] else { return Err("expected SEQUENCE A..B C..D".into()) };
    let parts = [range(a)?, range(b)?];
    let mut n_joined = 0;
    for seed in first..first + n_seeds {
        n_joined += usize::from(joined(sequence, &parts, every, seed)?);
    }
    println!("{sequence} {a} {b}: joined in {n_joined} of {n_seeds} seeds");
    Ok(())
}

fn range(text: &str) -> Result<Range<u64>, Box<dyn Error>> {
    let (from, to) = text.split_once("..").ok_or(format!("{text}: expected A..B"))?;
    Ok(from.parse()?..to.parse()?)
}

fn open(sequence: &str, n_frames: u64, seed: u64) -> Result<Box<dyn Source>, Box<dyn Error>> {
    let scene = match sequence {
        "room" => SceneName::Room,
        "house" => SceneName::House,
        "building" => SceneName::Building,
        _ => return Ok(Box::new(FolderSource::open(Path::new(sequence), None, None)?)),
    };
    let options = SimulationOptions { seed, ..SimulationOptions::default() };
    Ok(Box::new(SimulatedSource::open(scene, None, Some(n_frames), &options)?))
}

/// Runs over both parts and joins them; whether they are one map then.
fn joined(sequence: &str, parts: &[Range<u64>; 2], every: u64, seed: u64) -> Result<bool, Box<dyn Error>> {
    let source = open(sequence, parts[0].end.max(parts[1].end), seed)?;
    let mut method = Method::default();
    method.registration.seed = seed;
    method.mapping.loops.min_frames = (method.mapping.loops.min_frames / every).max(1);
    let context = Context::new(source.camera(), &method.surface, &method.registration, &method.mapping);
    let (mut map, mut kept) = (JointMap::new(context), BothRuns::default());
    for part in parts {
        let mut run = Run::new(source.camera(), &method)?;
        for index in part.clone().step_by(every as usize) {
            run.push(&RawFrame::read(&*source, index)?);
        }
        let (records, saved) = run.finish_with_map();
        let mut state = TrackerState::default();
        records.records.iter().for_each(|record| state.apply(record));
        map.add(&state);
        kept.0.extend(saved.surfaces);
        kept.1.extend(saved.features);
    }
    let meetings = map.join(&kept, &mut || ());
    for meeting in &meetings {
        let told = error_of(&map, (meeting.own, meeting.seen), source.as_ref(), parts, every)
            .map_or("no ground truth".into(), |(m, deg)| format!("{m:.3} m, {deg:.1} deg off"));
        println!("seed {seed}: {meeting:?}: {told}");
    }
    if meetings.is_empty() {
        println!("seed {seed}: apart");
    }
    Ok(!meetings.is_empty())
}

/// How far two keyframes of a joined map are from where they truly are to each other.
fn error_of(
    map: &JointMap,
    (own, seen): (u32, u32),
    source: &dyn Source,
    parts: &[Range<u64>; 2],
    every: u64,
) -> Option<(f64, f64)> {
    let truth = source.ground_truth()?;
    let true_pose = |id: u32| {
        let run = map.run_of(id)?;
        let frame = parts[run].start + every * map.keyframes()[id as usize].frame_index;
        truth.poses.get(frame as usize).copied()
    };
    let found = |id: u32| Pose::from(&map.keyframes()[id as usize].world_from_camera);
    let expected = true_pose(seen)?.inverse() * true_pose(own)?;
    let (metres, radians) =
        translation_rotation_norms(&(expected.inverse() * (found(seen).inverse() * found(own))));
    Some((metres, radians.to_degrees()))
}
