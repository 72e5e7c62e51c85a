//! `tessera export`: the outputs of a run, written again from its folder.

use crate::arguments::{ExportArguments, Speech};
use crate::exit::{CommandError, Exit};
use crate::progress::work_bar;
use crate::run_folder;
use crate::terminal::{say, say_error, say_to_people};
use std::path::Path;
use tessera_outputs::{Grade, Summary};

/// Writes all outputs of a run.
pub(crate) fn export(arguments: &ExportArguments) -> Result<Exit, CommandError> {
    if let Some(base) = run_folder::base(&arguments.run) {
        let out = arguments.out.as_deref();
        let written = tessera_exchange::write_base(&base, &(&arguments.files).into(), out)?;
        say_written(&written, arguments.speech);
        return Ok(Exit::Done);
    }
    let run_folder = run_folder::find(&arguments.run)?;
    let bar = work_bar(arguments.speech.quiet, None, "{wide_msg}");
    let progress = |done: usize, of: usize| bar.set_message(format!("{done} of {of} keyframes fused"));
    let written = tessera_exchange::write(&run_folder, &(&arguments.files).into(), &progress)?;
    bar.finish_and_clear();
    if !written.is_empty() && arguments.out.is_none() {
        say_written(&written, arguments.speech);
        return Ok(Exit::Done);
    }
    let out_folder = arguments.out.as_deref().unwrap_or(&run_folder);
    let summary = tessera_outputs::export(&run_folder, out_folder)?;
    say_summary(&summary, out_folder, arguments.speech)?;
    Ok(exit_of(&summary, arguments.speech))
}

/// Prints a line for each file.
fn say_written(written: &[String], speech: Speech) {
    if speech.json {
        say(&serde_json::json!({ "written": written }).to_string());
    } else if !speech.quiet {
        written.iter().for_each(|line| say_to_people(line));
    }
}

/// With `--strict` the verdict, else that all was done.
pub(crate) fn exit_of(summary: &Summary, speech: Speech) -> Exit {
    match summary.verdict.grade {
        Grade::Doubtful if speech.strict => Exit::Doubtful,
        Grade::Failed if speech.strict => Exit::Useless,
        _ => Exit::Done,
    }
}

/// Prints a summary in the form asked for.
pub(crate) fn say_summary(summary: &Summary, folder: &Path, speech: Speech) -> Result<(), CommandError> {
    if speech.json {
        say(&summary.to_json()?);
    } else if speech.quiet {
        // An exit code that is none of success has its words, however quiet.
        if exit_of(summary, speech) != Exit::Done {
            say_error(&format!("--strict: {}", summary.verdict.in_one_line()));
        }
    } else {
        let folder = folder.display();
        say_to_people(&format!("{}  outputs     {folder}", summary.for_people()));
    }
    Ok(())
}
