//! The service `save_map`: `tessera export` as a child writes the outputs of the run into its folder, then a
//! thread the grid as Nav2 reads it, while everything else goes on.

use crate::carrier::{Carrier, CarrierError, Client};
use crate::error::Ros2Error;
use crate::map::{MapOptions, save_grid};
use crate::poses::base::Base;
use crate::report::Report;
use crate::run::tessera;
use crate::services::trigger::{Response, Trigger};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::thread::JoinHandle;
use tessera_transport::RunEntry;

/// The service, and the export that goes on.
pub(crate) struct SaveMap {
    service: Trigger,
    export: Option<(Client, Export, PathBuf)>,
    grid: Option<(Client, SavedGrid, PathBuf)>,
    options: MapOptions,
}

/// The thread that writes a grid: how many cells it has, or why there is none.
type SavedGrid = JoinHandle<Result<usize, String>>;

/// A child, which is ended when it is dropped.
struct Export(Child);

impl Drop for Export {
    fn drop(&mut self) {
        // Both fail where it has ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl SaveMap {
    /// Announces the service.
    ///
    /// # Errors
    /// Where the network refuses it.
    pub(crate) fn new(
        carrier: &mut dyn Carrier,
        namespace: &str,
        options: MapOptions,
    ) -> Result<Self, CarrierError> {
        let service = Trigger::new(carrier, namespace, "save_map")?;
        Ok(Self { service, export: None, grid: None, options })
    }

    /// Takes requests in and answers those that are done. Requests are served one after the other, each
    /// with the map at that time. The grid is about the frame of the base, and there is none before that is
    /// known.
    ///
    /// # Errors
    /// Where a reply cannot be written as CDR.
    pub(crate) fn step(
        &mut self,
        entry: &RunEntry,
        base: Option<&Base>,
        report: &mut Report,
    ) -> Result<(), Ros2Error> {
        self.service.take(None, report)?;
        if let Some((client, export, dir)) = &mut self.export
            && let Some(response) = outcome(&mut export.0, dir)
        {
            let (client, dir) = (client.clone(), dir.clone());
            self.export = None;
            match base.filter(|_| response.success) {
                Some(base) => self.grid = Some((client, save_grid(entry, self.options, base), dir)),
                None => self.service.answer(&client, &response, report)?,
            }
        }
        if let Some((client, thread, dir)) = self.grid.take_if(|(_, thread, _)| thread.is_finished()) {
            let made = thread.join().unwrap_or_else(|_| Err("a panic".to_owned()));
            let message = match made {
                Ok(_) => dir.display().to_string(),
                Err(why) => format!("{}; no map.yaml: {why}", dir.display()),
            };
            self.service.answer(&client, &Response { success: true, message }, report)?;
        }
        if self.export.is_none()
            && self.grid.is_none()
            && let Some(client) = self.service.waiting.pop_front()
        {
            let mut command = tessera();
            let run_dir = &entry.run_dir;
            command.args(["export", "--quiet"]).arg(run_dir);
            command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
            match command.spawn() {
                Ok(child) => self.export = Some((client, Export(child), run_dir.to_owned())),
                Err(error) => {
                    let program = command.get_program().display();
                    let response = Response::refused(format!("cannot start {program}: {error}"));
                    self.service.answer(&client, &response, report)?;
                }
            }
        }
        Ok(())
    }
}

/// What came of an export; `None` while it goes on.
fn outcome(child: &mut Child, run_dir: &Path) -> Option<Response> {
    let status = match child.try_wait() {
        Ok(status) => status?,
        Err(error) => return Some(Response::refused(error.to_string())),
    };
    if status.success() {
        return Some(Response { success: true, message: run_dir.display().to_string() });
    }
    let mut words = String::new();
    if let Some(errors) = &mut child.stderr {
        // What cannot be read is no reason either.
        let _ = errors.read_to_string(&mut words);
    }
    let words = words.trim();
    let message =
        if words.is_empty() { format!("tessera export ended with {status}") } else { words.to_owned() };
    Some(Response::refused(message))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    fn outcome_of(script: &str) -> Response {
        let mut command = Command::new("sh");
        let mut child = command.args(["-c", script]).stderr(Stdio::piped()).spawn().unwrap();
        loop {
            if let Some(response) = outcome(&mut child, Path::new("/runs/desk")) {
                return response;
            }
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
    }

    #[test]
    fn the_answer_is_the_folder_or_the_error() {
        assert_eq!(outcome_of("exit 0"), Response { success: true, message: "/runs/desk".to_owned() });
        assert_eq!(outcome_of("echo no disk >&2; exit 4"), Response::refused("no disk".to_owned()));
        assert!(outcome_of("exit 3").message.contains("exit status: 3"));
    }
}
