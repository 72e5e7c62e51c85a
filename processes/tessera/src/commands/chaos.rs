//! `tessera chaos`: faults on purpose, and what came of them.

use super::passed_on::pass_on;
use crate::arguments::ChaosArguments;
use crate::exit::{CommandError, Exit};
use crate::progress::work_bar;
use crate::terminal::{say, say_error, say_to_people};
use tessera_lab::chaos::{FaultKind, FaultTarget, attach, campaign};

/// Disturbs runs and says whether the promise was kept.
pub(crate) fn chaos(arguments: &ChaosArguments) -> Result<Exit, CommandError> {
    if let Some(passed) = &arguments.fleet {
        return pass_on("chaos", passed);
    }
    let targets = all(
        &arguments.stages,
        "stage",
        FaultTarget::from_name,
        "sensor, reconstruct, align, optimise, supervisor, group",
    )?;
    let kind = |name: &str| FaultKind::ALL.iter().find(|(known, _)| *known == name).map(|(_, kind)| *kind);
    let names = FaultKind::ALL.map(|(name, _)| name).join(", ");
    let kinds = all(&arguments.faults, "fault", kind, &names)?;
    if arguments.interval_ms == 0 || arguments.kills == 0 {
        return Err(CommandError::arguments("--kills or --interval-ms is 0, expected at least 1"));
    }
    let wanted = arguments.clone().into();
    let report = match &arguments.attach {
        Some(name) => attach(&wanted, name, &targets, &kinds)?,
        None => {
            let template = "{bar:20} {pos}/{len} faults, {wide_msg}";
            let bar = work_bar(arguments.quiet, Some(arguments.kills), template);
            let mut on_run = |number: u64, n_faults: u64| {
                bar.set_message(format!("run {number}"));
                bar.set_position(n_faults);
            };
            let report = campaign(&wanted, &targets, &kinds, &mut on_run);
            bar.finish_and_clear();
            report?
        }
    };
    if arguments.json {
        say(&report.to_json_lines()?);
    } else {
        say_to_people(&report.for_people());
    }
    let broken = report.broken();
    if broken.is_empty() {
        return Ok(Exit::Done);
    }
    broken.iter().for_each(|reason| say_error(reason));
    Ok(Exit::Stage)
}

/// Each name as what it stands for.
fn all<T>(
    names: &[String],
    what: &str,
    find: impl Fn(&str) -> Option<T>,
    expected: &str,
) -> Result<Vec<T>, CommandError> {
    let one = |name: &String| {
        find(name)
            .ok_or_else(|| CommandError::arguments(format!("no {what} {name:?}, expected one of {expected}")))
    };
    names.iter().map(one).collect()
}
