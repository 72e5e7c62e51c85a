//! Why a stage ends before its work is done.

use std::path::PathBuf;
use tessera_journal::JournalError;
use tessera_transport::TransportError;

/// A stage cannot go on. The supervisor decides by [`Self::exit_code`] whether trying again helps.
#[derive(Debug, thiserror::Error)]
pub enum StageError {
    /// A file of the run directory cannot be used.
    #[error("{path}: {problem}")]
    RunFile {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// The run was started by another version of the program.
    #[error("this is Tessera {own}, the run was started by Tessera {run}; use one version for all processes")]
    Version {
        /// Version of this program.
        own: String,
        /// Version of the run.
        run: String,
    },
    /// Settings that cannot be used.
    #[error("{0}")]
    Settings(String),
    /// A frame or the whole source cannot be used.
    #[error("{0}")]
    Input(String),
    /// Shared memory.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// The journal or the store.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// The journal says what cannot be.
    #[error("{0}")]
    Inconsistent(String),
}

impl StageError {
    /// Exit code of a process whose disk did not take what was written.
    pub const NOT_SYNCED: u8 = 74;

    /// Exit code of the process: 2 settings, 3 input or a damaged file of the run, [`Self::NOT_SYNCED`]
    /// (trying again is useless for all of them), 4 else.
    pub fn exit_code(&self) -> u8 {
        match self {
            StageError::Settings(_) | StageError::Version { .. } | StageError::RunFile { .. } => 2,
            StageError::Input(_)
            | StageError::Journal(JournalError::Absent { .. } | JournalError::Damaged { .. }) => 3,
            StageError::Journal(JournalError::NotSynced { .. }) => Self::NOT_SYNCED,
            StageError::Transport(_) | StageError::Journal(_) | StageError::Inconsistent(_) => 4,
        }
    }
}
