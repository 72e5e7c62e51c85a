//! Jumps between real sequences: a camera that is in one place, then in another one, and back.
//!
//! `cargo run --release -p tessera-offline --example planted_jumps -- FIRST SECOND [--from N] [--frames N] [--seeds N] [key=value]...`
//!
//! All of FIRST, all of SECOND as if the same camera had seen it, and `--frames` of FIRST from frame `--from` on.
//! A relocalisation is false where a frame of SECOND is tracked in the map of FIRST, or a frame that comes back
//! more than 0.1 m or 5 degrees from where it was the first time; found again is the first frame tracked right.
#![forbid(unsafe_code)]

use std::error::Error;
use tessera_geometry::{Pose, translation_rotation_norms};
use tessera_offline::{Method, RawFrame, Run, State};
use tessera_settings::Settings;
use tessera_sources::{SourceOptions, SourceSpec};

/// A frame that comes back is right within these, metres and degrees.
const RIGHT: (f64, f64) = (0.1, 5.0);
/// Time from frame to frame, nanoseconds.
const STEP_NANOS: i64 = 33_333_333;

fn main() -> Result<(), Box<dyn Error>> {
    let (mut sequences, mut overrides) = (Vec::new(), Vec::new());
    let (mut from, mut n_back, mut n_seeds) = (100, 60, 5);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut number =
            || arguments.next().ok_or(format!("{argument} N"))?.parse::<usize>().map_err(|e| e.to_string());
        match argument.as_str() {
            "--from" => from = number()?,
            "--frames" => n_back = number()?,
            "--seeds" => n_seeds = number()? as u64,
            a if a.contains('=') => overrides.push(argument),
            _ => sequences.push(argument),
        }
    }
    let [first, second] = sequences.as_slice() else { return Err("FIRST and SECOND are needed".into()) };
    let open = |name: &String| tessera_sources::open(&SourceSpec::parse(name), &SourceOptions::default());
    let sources = [open(first)?, open(second)?];
    let [there, elsewhere] = [decode(&*sources[0])?, decode(&*sources[1])?];
    let (mut n_false, mut n_late) = (0, 0);
    for seed in 0..n_seeds {
        let mut settings = Settings::load(None, &overrides)?;
        settings.registration.seed += seed;
        let (surface, registration, mapping) = (settings.surface, settings.registration, settings.mapping);
        let mut run = Run::new(sources[0].camera(), &Method { surface, registration, mapping })?;
        let back = there.iter().skip(from).take(n_back);
        for (k, frame) in there.iter().chain(&elsewhere).chain(back).enumerate() {
            run.push(&RawFrame { stamp_nanos: k as i64 * STEP_NANOS, ..frame.clone() });
        }
        let records = run.finish();
        let frames: Vec<_> = records.frames().collect();
        let (known, rest) = frames.split_at(there.len());
        let (away, back) = rest.split_at(elsewhere.len());
        let is_here = |submap: u32| submap == known[0].submap;
        let tracked = |state: State, submap: u32| state == State::Tracking && is_here(submap);
        // The frames just behind the jump may still be the motion of the camera.
        let away_false = away.iter().filter(|f| tracked(f.state, f.submap)).count();
        let relocalising =
            away.iter().filter(|f| f.state == State::Relocalising && is_here(f.submap)).count();
        let is_right = |k: usize| {
            let [now, before] = [back[k], known[from + k]].map(|f| Pose::from(&f.pose.world_from_camera));
            let (metres, radians) = translation_rotation_norms(&(before.inverse() * now));
            metres <= RIGHT.0 && radians.to_degrees() <= RIGHT.1
        };
        let of_back = (0..back.len()).filter(|k| tracked(back[*k].state, back[*k].submap));
        let (right, wrong): (Vec<usize>, Vec<usize>) = of_back.partition(|k| is_right(*k));
        println!(
            "seed {seed}: away {away_false} tracked in the first map, {relocalising} relocalising; back {} wrong, found after {:?} frames",
            wrong.len(),
            right.first()
        );
        for frame in away.iter().chain(back).filter(|f| f.reason().contains("found by")).take(6) {
            println!("    frame {}: {:?} {}", frame.index, frame.state, frame.reason());
        }
        n_false += usize::from(away_false + wrong.len() > 0);
        n_late += usize::from(right.first().is_none_or(|first| *first > 30));
    }
    println!(
        "{n_seeds} seeds: {n_false} with a false relocalisation, {n_late} not found again within 30 frames"
    );
    Ok(())
}

fn decode(source: &dyn tessera_sources::Source) -> Result<Vec<RawFrame>, Box<dyn Error>> {
    use rayon::prelude::*;
    let read = |index| RawFrame::read(source, index);
    Ok((0..source.n_frames().unwrap_or(0)).into_par_iter().map(read).collect::<Result<_, _>>()?)
}
