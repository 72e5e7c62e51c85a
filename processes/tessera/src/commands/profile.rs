//! `tessera profile`: one stage alone on its recorded input.

use crate::arguments::ProfileArguments;
use crate::exit::{CommandError, Exit};
use crate::terminal::say_report;
use tessera_lab::profile::{self, Options, Recorded, Stages};

/// Runs the stage and prints where its time went.
pub(crate) fn profile(arguments: &ProfileArguments) -> Result<Exit, CommandError> {
    let stage = Stages::named(&arguments.stage)?;
    let recorded = Recorded::read(&arguments.file)?;
    if recorded.stage != stage {
        return Err(CommandError::input(format!(
            "{} holds the input of {}, expected that of {stage}",
            arguments.file.display(),
            recorded.stage
        )));
    }
    let options = Options { repeat: arguments.repeat, steps: !arguments.no_steps };
    let report = profile::profile(&recorded, &options)?;
    say_report(arguments.json, &report, || report.for_people())
}
