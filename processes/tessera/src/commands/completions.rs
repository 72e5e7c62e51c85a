//! `tessera completions`.

use crate::arguments::Arguments;
use crate::exit::{CommandError, Exit};
use crate::terminal::say;
use clap::CommandFactory;
use clap_complete::Shell;

/// Prints the completion script of a shell.
pub(crate) fn completions(shell: Shell) -> Result<Exit, CommandError> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Arguments::command(), "tessera", &mut script);
    say(&String::from_utf8_lossy(&script));
    Ok(Exit::Done)
}
