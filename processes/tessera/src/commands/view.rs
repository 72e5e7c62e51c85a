//! `tessera view`: a run in Rerun, by a program of its own, or its report in a browser; a base's page.

use crate::arguments::ViewArguments;
use crate::companion::{FLEET, VIEWER, become_program};
use crate::exit::{CommandError, Exit};
use crate::run_folder;
use crate::terminal::say;
use tessera_report::{PageServer, RunPage};

/// Becomes the viewer's program, or the server of the page; comes back only where it cannot.
pub(crate) fn view(arguments: &ViewArguments) -> Result<Exit, CommandError> {
    if let Some(base) = run_folder::base(&arguments.run) {
        let mut command = FLEET.command()?;
        command.arg("base").arg(base).arg("view");
        return Err(become_program(command));
    }
    if arguments.web {
        let page = RunPage { run_folder: run_folder::find(&arguments.run)? };
        let server = PageServer::open()?;
        say(&format!("{} shows the run to browsers on this machine; Ctrl-C ends this", server.url()?));
        return Err(server.serve(&page).into());
    }
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
