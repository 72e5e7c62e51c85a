//! `tessera completions` and `tessera man`: the command line as shells and manuals want it.

use crate::arguments::Arguments;
use crate::exit::{CommandError, Exit};
use crate::terminal::say;
use clap::CommandFactory;
use clap_complete::Shell;
use std::path::Path;

/// Prints the completion script of a shell.
pub(crate) fn completions(shell: Shell) -> Result<Exit, CommandError> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Arguments::command(), "tessera", &mut script);
    say(&String::from_utf8_lossy(&script));
    Ok(Exit::Done)
}

/// Writes `tessera.1`, and a page for each command.
pub(crate) fn man(folder: &Path) -> Result<Exit, CommandError> {
    let written = std::fs::create_dir_all(folder);
    let written = written.and_then(|()| clap_mangen::generate_to(Arguments::command(), folder));
    written.map_err(|error| CommandError::write(folder, error))?;
    Ok(Exit::Done)
}
