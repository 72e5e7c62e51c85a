//! Exit codes, and the errors that lead to them.

use crate::supervisor::SupervisorError;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use tessera_journal::JournalError;
use tessera_settings::SettingsError;
use tessera_sources::SourceError;
use tessera_stage::StageError;
use tessera_trajectory::{EvaluationError, ReadError};
use tessera_transport::TransportError;

/// How the command ended; documented in the README and in `tessera --help`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exit {
    /// All was done.
    Done = 0,
    /// Wrong arguments or configuration.
    Arguments = 2,
    /// Unusable input.
    Input = 3,
    /// A stage failed.
    Stage = 4,
    /// The camera was never found in the map that the run started in.
    NotInMap = 5,
    /// Ended by Ctrl-C or SIGTERM.
    Interrupted = 130,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

/// Why a command could not do its work.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CommandError {
    /// The settings were refused.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// An argument cannot be used.
    #[error("{0}")]
    Arguments(String),
    /// A trajectory file cannot be used.
    #[error(transparent)]
    Trajectory(#[from] ReadError),
    /// Two trajectories cannot be compared.
    #[error("{estimate} against {groundtruth}: {source}")]
    Evaluation {
        /// The estimate's file.
        estimate: String,
        /// The ground truth's file.
        groundtruth: String,
        /// Why.
        source: EvaluationError,
    },
    /// Some other input cannot be used.
    #[error("{0}")]
    Input(String),
    /// A file or folder cannot be written.
    #[error("{}: cannot write: {reason}", path.display())]
    Write {
        /// What was to be written.
        path: PathBuf,
        /// The system's words.
        reason: String,
    },
    /// The source cannot be used.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// The run could not be started or kept up.
    #[error(transparent)]
    Supervisor(#[from] SupervisorError),
    /// Shared memory or the registry of runs.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// A file of the run directory.
    #[error(transparent)]
    RunFile(#[from] StageError),
    /// A journal or a store.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// A stage failed; what it said decides on the exit code.
    #[error("{message}")]
    Failed {
        /// The exit code.
        exit: Exit,
        /// Which stage, how, and its last lines of log.
        message: String,
    },
    /// Anything else that is not the user's doing.
    #[error("{0}")]
    Stage(String),
}

impl CommandError {
    /// The exit code that tells it to scripts.
    pub(crate) fn exit(&self) -> Exit {
        match self {
            Self::Settings(_) | Self::Arguments(_) => Exit::Arguments,
            Self::Trajectory(_) | Self::Evaluation { .. } | Self::Input(_) => Exit::Input,
            Self::Source(_) | Self::Journal(_) => Exit::Input,
            Self::Supervisor(error) => of_supervisor(error),
            Self::Transport(error) => of_transport(error),
            Self::RunFile(error) => of_stage(error),
            Self::Failed { exit, .. } => *exit,
            Self::Write { .. } | Self::Stage(_) => Exit::Stage,
        }
    }

    /// A failure to write `path`.
    pub(crate) fn write(path: &Path, error: impl std::fmt::Display) -> Self {
        Self::Write { path: path.to_owned(), reason: error.to_string() }
    }
}

fn of_supervisor(error: &SupervisorError) -> Exit {
    match error {
        // A name or folder that cannot be used was given by somebody.
        SupervisorError::RunExists { .. }
        | SupervisorError::Leftover { .. }
        | SupervisorError::Map { .. }
        | SupervisorError::Directory { .. } => Exit::Arguments,
        SupervisorError::Transport(error) => of_transport(error),
        SupervisorError::Stage(error) => of_stage(error),
        SupervisorError::OpenFiles { .. } => Exit::Arguments,
        SupervisorError::Spawn { .. } => Exit::Stage,
    }
}

fn of_transport(error: &TransportError) -> Exit {
    match error {
        TransportError::Name { .. } | TransportError::NameInUse { .. } | TransportError::Space { .. } => {
            Exit::Arguments
        }
        _ => Exit::Stage,
    }
}

fn of_stage(error: &StageError) -> Exit {
    match error.exit_code() {
        2 => Exit::Arguments,
        3 => Exit::Input,
        _ => Exit::Stage,
    }
}
