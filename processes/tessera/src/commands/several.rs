//! `tessera run A B C`: several recordings one after the other, then all side by side.

use crate::arguments::RunArguments;
use crate::commands::run::run;
use crate::exit::{CommandError, Exit};
use crate::run_folder;
use crate::terminal::{say, say_error};
use std::path::{Path, PathBuf};

/// The page that compares the runs.
const PAGE: &str = "comparison.html";

/// Runs each source in a folder of its own, goes on after one that fails, and compares what came of
/// them. The exit code is that of the first run that was not done.
pub(crate) fn several(arguments: &RunArguments) -> Result<Exit, CommandError> {
    let of_one = [
        ("--name", arguments.name.is_some()),
        ("--at", arguments.at.is_some()),
        ("--map-update", arguments.map_update),
        ("--rerun", arguments.rerun.is_some()),
        ("--trace", arguments.trace.is_some()),
        ("external", arguments.sources.iter().any(|source| source == "external")),
    ];
    if let Some((option, _)) = of_one.iter().find(|(_, is_given)| *is_given) {
        return Err(CommandError::arguments(format!("{option} is for one source, found several")));
    }
    let base = arguments.out.clone().unwrap_or_else(|| PathBuf::from(run_folder::RUNS));
    let (mut folders, mut first) = (Vec::new(), Exit::Done);
    for source in &arguments.sources {
        let out = run_folder::fresh(&base, source);
        let one = RunArguments { sources: vec![source.clone()], out: Some(out.clone()), ..arguments.clone() };
        let exit = run(&one).unwrap_or_else(|error| {
            say_error(&error.to_string());
            error.exit()
        });
        first = if first == Exit::Done { exit } else { first };
        folders.extend(out.join("summary.json").is_file().then_some(out));
        if exit == Exit::Interrupted {
            break;
        }
    }
    let folders: Vec<&Path> = folders.iter().map(PathBuf::as_path).collect();
    if !folders.is_empty() && !arguments.speech.json {
        let page = base.join(PAGE);
        tessera_report::write(&folders, &page)?;
        if !arguments.speech.quiet {
            say(&format!("{}side by side: {}", tessera_outputs::comparison(&folders)?, page.display()));
        }
    }
    Ok(first)
}
