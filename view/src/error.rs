//! What can go wrong, in words.

use std::path::PathBuf;

/// Why a run cannot be shown.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ViewError {
    /// No such run.
    #[error("no run {name:?}: expected the folder of a run, a name in runs/, or one that is going on")]
    NoRun {
        /// What was asked for.
        name: String,
    },
    /// A run that was to begin did not.
    #[error("the run of supervisor {pid} did not begin")]
    NotBegun {
        /// Its process id.
        pid: u32,
    },
    /// A file of the run.
    #[error("{}: {problem}", path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// Run file, configuration or keyframes.
    #[error(transparent)]
    Stage(#[from] tessera_stage::StageError),
    /// Settings.
    #[error(transparent)]
    Settings(#[from] tessera_settings::SettingsError),
    /// A journal or the store.
    #[error(transparent)]
    Journal(#[from] tessera_journal::JournalError),
    /// The registry of runs.
    #[error(transparent)]
    Transport(#[from] tessera_transport::TransportError),
    /// Rerun.
    #[error("Rerun: {0}")]
    Output(String),
    /// Signals.
    #[error("cannot listen for signals: {0}")]
    Signal(std::io::Error),
}

impl ViewError {
    /// Something that Rerun could not do.
    pub(crate) fn output(error: impl std::fmt::Display) -> Self {
        Self::Output(error.to_string())
    }

    /// Signals cannot be listened for.
    pub(crate) fn signal(error: std::io::Error) -> Self {
        Self::Signal(error)
    }

    /// As `tessera`: 2 for what was asked for, 4 for what failed.
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Self::NoRun { .. } | Self::Settings(_) => 2,
            _ => 4,
        }
    }
}
