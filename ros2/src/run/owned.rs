//! The run that this program itself began: it is ended in order, and taken over by the successor of a
//! program that died.

use crate::error::Ros2Error;
use crate::run::cut_off::cut_off;
use crate::run::{GUEST, tessera};
use rustix::process::{Pid, Signal};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus};
use std::time::{Duration, Instant};
use tessera_stage::{RunFile, RunFiles};
use tessera_transport::{RunEntry, check_name, living_nodes, living_runs};

/// Variable by which a run's supervisor says which program began it.
const OWNER: &str = "TESSERA_ROS2_RUN";
/// Before the user's own arguments of `tessera run`: a bag that is paused or a driver that is started later
/// is no reason to end, for this program ends the run.
const PATIENT: [&str; 2] = ["--set", "run.camera_timeout_s=3600"];
/// Time that a run has to end after its camera did: its last optimisation and its outputs.
const MOST_TO_END: Duration = Duration::from_secs(300);
/// Time that a program which was killed may take to be gone.
const MOST_TO_DIE: Duration = Duration::from_secs(3);
/// Time between two looks whether it has.
const END_POLL: Duration = Duration::from_millis(50);

/// The supervisor of a run.
enum RunProcess {
    /// A child.
    Child(Child),
    /// That of a run which this program began before it died and was started again.
    Taken(RunEntry),
}

/// `tessera run external` of this program's own: dropped, it is told to end, and writes its outputs.
pub(crate) struct Started {
    supervisor: RunProcess,
    pub(crate) name: String,
    resumed: Option<PathBuf>,
    /// When its camera ended.
    ended_at: Option<Instant>,
}

impl Started {
    /// Takes over the run that a program of this name began, or a reset of it made, before it died; goes on
    /// with the one that was cut off with this machine; else starts it.
    ///
    /// # Errors
    /// Where another program carries it, or it cannot be started.
    pub(crate) fn begin(name: &str, arguments: &[String]) -> Result<Self, Ros2Error> {
        check_name(name)?;
        let own = living_runs()?.into_iter().filter(|entry| is_of(entry.pid, name));
        let Some(entry) = own.max_by_key(|entry| number_of(&entry.name)) else {
            return match cut_off(name, arguments) {
                Some(folder) => Self::resume(&folder, name),
                None => Self::start(name, arguments, name),
            };
        };
        let began = Instant::now();
        while let Some(other) = living_nodes(&entry.identity)?.iter().find(|node| node.name == GUEST) {
            if began.elapsed() > MOST_TO_DIE {
                return Err(Ros2Error::Run(format!(
                    "process {} carries the run {} already: end it, or give another name",
                    other.pid, entry.name
                )));
            }
            std::thread::sleep(END_POLL);
        }
        let name = entry.name.clone();
        Ok(Self { name, supervisor: RunProcess::Taken(entry), resumed: None, ended_at: None })
    }

    /// Starts it for the program of the name `of`.
    ///
    /// # Errors
    /// Where it cannot be started.
    pub(crate) fn start(name: &str, arguments: &[String], of: &str) -> Result<Self, Ros2Error> {
        let mut command = tessera();
        command.args(["run", "external", "--name", name]).args(PATIENT).args(arguments);
        let supervisor = RunProcess::Child(spawn(command, of)?);
        Ok(Self { supervisor, name: name.to_owned(), resumed: None, ended_at: None })
    }

    /// Goes on with the run of a folder, by its own settings.
    fn resume(folder: &Path, of: &str) -> Result<Self, Ros2Error> {
        let run = RunFile::read(&RunFiles::new(folder)).map_err(|error| Ros2Error::Run(error.to_string()))?;
        let mut command = tessera();
        command.arg("resume").arg(folder);
        let supervisor = RunProcess::Child(spawn(command, of)?);
        Ok(Self { supervisor, name: run.name, resumed: Some(folder.to_owned()), ended_at: None })
    }

    /// The folder of the run, where it was cut off and goes on.
    pub(crate) fn resumed(&self) -> Option<&Path> {
        self.resumed.as_deref()
    }

    /// Whether it went on already.
    pub(crate) fn is_taken(&self) -> bool {
        matches!(self.supervisor, RunProcess::Taken(_))
    }

