//! Why a run ends in an error.

use std::path::{Path, PathBuf};
use tessera_journal::JournalError;
use tessera_messages::Stage;
use tessera_stage::StageError;
use tessera_transport::TransportError;

/// A stage that ended in an error, with what is known of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StageFailure {
    /// Which stage.
    pub stage: Stage,
    /// How it ended, for instance `exit status 4` or `signal 11 (SIGSEGV)`.
    pub status: String,
    /// Its exit code, where it had one.
    pub exit_code: Option<i32>,
    /// The frame (or request) it had in hand.
    pub index: u64,
    /// Deaths on that frame.
    pub n_deaths: u32,
    /// The last lines of its log, oldest first.
    pub last_lines: Vec<String>,
}

impl std::fmt::Display for StageFailure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { stage, status, index, n_deaths, last_lines, .. } = self;
        match n_deaths {
            0 | 1 => write!(f, "{stage} ended with {status}")?,
            n => write!(f, "{stage} ended with {status}, {n} times at frame {index}")?,
        }
        if last_lines.is_empty() {
            return write!(f, " and left nothing in the log");
        }
        write!(f, "; its last lines of log:")?;
        last_lines.iter().try_for_each(|line| write!(f, "\n  {line}"))
    }
}

/// A run cannot be started or kept up.
#[derive(Debug, thiserror::Error)]
pub enum SupervisorError {
    /// The run directory holds a run already.
    #[error("{} holds a run already; give another --name or --out, or go on with it: tessera resume {name}", dir.display())]
    RunExists {
        /// The run directory.
        dir: PathBuf,
        /// Name of the run.
        name: String,
    },
    /// Another run writes into the folder.
    #[error("another run goes on in {}; give another --out", dir.display())]
    FolderInUse {
        /// The run directory.
        dir: PathBuf,
    },
    /// The run directory cannot be written, or read.
    #[error("cannot {action} {}: {reason}", path.display())]
    Directory {
        /// What was tried.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
    /// A file of the run has lost what the run recorded; nothing was changed.
    #[error(
        "{error}{}; what comes before it stays: tessera resume {} --drop-damaged goes on from there and \
         keeps a copy of the file beside it{}",
        frames_text(*.next_frame), run.display(), again_text(*.is_live)
    )]
    Damaged {
        /// The file, where it is damaged, and what would be lost.
        error: Box<JournalError>,
        /// Folder of the run.
        run: PathBuf,
        /// The first frame that would be lost, where that is known.
        next_frame: Option<u64>,
        /// The frames do not come again.
        is_live: bool,
    },
    /// Too few files may be open.
    #[error(
        "a process may have {allowed} files open here, a run needs {needed}; raise the limit (ulimit -n)"
    )]
    OpenFiles {
        /// What the system allows.
        allowed: u64,
        /// What is needed.
        needed: u64,
    },
    /// The map to start in cannot be used.
    #[error("--map {}: {reason}", dir.display())]
    Map {
        /// Folder of the earlier run.
        dir: PathBuf,
        /// Why not.
        reason: String,
    },
    /// A run directory without a run.json holds records of an unknown run.
    #[error("{} holds records of a run but no run.json; give another --out", dir.display())]
    Leftover {
        /// The run directory.
        dir: PathBuf,
    },
    /// Shared memory, or the name of the run.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// A file of the run directory.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// A process cannot be started.
    #[error("cannot start {what}: {reason}")]
    Spawn {
        /// Which process.
        what: String,
        /// Why not.
        reason: String,
    },
}

fn frames_text(next_frame: Option<u64>) -> String {
    next_frame.map_or_else(String::new, |next| format!(", frames from {next} on"))
}

fn again_text(is_live: bool) -> &'static str {
    if is_live { " (these frames do not come again)" } else { " (the recording's frames are computed again)" }
}

/// An error about a file of the run directory.
pub(crate) fn directory(
    action: &'static str,
    path: &Path,
    reason: &dyn std::fmt::Display,
) -> SupervisorError {
    SupervisorError::Directory { action, path: path.into(), reason: reason.to_string() }
}
