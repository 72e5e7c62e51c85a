//! `tessera evaluate`: a trajectory against the ground truth.

use crate::arguments::EvaluateArguments;
use crate::exit::{CommandError, Exit};
use crate::run_folder;
use crate::terminal::say_report;
use std::fmt::Write;
use std::path::PathBuf;
use tessera_evaluation::{
    AteOptions, Evaluation, EvaluationOptions, SEARCH_S, Statistics, Trajectory, ate, best_time_offset_s,
    read_trajectory,
};
use tessera_outputs::ToolError;

/// Prints the errors of an estimate.
pub(crate) fn evaluate(arguments: &EvaluateArguments) -> Result<Exit, CommandError> {
    let (estimate_file, groundtruth_file) = files(arguments)?;
    let (estimate, groundtruth) = read_trajectory(&estimate_file)?
        .together(read_trajectory(&groundtruth_file)?)
        .map_err(CommandError::input)?;
    let options = EvaluationOptions { time_offset: arguments.time_offset.is_some(), scale: arguments.scale };
    let evaluated = tessera_evaluation::evaluate(&estimate, &groundtruth, &options);
    let evaluation = evaluated.map_err(|source| {
        let error = ToolError::Evaluation {
            estimate: estimate_file.display().to_string(),
            groundtruth: groundtruth_file.display().to_string(),
            source,
        };
        match moved(&estimate, &groundtruth).filter(|_| options.time_offset) {
            Some(words) => CommandError::input(format!("{error}; {words}")),
            None => error.into(),
        }
    })?;
    say_report(arguments.json, &evaluation, || for_people(&evaluation, &options))
}

/// What an estimate comes to whose stamps have no pair as they are and would have by a constant offset.
fn moved(estimate: &Trajectory, groundtruth: &Trajectory) -> Option<String> {
    let offset_s = best_time_offset_s(estimate, groundtruth)?;
    let errors = ate(estimate, groundtruth, &AteOptions { offset_s, ..AteOptions::default() }).ok()?;
    let (n, rmse) = (errors.pairs.len(), errors.statistics_m.rmse);
    Some(format!("with stamps moved by {offset_s:+.4} s: {n} pairs, ATE rmse {rmse:.6} m"))
}

/// The two trajectories: two files, or those of a run by its name.
fn files(arguments: &EvaluateArguments) -> Result<(PathBuf, PathBuf), CommandError> {
    let EvaluateArguments { estimate, groundtruth, .. } = arguments;
    if estimate.is_file()
        && let Some(groundtruth) = groundtruth
    {
        return Ok((estimate.clone(), groundtruth.clone()));
    }
    if estimate.is_file() {
        let message = format!("{}: expected a second file, the ground truth", estimate.display());
        return Err(CommandError::arguments(message));
    }
    let folder = match run_folder::find(&estimate.to_string_lossy()) {
        Ok(folder) => folder,
        // Two files were meant: the error is that of the first.
        Err(_) if groundtruth.is_some() => {
            return Ok((estimate.clone(), groundtruth.clone().unwrap_or_default()));
        }
        Err(error) => return Err(error),
    };
    let own = folder.join("groundtruth.txt");
    let groundtruth = groundtruth.clone().unwrap_or(own);
    if !groundtruth.is_file() {
        let message = format!("{}: the run has no ground truth; give a file of it", folder.display());
        return Err(CommandError::input(message));
    }
    Ok((folder.join("trajectory.txt"), groundtruth))
}

/// The evaluation as a few lines that fit 80 columns.
fn for_people(evaluation: &Evaluation, options: &EvaluationOptions) -> String {
    let mut text = String::new();
    let coverage = &evaluation.coverage;
    let line = |text: &mut String, name: &str, statistics: &Statistics, unit: &str| {
        let Statistics { rmse, mean, median, max, .. } = statistics;
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "{name:<16} rmse {rmse:.6}  mean {mean:.6}  median {median:.6}  max {max:.6} {unit}"
        );
    };
    line(&mut text, "ATE", &evaluation.ate_m, "m");
    let _ = writeln!(
        text,
        "{:<16} {} pairs: {:.1} % of the estimate's {} poses, {:.1} % of the true path's time",
        "",
        evaluation.pairs,
        100.0 * coverage.share_of_estimate,
        coverage.estimate_poses,
        100.0 * coverage.share_of_groundtruth_time,
    );
    let _ =
        writeln!(text, "{:<16} {:.6} m at the last pose, seen from the first", "end", evaluation.end_error_m);
    match (&evaluation.rpe_translation_m_per_s, &evaluation.rpe_rotation_deg_per_s) {
        (Some(translation), Some(rotation)) => {
            line(&mut text, "RPE translation", translation, "m/s");
            line(&mut text, "RPE rotation", rotation, "deg/s");
            let _ = writeln!(text, "{:<16} {} pairs one second apart", "", evaluation.rpe_pairs);
        }
        _ => text.push_str("RPE              none: no two poses one second apart have ground truth\n"),
    }
    if options.time_offset {
        match &evaluation.with_time_offset {
            Some(report) => {
                let rpe = report.rpe_translation_rmse_m_per_s;
                let rpe = rpe.map_or(String::new(), |rpe| format!(", RPE rmse {rpe:.6} m/s"));
                let _ = writeln!(
                    text,
                    "with stamps moved by {:+.4} s: ATE rmse {:.6} m{rpe}",
                    report.offset_s, report.ate_rmse_m
                );
            }
            None => {
                let _ = writeln!(
                    text,
                    "no time offset: none within {SEARCH_S} s fits better than its neighbours, or too little overlaps"
                );
            }
        }
    }
    if let Some(report) = &evaluation.with_scale {
        let _ = writeln!(text, "with scale {:.6}: ATE rmse {:.6} m", report.scale, report.ate_rmse_m);
    }
    text
}