    /// Notes that the run was told that its camera has ended; where it was not, tells the run itself, which
    /// then leaves out its last optimisation.
    pub(crate) fn begin_end(&mut self, is_told: bool) {
        self.ended_at = Some(Instant::now());
        if !is_told {
            self.terminate();
        }
    }

    /// Whether its end has begun.
    pub(crate) fn is_ending(&self) -> bool {
        self.ended_at.is_some()
    }

    /// Whether it has ended; it is told again where it does not.
    ///
    /// # Errors
    /// Where it failed.
    pub(crate) fn has_ended(&mut self) -> Result<bool, Ros2Error> {
        if self.ended_at.is_some_and(|at| at.elapsed() > MOST_TO_END) {
            self.ended_at = Some(Instant::now());
            self.terminate();
        }
        match &mut self.supervisor {
            RunProcess::Child(child) => match child.try_wait() {
                Ok(None) => Ok(false),
                Ok(Some(status)) => judge(status),
                Err(error) => Err(Ros2Error::Run(error.to_string())),
            },
            RunProcess::Taken(entry) => Ok(!entry.is_alive()?),
        }
    }

    /// Waits for its end.
    ///
    /// # Errors
    /// Where it failed.
    pub(crate) fn finish(mut self) -> Result<(), Ros2Error> {
        while !self.has_ended()? {
            std::thread::sleep(END_POLL);
        }
        Ok(())
    }

    /// Tells it to end: it writes its outputs first.
    fn terminate(&self) {
        let pid = match &self.supervisor {
            RunProcess::Child(child) => Some(Pid::from_child(child)),
            RunProcess::Taken(entry) => i32::try_from(entry.pid).ok().and_then(Pid::from_raw),
        };
        // Fails where it has ended.
        let _ = pid.map(|pid| rustix::process::kill_process(pid, Signal::TERM));
    }
}

impl Drop for Started {
    fn drop(&mut self) {
        // The successor of a program that panicked takes the run over.
        if std::thread::panicking() {
            return;
        }
        if let Ok(false) = self.has_ended() {
            self.terminate();
            while let Ok(false) = self.has_ended() {
                std::thread::sleep(END_POLL);
            }
        }
    }
}

/// Starts a supervisor for the program of the name `of`.
fn spawn(mut command: Command, of: &str) -> Result<Child, Ros2Error> {
    // A group of its own: Ctrl-C reaches this program alone, which ends the run in order.
    command.process_group(0).env(OWNER, of);
    let started = command.spawn();
    let program = command.get_program().display();
    started.map_err(|error| Ros2Error::Run(format!("cannot start {program}: {error}")))
}

fn judge(status: ExitStatus) -> Result<bool, Ros2Error> {
    // 130: interrupted, with its outputs written.
    if status.success() || status.code() == Some(130) {
        return Ok(true);
    }
    Err(Ros2Error::Run(format!("it ended with {status}")))
}

/// Whether the supervisor with that process id was started by a program of that name: resets give its runs
/// names of their own.
fn is_of(pid: u32, name: &str) -> bool {
    let environment = std::fs::read(format!("/proc/{pid}/environ")).unwrap_or_default();
    let owner = format!("{OWNER}={name}");
    environment.split(|byte| *byte == 0).any(|pair| pair == owner.as_bytes())
}

/// The number that a reset gave a run behind its name; 0 where none did.
fn number_of(name: &str) -> u64 {
    name.rsplit_once('-').and_then(|(_, number)| number.parse().ok()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_belongs_to_the_name_that_its_supervisor_was_started_for() {
        let mut child = Command::new("sleep").arg("60").env(OWNER, "desk").spawn().unwrap();
        let began = Instant::now();
        while !is_of(child.id(), "desk") && began.elapsed() < Duration::from_secs(60) {
            std::thread::sleep(END_POLL);
        }
        assert!(is_of(child.id(), "desk"));
        assert!(!is_of(child.id(), "des") && !is_of(child.id(), "desk-2"));
        assert!(!is_of(std::process::id(), "desk"));
        child.kill().unwrap();
        child.wait().unwrap();
        assert_eq!(["desk", "desk-2", "desk-11"].map(number_of), [0, 2, 11]);
    }
}
