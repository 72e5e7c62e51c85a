//! One sequence through all columns at once: each frame is read one time.

use super::columns::{Column, columns};
use super::parts::PARTS;
use super::peers::Peers;
use super::table::{AblationRow, Spread, TableCell, Whole};
use rayon::prelude::*;
use tessera_evaluation::{Evaluation, EvaluationOptions, Trajectory};
use tessera_offline::{Method, RawFrame, Records, Run};
use tessera_outputs::ToolError;
use tessera_settings::Settings;
use tessera_sources::Source;

/// Frames decoded at a time.
const BATCH: u64 = 8;

/// Which settings an ablation starts from.
#[derive(Clone, Debug)]
pub struct AblationPlan {
    /// Preset or file of the columns.
    pub columns_base: String,
    /// Preset or file of the whole system.
    pub whole_base: String,
    /// `key=value`, over both bases and below the columns' own.
    pub overrides: Vec<String>,
    /// Sampling seeds, at least 1.
    pub seeds: u64,
}

/// What one seed gave on one sequence.
struct AblationSample {
    columns: Vec<Errors>,
    /// The whole system, then the system without each part.
    wholes: Vec<[Errors; 2]>,
}

struct Errors {
    ate_m: f64,
    rpe_m_per_s: f64,
    frames_untracked: usize,
}

impl AblationPlan {
    /// Settings of the columns, of the whole system, and of the system without each part, in order.
    ///
    /// # Errors
    /// A base or an override that cannot be.
    pub fn settings(&self) -> Result<Vec<Settings>, ToolError> {
        let mut all = columns()
            .iter()
            .map(|column| column.settings(&self.columns_base, &self.overrides))
            .collect::<Result<Vec<_>, _>>()?;
        all.push(Settings::load(Some(&self.whole_base), &self.overrides)?);
        for part in &PARTS {
            let own = part.overrides.iter().map(|pair| (*pair).to_owned());
            let overrides: Vec<String> = self.overrides.iter().cloned().chain(own).collect();
            let mut settings = Settings::load(Some(&self.whole_base), &overrides)?;
            (part.change)(&mut settings);
            all.push(settings);
        }
        Ok(all)
    }
}

/// Runs all columns and the whole system over a source with ground truth. `peers`: whom to compare
/// with, where all frames take part. `progress` hears of the frames that all columns have done.
///
/// # Errors
/// Names the sequence: no ground truth, a frame that cannot be read, too short for the RPE.
pub fn measure(
    name: &str,
    source: &dyn Source,
    plan: &AblationPlan,
    peers: Option<&Peers>,
    progress: &mut dyn FnMut(u64),
) -> Result<AblationRow, ToolError> {
    let truth = ground_truth(name, source)?;
    let n_frames = source
        .n_frames()
        .ok_or_else(|| ToolError::Input(format!("{name} has no end, expected --frames N")))?;
    let n_columns = columns().len();
    let mut samples = Vec::new();
    for seed in 0..plan.seeds {
        let mut runs = plan
            .settings()?
            .into_iter()
            .map(|mut settings| {
                settings.registration.seed += seed;
                let Settings { surface, registration, mapping, .. } = settings;
                Run::stamped(
                    source.camera(),
                    &Method { surface, registration, mapping },
                    source.pairing().stamp_sigma_s(),
                )
                .map_err(|error| ToolError::Arguments(error.to_string()))
            })
            .collect::<Result<Vec<Run>, _>>()?;
        let mut next = 0;
        while next < n_frames {
            let end = n_frames.min(next + BATCH);
            let frames = read(source, next..end)?;
            runs.par_iter_mut().for_each(|run| frames.iter().for_each(|frame| drop(run.push(frame))));
            progress(end - next);
            next = end;
        }
        let wholes = runs.split_off(n_columns);
        samples.push(sample(name, truth, runs, wholes)?);
    }
    Ok(row(name, n_frames, &samples, peers))
}

