//! What can go wrong, in words.

use crate::carrier::CarrierError;

/// Why a run cannot be joined to a network.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Ros2Error {
    /// Options, or variables of the environment.
    #[error("{0}")]
    Arguments(String),
    /// The network.
    #[error(transparent)]
    Carrier(#[from] CarrierError),
    /// Topics that cannot be chosen, or a camera that cannot be used.
    #[error(transparent)]
    Camera(#[from] tessera_recording::RecordingError),
    /// A camera file.
    #[error(transparent)]
    Source(#[from] tessera_frames::SourceError),
    /// The run's shared memory.
    #[error(transparent)]
    Transport(#[from] tessera_transport::TransportError),
    /// A message that CDR cannot hold.
    #[error(transparent)]
    Message(#[from] tessera_recording::MessageError),
    /// `--run` could not start it, or it failed.
    #[error("the run: {0}")]
    Run(String),
    /// Its files.
    #[error("the run: {0}")]
    Files(#[from] tessera_outputs::ToolError),
    /// Signals.
    #[error("cannot listen for signals: {0}")]
    Signal(std::io::Error),
}

impl Ros2Error {
    /// As `tessera`: 2 for what was asked for, 3 for unusable input, 4 for what failed.
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Self::Arguments(_) => 2,
            Self::Camera(_) | Self::Source(_) => 3,
            _ => 4,
        }
    }
}
