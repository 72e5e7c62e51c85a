//! `report.html`: what a run directory holds, as a page to look at. Nothing reads it back, and no
//! result depends on it.

mod events;
mod facts;
pub(crate) mod frames;
mod loops;
mod pictures;
mod processes;
pub(crate) mod scene;
mod settings;
mod worst;

use crate::ReportedRun;
use crate::scene::{MOST_POINTS, MOST_SCENES};
use std::path::Path;
use tessera_outputs::ToolError;
use tessera_outputs::{self as outputs, ReadRun, Summary, write_file};

/// Name of the report in the run directory.
pub const REPORT_FILE: &str = "report.html";

/// Writes the report of runs, side by side where they are several, to a file.
///
/// # Errors
/// Names the file of a run that cannot be read, or the report that cannot be written.
pub fn write(run_folders: &[&Path], path: &Path) -> Result<(), ToolError> {
    let page = page_of(run_folders)?;
    write_file(path, |writer| writer.write_all(page.as_bytes()))
}

/// Writes the report of a run that was read, to a file.
///
/// # Errors
/// As [`write()`].
pub fn write_read(run: &ReadRun, path: &Path) -> Result<(), ToolError> {
    let reported = of_run(run, Some(MOST_POINTS))?;
    let page = crate::page(&[reported]).map_err(|error| ToolError::Stage(error.to_string()))?;
    write_file(path, |writer| writer.write_all(page.as_bytes()))
}

/// The report of runs as a page.
///
/// # Errors
/// Names the file of a run that cannot be read.
pub(crate) fn page_of(run_folders: &[&Path]) -> Result<String, ToolError> {
    // Runs side by side share what one page may hold.
    let most_points = MOST_POINTS.checked_div(run_folders.len().min(MOST_SCENES)).unwrap_or(0);
    let runs: Vec<ReportedRun> = run_folders
        .iter()
        .enumerate()
        .map(|(place, folder)| read(folder, (place < MOST_SCENES).then_some(most_points)))
        .collect::<Result<_, _>>()?;
    crate::page(&runs).map_err(|error| ToolError::Stage(error.to_string()))
}

/// The reasons of the verdict, each with what to try.
fn reasons(summary: &Summary) -> Vec<String> {
    let words = |found: &str, advice: &str| match advice.is_empty() {
        true => found.to_owned(),
        false => format!("{found}. Try: {advice}"),
    };
    summary.verdict.reasons.iter().map(|reason| words(&reason.found, &reason.advice)).collect()
}

/// All that a report tells of a run, with its map in at most so many points.
fn read(run_folder: &Path, most_points: Option<usize>) -> Result<ReportedRun, ToolError> {
    of_run(&outputs::read_run(run_folder)?, most_points)
}

fn of_run(run: &ReadRun, most_points: Option<usize>) -> Result<ReportedRun, ToolError> {
    let ReadRun { files, settings, replay, groundtruth, summary, .. } = run;
    let run_folder = &files.dir;
    // A run whose supervisor was killed has none.
    let timeline = outputs::read_timeline(run_folder).unwrap_or_default();
    let name = std::path::absolute(run_folder).unwrap_or_else(|_| run_folder.clone());
    let name = name.file_name().map_or_else(|| name.display().to_string(), |n| n.to_string_lossy().into());

    let placed = frames::place(replay, groundtruth.as_ref());
    let mut worst = worst::pick(&placed.frames, groundtruth.is_some());
    let no_pictures = pictures::add(&mut worst, replay, settings).err();
    let (events, n_more_events) = events::read(&files.log());
    let loops = loops::of(replay);
    let scene =
        most_points.map(|most_points| scene::of((files, settings), replay, &placed, &loops, most_points));
    Ok(ReportedRun {
        name,
        source: summary.source.clone(),
        ended: format!("{}: {}", summary.how_it_ended(), summary.verdict.grade),
        is_alarming: summary.is_alarming(),
        reasons: reasons(summary),
        facts: facts::of(summary),
        machine: facts::machine(summary, &timeline.machine),
        keyframes: frames::keyframes(replay, &placed),
        loops,
        scene,
        frames: placed.frames,
        truth_m: placed.truth_m,
        stages: processes::stages(summary, &timeline),
        samples: timeline.samples,
        events,
        n_more_events,
        settings: settings::of(settings),
        worst,
        no_pictures,
    })
}
