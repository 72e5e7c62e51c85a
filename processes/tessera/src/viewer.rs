//! The program that shows a run in Rerun, as it writes a file while the run goes on.

use crate::companion::VIEWER;
use crate::exit::CommandError;
use crate::terminal::say_error;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

const PROGRAM: &str = VIEWER.program;
/// How long it may take to write the rest after the run has ended.
const PATIENCE: Duration = Duration::from_secs(60);

/// The program writing a run into a file while it goes on. It only reads; whatever becomes of it,
/// the run does not notice.
#[derive(Debug)]
pub(crate) struct Recording {
    child: Child,
    file: PathBuf,
}

impl Recording {
    /// Starts it; it waits for the run that this process is about to supervise.
    ///
    /// # Errors
    /// Where the program is not there, or the file's folder is not.
    pub(crate) fn start(file: &Path) -> Result<Self, CommandError> {
        let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if !folder.is_dir() || file.is_dir() {
            return Err(CommandError::arguments(format!(
                "--rerun {}: expected a file in a folder that is there",
                file.display()
            )));
        }
        let mut command = VIEWER.command()?;
        command.arg("--of-supervisor").arg(std::process::id().to_string()).arg("--save").arg(file);
        let child = command.stdin(Stdio::null()).stdout(Stdio::null()).spawn();
        let child = child.map_err(|error| CommandError::stage(format!("cannot start {PROGRAM}: {error}")))?;
        Ok(Self { child, file: file.to_owned() })
    }

    /// Waits until everything is written; says where it is not.
    pub(crate) fn finish(mut self) {
        let deadline = Instant::now() + PATIENCE;
        let ended = loop {
            match self.child.try_wait() {
                Ok(Some(status)) if status.success() => return,
                Ok(Some(status)) => break status.to_string(),
                Ok(None) if Instant::now() < deadline => std::thread::sleep(Duration::from_millis(10)),
                Ok(None) => break format!("it was not done after {} s", PATIENCE.as_secs()),
                Err(error) => break error.to_string(),
            }
        };
        say_error(&format!("{} is not whole: {PROGRAM}: {ended}", self.file.display()));
    }
}

impl Drop for Recording {
    fn drop(&mut self) {
        // Of no use without its run; both fail where it has ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
