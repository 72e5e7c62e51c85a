//! A run's folder read once, with the summary and the verdict: what the terminal, `summary.json`, the log,
//! the exit code and the report tell is one and the same.

use crate::ToolError;
use crate::export::{n_from_base, read_beside, read_groundtruth, read_journal, read_settings};
use crate::facts::Beside;
use crate::replay::Replay;
use crate::seen_focal::seen_focal;
use crate::statistics::{Ended, read_statistics};
use crate::summary::Summary;
use crate::truth::lateral;
use std::path::Path;
use tessera_evaluation::Trajectory;
use tessera_settings::Settings;
use tessera_stage::RunFiles;
use tessera_transport::living_runs;

/// All that outputs and reports of a run are made of.
#[derive(Debug)]
pub struct ReadRun {
    /// Its folder.
    pub files: RunFiles,
    /// The settings that it was made with.
    pub settings: Settings,
    /// The aligner's journal, as the refined camera saw it where there is one.
    pub replay: Replay,
    /// The ground truth that it kept.
    pub groundtruth: Option<Trajectory>,
    /// What came of it.
    pub summary: Summary,
    /// Why the features of its keyframes were not read: the store is damaged.
    pub(crate) unread: Option<ToolError>,
}

impl ReadRun {
    /// The summary of a run all of which could be read.
    ///
    /// # Errors
    /// Names what of the keyframe store could not be.
    pub fn into_summary(self) -> Result<Summary, ToolError> {
        self.unread.map_or(Ok(self.summary), Err)
    }
}

/// Reads a run's folder.
///
/// # Errors
/// Names the file that cannot be read, and why.
pub fn read_run(run_folder: &Path) -> Result<ReadRun, ToolError> {
    let files = RunFiles::new(run_folder);
    let settings = read_settings(&files)?;
    let as_mapped = read_journal(&files)?;
    let refined = as_mapped.with_refined_camera();
    let groundtruth = read_groundtruth(run_folder)?;
    let mut statistics = read_statistics(run_folder)?;
    if statistics.ended == Ended::Unfinished && goes_on(run_folder) {
        statistics.ended = Ended::GoingOn;
    }
    let beside = Beside { n_from_base: n_from_base(&files, &settings)?, ..read_beside(&files) };
    // A map that still changes is no ground to judge the lens on, and the stages need the processor.
    let (seen_focal, unread) = match statistics.ended {
        Ended::GoingOn => (None, None),
        _ => match seen_focal(&files, &as_mapped, &settings, &beside) {
            Ok(seen) => (seen, None),
            Err(error) => (None, Some(error)),
        },
    };
    // The judge of the camera asks what the run's own camera saw, whatever became of it.
    let lateral = groundtruth.as_ref().and_then(|truth| lateral(&as_mapped, truth));
    let beside = Beside { seen_focal, lateral, ..beside };
    let replay = refined.as_ref().unwrap_or(&as_mapped);
    let mut summary = Summary::new(&settings, replay, &statistics, groundtruth.as_ref(), &beside);
    if replay.refined().is_some() {
        summary.compare_with(&as_mapped, groundtruth.as_ref());
    }
    let replay = refined.unwrap_or(as_mapped);
    Ok(ReadRun { files, settings, replay, groundtruth, summary, unread })
}

/// Whether a supervisor keeps this run up.
fn goes_on(run_folder: &Path) -> bool {
    let Ok(folder) = std::fs::canonicalize(run_folder) else { return false };
    let is_it = |other: &Path| std::fs::canonicalize(other).is_ok_and(|other| other == folder);
    living_runs().unwrap_or_default().iter().any(|run| is_it(&run.run_dir))
}
