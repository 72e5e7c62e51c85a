//! What can go wrong, in words.

use std::path::{Path, PathBuf};

/// Why an uplink or a base cannot do its work.
#[derive(Debug, thiserror::Error)]
pub enum FleetError {
    /// Options or configuration.
    #[error("{0}")]
    Arguments(String),
    /// An input that cannot be used.
    #[error("{0}")]
    Input(String),
    /// The operating system refused.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// What was tried.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// The network.
    #[error("network: {0}")]
    Network(String),
    /// A process that was to go on.
    #[error("{0} ended by itself")]
    Ended(String),
    /// Copies or maps that are not what they were to be.
    #[error("promise broken: {0}")]
    Broken(String),
    /// All time is over.
    #[error("waited in vain for {0}")]
    Late(String),
    /// Ctrl-C.
    #[error("interrupted")]
    Interrupted,
    /// A failure that left something to look at.
    #[error("{error}; everything is kept in {}", folder.display())]
    Kept {
        /// The failure.
        error: Box<FleetError>,
        /// Where.
        folder: PathBuf,
    },
    /// A journal or a store.
    #[error(transparent)]
    Journal(#[from] tessera_journal::JournalError),
    /// A file of a run.
    #[error(transparent)]
    Run(#[from] tessera_stage::StageError),
    /// Something that JSON cannot hold.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// An output.
    #[error(transparent)]
    Output(#[from] tessera_outputs::ToolError),
}

impl FleetError {
    /// With where to look.
    pub(crate) fn kept(self, folder: &Path) -> Self {
        Self::Kept { error: Box::new(self), folder: folder.into() }
    }

    /// A refusal of the system.
    pub fn io<'p>(action: &'static str, path: &'p Path) -> impl FnOnce(std::io::Error) -> Self + use<'p> {
        move |source| Self::Io { action, path: path.into(), source }
    }

    /// Exit code, as that of `tessera`.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Arguments(_) => 2,
            Self::Input(_) => 3,
            Self::Interrupted => 130,
            Self::Kept { error, .. } => error.exit_code(),
            _ => 4,
        }
    }
}
