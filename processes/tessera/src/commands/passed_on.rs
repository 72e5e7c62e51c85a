//! `tessera ros2`, `uplink`, `base` and `chaos --fleet`: programs of their own, which take all arguments.

use crate::arguments::Arguments;
use crate::companion::{FLEET, ROS2, become_program};
use crate::exit::{CommandError, Exit};
use clap::CommandFactory;
use std::ffi::OsString;

/// Becomes the program of the command `name`; comes back only where it cannot.
pub(crate) fn pass_on(name: &str, passed: &[OsString]) -> Result<Exit, CommandError> {
    // The one of a fleet is several commands.
    let (program, first) = if name == "ros2" { (&ROS2, None) } else { (&FLEET, Some(name)) };
    let mut command = match program.command() {
        Ok(command) => command,
        Err(_) if passed.iter().any(|word| word == "--help") => {
            // What is known without the program.
            if let Some(this) = Arguments::command().find_subcommand_mut(name) {
                let _ = this.print_help();
            }
            return Ok(Exit::Done);
        }
        Err(error) => return Err(error),
    };
    if let Ok(this) = std::env::current_exe() {
        command.env("TESSERA_PROGRAM", this);
    }
    command.args(first).args(passed);
    Err(become_program(command))
}