/// The ground truth that every sequence here must have.
///
/// # Errors
/// Names the sequence.
pub fn ground_truth<'a>(name: &str, source: &'a dyn Source) -> Result<&'a Trajectory, ToolError> {
    source.ground_truth().ok_or_else(|| {
        ToolError::Input(format!("{name} has no ground truth, expected a groundtruth.txt beside depth.txt"))
    })
}

fn read(source: &dyn Source, indices: std::ops::Range<u64>) -> Result<Vec<RawFrame>, ToolError> {
    indices.into_par_iter().map(|index| Ok(RawFrame::read(source, index)?)).collect()
}

fn sample(
    name: &str,
    truth: &Trajectory,
    runs: Vec<Run>,
    wholes: Vec<Run>,
) -> Result<AblationSample, ToolError> {
    let columns = runs
        .into_iter()
        .zip(columns())
        .map(|(run, Column { name: column, .. })| {
            let records = run.stop();
            errors(&format!("{name}, {column}"), &records, &records.online(), truth)
        })
        .collect::<Result<_, _>>()?;
    // One after the other: their final optimisations take memory.
    let whole = |run: Run| {
        let records = run.finish();
        let of = |trajectory: &Trajectory| errors(name, &records, trajectory, truth);
        Ok([of(&records.last())?, of(&records.online())?])
    };
    Ok(AblationSample { columns, wholes: wholes.into_iter().map(whole).collect::<Result<_, ToolError>>()? })
}

fn errors(
    name: &str,
    records: &Records,
    estimate: &Trajectory,
    truth: &Trajectory,
) -> Result<Errors, ToolError> {
    let evaluation = tessera_evaluation::evaluate(estimate, truth, &EvaluationOptions::default())
        .map_err(|error| ToolError::Input(format!("{name}: {error}")))?;
    let Evaluation { ate_rmse_m, rpe_translation_rmse_m_per_s, .. } = evaluation;
    let rpe_m_per_s = rpe_translation_rmse_m_per_s.ok_or_else(|| {
        let seconds = match (estimate.stamps_nanos.first(), estimate.stamps_nanos.last()) {
            (Some(first), Some(last)) => (last - first) as f64 * 1e-9,
            _ => 0.0,
        };
        ToolError::Input(format!(
            "{name}: {} frames over {seconds:.2} s, expected poses one second apart that have ground truth",
            estimate.len()
        ))
    })?;
    Ok(Errors { ate_m: ate_rmse_m, rpe_m_per_s, frames_untracked: records.n_untracked() })
}

fn row(name: &str, frames: u64, samples: &[AblationSample], peers: Option<&Peers>) -> AblationRow {
    let spread = |value: &dyn Fn(&AblationSample) -> f64| {
        // There is at least one seed.
        Spread::of(samples.iter().map(value)).unwrap_or(Spread {
            median: f64::NAN,
            least: f64::NAN,
            most: f64::NAN,
        })
    };
    let most = |value: &dyn Fn(&AblationSample) -> usize| samples.iter().map(value).max().unwrap_or(0);
    let n_columns = samples.first().map_or(0, |s| s.columns.len());
    let cells = (0..n_columns).map(|column| TableCell {
        rpe_m_per_s: spread(&|s| s.columns[column].rpe_m_per_s),
        frames_untracked: most(&|s| s.columns[column].frames_untracked),
    });
    let whole = |place: usize| Whole {
        ate_m: spread(&|s| s.wholes[place][0].ate_m),
        rpe_online_m_per_s: spread(&|s| s.wholes[place][1].rpe_m_per_s),
        frames_untracked: most(&|s| s.wholes[place][0].frames_untracked),
    };
    AblationRow {
        sequence: name.to_owned(),
        frames,
        cells: cells.collect(),
        whole: whole(0),
        without: (1..=PARTS.len()).map(whole).collect(),
        peers: peers.map_or(Vec::new(), |peers| peers.of(name)),
    }
}
