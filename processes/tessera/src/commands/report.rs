//! `tessera report`: what came of one run or several, as a page.

use crate::arguments::ReportArguments;
use crate::exit::{CommandError, Exit};
use crate::run_folder;
use crate::terminal::say;
use std::path::{Path, PathBuf};
use tessera_report::REPORT_FILE;

/// Writes the report and says where it is.
pub(crate) fn report(arguments: &ReportArguments) -> Result<Exit, CommandError> {
    let folders: Vec<PathBuf> =
        arguments.runs.iter().map(|run| run_folder::find(run)).collect::<Result<_, _>>()?;
    let path = match (&arguments.out, folders.as_slice()) {
        (Some(path), _) => path.clone(),
        (None, [folder]) => folder.join(REPORT_FILE),
        (None, _) => PathBuf::from(REPORT_FILE),
    };
    let folders: Vec<&Path> = folders.iter().map(PathBuf::as_path).collect();
    tessera_report::write(&folders, &path)?;
    if !arguments.quiet {
        say(&path.display().to_string());
    }
    Ok(Exit::Done)
}
