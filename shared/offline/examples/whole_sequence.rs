//! A whole sequence in one process: frames in, a trajectory and a map out.
//!
//! `cargo run --release -p tessera-offline --example whole_sequence -- [FOLDER]`
#![forbid(unsafe_code)]

use std::error::Error;
use tessera_offline::{Method, RawFrame, Run};
use tessera_sources::{FrameBuffers, Source, SourceOptions, SourceSpec, open};
use tessera_trajectory::{EvaluationOptions, evaluate};

/// Frames at most.
const FRAMES: u64 = 120;

fn main() -> Result<(), Box<dyn Error>> {
    let spec = SourceSpec::parse(&std::env::args().nth(1).unwrap_or_else(|| "room".to_owned()));
    let source = open(&spec, &SourceOptions { frames: Some(FRAMES), ..SourceOptions::default() })?;

    let mut run = Run::new(source.camera(), &Method::default())?;
    for index in 0..source.n_frames().unwrap_or(FRAMES) {
        run.push(&read(&*source, index)?);
    }
    let (records, map) = run.finish_with_map();

    let trajectory = records.last();
    println!(
        "{} frames, {} not tracked, {} keyframes",
        trajectory.poses.len(),
        records.n_untracked(),
        map.keyframes.len()
    );
    if let Some(truth) = source.ground_truth() {
        let score = evaluate(&trajectory, truth, &EvaluationOptions::default())?;
        println!("ATE {:.4} m over {} poses", score.ate_rmse_m, score.pairs);
    }
    Ok(())
}

fn read(source: &dyn Source, index: u64) -> Result<RawFrame, Box<dyn Error>> {
    let n_pixels = source.camera().width as usize * source.camera().height as usize;
    let (mut depth, mut colour) = (vec![0; n_pixels], vec![0; 3 * n_pixels]);
    let info = source.read(index, &mut FrameBuffers { depth: &mut depth, colour: &mut colour })?;
    let colour = info.has_colour.then_some(colour);
    Ok(RawFrame { stamp_nanos: info.stamp_nanos, rotation: info.rotation, depth, colour })
}
