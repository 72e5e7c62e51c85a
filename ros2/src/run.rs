//! The run that is joined.

use crate::error::Ros2Error;
use rustix::process::{Pid, Signal};
use std::ffi::OsString;
use std::process::{Child, Command};
use tessera_transport::{Guest, RunEntry, check_name, registered_runs};

/// A run that goes on.
pub(crate) struct Run {
    pub(crate) entry: RunEntry,
    pub(crate) guest: Guest,
}

impl Run {
    /// Joins the run of that name; `None` where there is none (yet).
    pub(crate) fn join(name: &str) -> Result<Option<Self>, Ros2Error> {
        check_name(name)?;
        let runs = registered_runs()?;
        let Some(run) = runs.into_iter().find(|run| run.is_alive && run.entry.name == name) else {
            return Ok(None);
        };
        let guest = Guest::open(&run.entry.identity, "ros2")?;
        Ok(Some(Self { entry: run.entry, guest }))
    }

    /// Whether it still goes on, and is not another one of the same name.
    pub(crate) fn is_current(&self) -> Result<bool, Ros2Error> {
        let runs = registered_runs()?;
        Ok(runs.iter().any(|run| run.is_alive && run.entry.identity == self.entry.identity))
    }
}

/// The command: the program that started this one, or that beside it or on `PATH`.
pub(crate) fn tessera() -> Command {
    Command::new(std::env::var_os("TESSERA_PROGRAM").unwrap_or_else(|| {
        let beside = std::env::current_exe().unwrap_or_default().with_file_name("tessera");
        if beside.is_file() { beside.into_os_string() } else { OsString::from("tessera") }
    }))
}

/// `tessera run external` as a child: dropped, it is told to end, and writes its outputs.
pub(crate) struct Started(Child);

impl Started {
    /// Starts it.
    pub(crate) fn start(name: &str, arguments: &[String]) -> Result<Self, Ros2Error> {
        let mut command = tessera();
        let started = command.args(["run", "external", "--name", name]).args(arguments).spawn();
        let program = command.get_program().display();
        Ok(Self(started.map_err(|error| Ros2Error::Run(format!("cannot start {program}: {error}")))?))
    }

    /// Whether it has ended.
    ///
    /// # Errors
    /// Where it failed.
    pub(crate) fn has_ended(&mut self) -> Result<bool, Ros2Error> {
        match self.0.try_wait() {
            Ok(None) => Ok(false),
            Ok(Some(status)) => judge(status),
            Err(error) => Err(Ros2Error::Run(error.to_string())),
        }
    }

    /// Waits for its end; where it `is_unwanted`, tells it to end.
    ///
    /// # Errors
    /// Where it failed.
    pub(crate) fn finish(mut self, is_unwanted: bool) -> Result<(), Ros2Error> {
        if is_unwanted {
            self.terminate();
        }
        let status = self.0.wait().map_err(|error| Ros2Error::Run(error.to_string()))?;
        judge(status).map(|_| ())
    }

    fn terminate(&self) {
        // Fails where it has ended.
        let _ = rustix::process::kill_process(Pid::from_child(&self.0), Signal::TERM);
    }
}

impl Drop for Started {
    fn drop(&mut self) {
        if let Ok(None) = self.0.try_wait() {
            self.terminate();
            let _ = self.0.wait();
        }
    }
}

fn judge(status: std::process::ExitStatus) -> Result<bool, Ros2Error> {
    // 130: interrupted, with its outputs written.
    if status.success() || status.code() == Some(130) {
        return Ok(true);
    }
    Err(Ros2Error::Run(format!("it ended with {status}")))
}
