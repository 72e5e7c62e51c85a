//! `tessera ros2`, `tessera uplink` and `tessera base`: programs of their own, which take all arguments.

use crate::arguments::{Arguments, PassedOn};
use crate::companion::{Companion, FLEET, ROS2, become_program};
use crate::exit::{CommandError, Exit};
use clap::CommandFactory;

/// A run in a ROS 2 network.
pub(crate) fn ros2(arguments: &PassedOn) -> Result<Exit, CommandError> {
    pass_on(&ROS2, "ros2", &[], arguments)
}

/// Either end of a fleet: `name` is `uplink` or `base`.
pub(crate) fn fleet(name: &str, arguments: &PassedOn) -> Result<Exit, CommandError> {
    pass_on(&FLEET, name, &[name], arguments)
}

/// Becomes the program of the command `name`; comes back only where it cannot.
fn pass_on(program: &Companion, name: &str, first: &[&str], passed: &PassedOn) -> Result<Exit, CommandError> {
    let mut command = match program.command() {
        Ok(command) => command,
        Err(_) if passed.arguments.iter().any(|word| word == "--help") => {
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
    command.args(first).args(&passed.arguments);
    Err(become_program(command))
}
