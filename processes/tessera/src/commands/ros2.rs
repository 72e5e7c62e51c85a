//! `tessera ros2`: a run in a ROS 2 network, by a program of its own.

use crate::arguments::{Arguments, Ros2Arguments};
use crate::companion::{ROS2, become_program};
use crate::exit::{CommandError, Exit};
use clap::CommandFactory;

/// Becomes the program; comes back only where it cannot.
pub(crate) fn ros2(arguments: &Ros2Arguments) -> Result<Exit, CommandError> {
    let mut command = match ROS2.command() {
        Ok(command) => command,
        Err(_) if arguments.arguments.iter().any(|word| word == "--help") => {
            // What is known without the program.
            if let Some(this) = Arguments::command().find_subcommand_mut("ros2") {
                let _ = this.print_help();
            }
            return Ok(Exit::Done);
        }
        Err(error) => return Err(error),
    };
    if let Ok(this) = std::env::current_exe() {
        command.env("TESSERA_PROGRAM", this);
    }
    command.args(&arguments.arguments);
    Err(become_program(command))
}
