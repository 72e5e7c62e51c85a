//! A whole sequence in one process: frames in, a trajectory and a map out.
//!
//! `cargo run --release -p tessera-offline --example whole_sequence -- [FOLDER]`
#![forbid(unsafe_code)]

use std::error::Error;
use tessera_evaluation::{EvaluationOptions, evaluate};
use tessera_offline::{Method, RawFrame, Run};
use tessera_sources::{SourceOptions, SourceSpec, open};

/// Frames at most.
const FRAMES: u64 = 120;

fn main() -> Result<(), Box<dyn Error>> {
    let spec = SourceSpec::parse(&std::env::args().nth(1).unwrap_or_else(|| "room".to_owned()));
    let source = open(&spec, &SourceOptions { frames: Some(FRAMES), ..SourceOptions::default() })?;

    let mut run = Run::new(source.camera(), &Method::default())?;
    for index in 0..source.n_frames().unwrap_or(FRAMES) {
        run.push(&RawFrame::read(&*source, index)?);
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
