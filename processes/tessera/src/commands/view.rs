//! `tessera view`: a run in Rerun, by a program of its own.

use crate::arguments::ViewArguments;
use crate::companion::{VIEWER, become_program};
use crate::exit::{CommandError, Exit};

/// Becomes the viewer's program; comes back only where it cannot.
pub(crate) fn view(arguments: &ViewArguments) -> Result<Exit, CommandError> {
    let mut command = VIEWER.command()?;
    command.arg(&arguments.run);
    if let Some(file) = &arguments.save {
        command.arg("--save").arg(file);
    }
    if let Some(url) = &arguments.connect {
        command.arg("--connect").arg(url);
    }
    command.arg("--images-per-s").arg(arguments.images_per_s.to_string());
    command.arg("--memory").arg(&arguments.memory);
    Err(become_program(command))
}
