//! Errors of the tools that read run directories and write files for users.

use std::path::{Path, PathBuf};
use tessera_evaluation::{EvaluationError, ReadError};
use tessera_journal::JournalError;
use tessera_settings::SettingsError;
use tessera_sources::SourceError;
use tessera_stage::StageError;
use tessera_transport::TransportError;

/// Why a tool could not do its work.
#[derive(Debug, thiserror::Error)]
pub enum ToolError {
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
    /// Shared memory or the registry of runs.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// A file of the run directory.
    #[error(transparent)]
    RunFile(#[from] StageError),
    /// A journal or a store.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// Anything else that is not the user's doing.
    #[error("{0}")]
    Stage(String),
}

impl ToolError {
    /// A failure to write `path`.
    pub fn write(path: &Path, error: impl std::fmt::Display) -> Self {
        Self::Write { path: path.to_owned(), reason: error.to_string() }
    }
}
