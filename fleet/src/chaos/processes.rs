//! Uplinks and bases as processes of their own, which die with the one that started them.

use crate::error::FleetError;
use std::fs::{File, OpenOptions};
use std::net::{Ipv4Addr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Between two looks.
const LOOK: Duration = Duration::from_millis(20);
/// Names the process with which an uplink or a base ends, whatever becomes of it.
pub const ENDS_WITH: &str = "TESSERA_FLEET_ENDS_WITH";

/// A process that ends with this value.
pub struct FleetProcess(pub Child);

impl Drop for FleetProcess {
    fn drop(&mut self) {
        self.kill();
    }
}

impl FleetProcess {
    /// kill -9.
    pub fn kill(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }

    /// Whether it has ended, and how: a success or not.
    pub fn ended(&mut self) -> Option<bool> {
        self.0.try_wait().map_or(Some(false), |status| status.map(|status| status.success()))
    }
}

/// A program of the fleet and where it says what is wrong.
#[derive(Clone, Debug)]
pub struct Starter {
    /// `tessera-fleet`.
    pub program: PathBuf,
    /// Takes what its processes say on their standard error; `None`: it goes where this one's goes.
    pub log: Option<PathBuf>,
    /// Whether its bases copy whole runs.
    pub is_whole: bool,
}

impl Starter {
    /// The program with these arguments, its words thrown away.
    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(&self.program);
        command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null());
        command.env(ENDS_WITH, std::process::id().to_string());
        command
    }

    /// Starts it.
    ///
    /// # Errors
    /// Where it cannot be started.
    pub fn start(&self, arguments: &[&str]) -> Result<FleetProcess, FleetError> {
        let mut command = self.command(arguments);
        if let Some(log) = &self.log {
            command.stderr(appending(log)?);
        }
        command.spawn().map(FleetProcess).map_err(FleetError::io("start", &self.program))
    }

    /// An uplink of a robot to a port of this machine.
    ///
    /// # Errors
    /// Where it cannot be started.
    pub fn uplink(&self, run: &Path, robot: &str, port: u16) -> Result<FleetProcess, FleetError> {
        let (run, to) = (run.display().to_string(), format!("tcp/127.0.0.1:{port}"));
        self.start(&["uplink", &run, "--to", &to, "--robot", robot, "--quiet"])
    }

    /// A base on a port of this machine, which ends once so many runs have ended and their map is made.
    ///
    /// # Errors
    /// Where it cannot be started.
    pub fn base(&self, folder: &Path, port: u16, n_runs: usize) -> Result<FleetProcess, FleetError> {
        let (folder, listen) = (folder.display().to_string(), format!("tcp/127.0.0.1:{port}"));
        let n_runs = n_runs.to_string();
        let mut arguments = vec!["base", &folder, "--listen", &listen, "--runs", &n_runs];
        arguments.extend(["--map-every", "1", "--quiet"]);
        if self.is_whole {
            arguments.push("--whole");
        }
        self.start(&arguments)
    }
}

/// A file that grows by what a process says.
pub(super) fn appending(path: &Path) -> Result<File, FleetError> {
    OpenOptions::new().create(true).append(true).open(path).map_err(FleetError::io("write", path))
}

/// Sees to it that this process ends with the one that [`ENDS_WITH`] names, where it is there.
pub fn end_with_parent() {
    let named = std::env::var(ENDS_WITH).ok().and_then(|pid| pid.parse::<i32>().ok());
    let Some(pid) = named else { return };
    let _ = rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::KILL));
    // It may have ended before.
    if rustix::process::getppid().map(|parent| parent.as_raw_nonzero().get()) != Some(pid) {
        std::process::exit(4);
    }
}

/// A port of this machine that nothing listens on now.
///
/// # Errors
/// Where there is none.
pub fn free_port() -> Result<u16, FleetError> {
    TcpListener::bind((Ipv4Addr::LOCALHOST, 0))
        .and_then(|listener| listener.local_addr())
        .map(|address| address.port())
        .map_err(|error| FleetError::Network(format!("no port: {error}")))
}

/// How long something is waited for, and what ends the waiting.
#[derive(Clone, Copy, Debug)]
pub struct Patience<'a> {
    /// When it ends.
    pub until: Instant,
    /// Set on Ctrl-C.
    pub stop: &'a AtomicBool,
}

impl Patience<'_> {
    /// Waits until something holds.
    ///
    /// # Errors
    /// Where it does not come to hold in time.
    pub fn wait_for(&self, what: &str, mut holds: impl FnMut() -> bool) -> Result<(), FleetError> {
        while !holds() {
            if self.stop.load(Ordering::Relaxed) {
                return Err(FleetError::Interrupted);
            }
            if Instant::now() >= self.until {
                return Err(FleetError::Late(what.into()));
            }
            std::thread::sleep(LOOK);
        }
        Ok(())
    }

    /// Waits for so long.
    ///
    /// # Errors
    /// Where it is interrupted, or all time is over.
    pub fn sleep(&self, time: Duration) -> Result<(), FleetError> {
        let end = Instant::now() + time;
        self.wait_for("the next fault", || {
            std::thread::sleep(end.saturating_duration_since(Instant::now()).min(LOOK));
            Instant::now() >= end
        })
    }
}
