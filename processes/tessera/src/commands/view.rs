//! `tessera view`: a run in Rerun, by a program of its own.

use crate::arguments::ViewArguments;
use crate::exit::{CommandError, Exit};
use crate::viewer;
use std::os::unix::process::CommandExt;
use std::process::Command;

/// Becomes the viewer's program; comes back only where it cannot.
pub(crate) fn view(arguments: &ViewArguments) -> Result<Exit, CommandError> {
    let mut command = Command::new(viewer::program()?);
    command.arg(&arguments.run);
    if let Some(file) = &arguments.save {
        command.arg("--save").arg(file);
    }
    if let Some(url) = &arguments.connect {
        command.arg("--connect").arg(url);
    }
    command.arg("--images-per-s").arg(arguments.images_per_s.to_string());
    command.arg("--memory").arg(&arguments.memory);
    let error = command.exec();
    Err(CommandError::stage(format!("cannot start {}: {error}", command.get_program().display())))
}
