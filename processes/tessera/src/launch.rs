//! A run from its first process to its last output, whether fresh or resumed.

use crate::arguments::Speech;
use crate::commands::{exit_of, say_summary};
use crate::exit::{CommandError, Exit};
use crate::progress::ProgressView;
use crate::terminal::{say, say_error};
use std::time::Duration;
use tessera_evaluation::Trajectory;
use tessera_messages::Stage;
use tessera_outputs::{Ended, Recorder, RunStatistics, Summary, ToolError};
use tessera_report::REPORT_FILE;
use tessera_stage::log_line;
use tessera_supervisor::{Plan, Progress, RunOutcome, Supervised, hold, supervise};
use tessera_transport::RunClaim;

/// Time between two looks that `tessera status` can take at the counters.
const REFRESH: Duration = Duration::from_secs(1);

/// Runs the plan, under a name that may be taken already, writes the outputs and says what came of it.
/// `beside` is called once, when others can see the run.
pub(crate) fn launch(
    plan: &Plan,
    claim: Option<RunClaim>,
    groundtruth: Option<&Trajectory>,
    speech: Speech,
    beside: &mut dyn FnMut(),
) -> Result<Exit, CommandError> {
    let before =
        if plan.resume { tessera_outputs::read_statistics(&plan.run_dir)? } else { RunStatistics::default() };
    let recorded = if plan.resume { tessera_outputs::read_timeline(&plan.run_dir) } else { None };
    // The report alone reads it: without one its memory, which grows to a bound, is saved.
    let mut recorder =
        plan.settings.output.report.then(|| Recorder::new(recorded.unwrap_or_default(), before.wall_s));
    let write_timeline = |recorder: &Recorder| {
        // Best effort; failure is ignored.
        let _ = tessera_outputs::write_timeline(&plan.run_dir, &recorder.timeline());
    };
    let mut view = ProgressView::new(speech.quiet);
    let mut due = Duration::ZERO;
    let mut refused = None;
    let mut tell = |progress: &Progress| {
        view.tell(progress);
        if let Some(recorder) = &mut recorder {
            recorder.note(progress.elapsed, &progress.stages, false);
        }
        if progress.elapsed >= due {
            if due.is_zero() {
                beside();
                // The run directory is ours from here on.
                refused = tessera_outputs::write_groundtruth(&plan.run_dir, groundtruth).err();
            }
            due = progress.elapsed + REFRESH;
            // Only for `status`: the last word on these numbers is written at the end.
            let now = RunStatistics::new(Ended::Unfinished, &progress.stages, progress.elapsed, 0);
            let _ = tessera_outputs::write_statistics(&plan.run_dir, &before.and(&now));
            if progress.elapsed.as_secs() % 5 == 4 {
                recorder.iter().for_each(write_timeline);
            }
        }
    };
    let keep_up = if plan.hold { hold } else { supervise };
    let supervised = keep_up(plan, claim, &mut tell);
    view.end();
    let supervised = supervised?;
    if let Some(error) = refused {
        return Err(error.into());
    }
    if let Some(recorder) = &mut recorder {
        recorder.note(supervised.duration, &supervised.stages, true);
        write_timeline(recorder);
    }
    let concluded = conclude(plan, &before, &supervised, speech);
    // Only now: the name is taken until the last output is written.
    let released = supervised.claim.release().map_err(CommandError::from);
    concluded.and_then(|exit| released.map(|()| exit))
}

/// Writes and tells what can be told, however the run ended.
fn conclude(
    plan: &Plan,
    before: &RunStatistics,
    supervised: &Supervised,
    speech: Speech,
) -> Result<Exit, CommandError> {
    let Supervised { outcome, stages, shared_memory_bytes, duration, .. } = supervised;
    let ended = match outcome {
        RunOutcome::Finished => Ended::Finished,
        RunOutcome::Interrupted => Ended::Interrupted,
        RunOutcome::Failed(_) => Ended::Failed,
    };
    let statistics = RunStatistics::new(ended, stages, *duration, *shared_memory_bytes);
    let written = tessera_outputs::write_statistics(&plan.run_dir, &before.and(&statistics))
        .and_then(|()| write_outputs(plan));
    if let RunOutcome::Failed(failure) = outcome {
        // A stage that could not use its input or settings says so by its exit code.
        let exit = match failure.exit_code {
            Some(2) => Exit::Arguments,
            Some(3) => Exit::Input,
            _ => Exit::Stage,
        };
        let go_on = format!("once the cause is gone, go on with: {}", resume_command(plan));
        return Err(CommandError::Failed { exit, message: format!("{failure}\n{go_on}") });
    }
    let summary = written?;
    say_summary(&summary, &plan.run_dir, speech)?;
    log_line(summary.is_alarming(), &summary.verdict.in_one_line());
    if ended != Ended::Interrupted {
        if summary.is_nowhere() {
            say_error(&format!("no frame was found in the map of {}", plan.settings.run.map));
            return Ok(Exit::NotInMap);
        }
        return Ok(exit_of(&summary, speech));
    }
    if !speech.quiet && !speech.json {
        say(&format!("go on with: {}", resume_command(plan)));
    }
    Ok(Exit::Interrupted)
}

/// Writes outputs and report from one reading of the run's folder.
fn write_outputs(plan: &Plan) -> Result<Summary, ToolError> {
    let run = tessera_outputs::read_run(&plan.run_dir)?;
    let exported = tessera_outputs::export_read(&run, &plan.run_dir);
    if plan.settings.output.report
        && let Err(error) = tessera_report::write_read(&run, &plan.run_dir.join(REPORT_FILE))
    {
        // What was asked for is the trajectory and the map: the run is no worse without a page.
        say_error(&format!("no report: {error}"));
    }
    exported.and_then(|()| run.into_summary())
}

/// What brings the run to its end.
fn resume_command(plan: &Plan) -> String {
    format!("tessera resume {}", plan.run_dir.display())
}

/// Kill points of the first life of each stage: `align=stored:12,journaled:40;sensor=…`.
pub(crate) fn kill_plan(text: &str) -> Vec<(Stage, String)> {
    text.split(';')
        .filter_map(|part| {
            let (stage, points) = part.split_once('=')?;
            Some((Stage::from_name(stage)?, points.to_string()))
        })
        .collect()
}
