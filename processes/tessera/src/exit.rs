//! Exit codes, and the errors that lead to them.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use tessera_settings::SettingsError;
use tessera_trajectory::{EvaluationError, ReadError};

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
    /// A stage, or the supervisor itself, failed.
    #[error("{0}")]
    Stage(String),
}

impl CommandError {
    /// The exit code that tells it to scripts.
    pub(crate) fn exit(&self) -> Exit {
        match self {
            Self::Settings(_) | Self::Arguments(_) => Exit::Arguments,
            Self::Trajectory(_) | Self::Evaluation { .. } | Self::Input(_) => Exit::Input,
            Self::Write { .. } | Self::Stage(_) => Exit::Stage,
        }
    }

    /// A failure to write `path`.
    pub(crate) fn write(path: &Path, error: impl std::fmt::Display) -> Self {
        Self::Write { path: path.to_owned(), reason: error.to_string() }
    }
}
