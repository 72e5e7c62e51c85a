//! `tessera ros2`: a run in a ROS 2 network, by a program of its own.

use crate::arguments::Ros2Arguments;
use crate::companion::{ROS2, become_program};
use crate::exit::{CommandError, Exit};

/// Becomes the program; comes back only where it cannot.
pub(crate) fn ros2(arguments: &Ros2Arguments) -> Result<Exit, CommandError> {
    let mut command = ROS2.command()?;
    if let Ok(this) = std::env::current_exe() {
        command.env("TESSERA_PROGRAM", this);
    }
    command.args(&arguments.arguments);
    Err(become_program(command))
}
