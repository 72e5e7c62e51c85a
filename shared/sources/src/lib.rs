//! Where frames come from: folders in the TUM RGB-D layout, MCAP recordings and simulated rooms.
//!
//! Everything stands behind one trait, [`Source`]: frames are numbered from 0, each can be read
//! again at any time and by several threads at once, and reading an index twice gives the same
//! bytes. That is what lets a restarted sensor go on where its predecessor died.
//!
//! To add a source, implement [`Source`] in a file of its own and add a case to [`SourceSpec`].
#![forbid(unsafe_code)]

mod cameras;
mod check;
mod decode;
mod error;
mod folder;
mod imu;
mod pairing;
mod recording;
mod simulation;
mod skipped;
mod source;
mod spec;

pub use cameras::{CAMERA_NAMES, load_camera, named_camera};
pub use check::{
    CheckReport, DepthSummary, DepthUnitsError, Gaps, check, refuse_impossible_depth, summarise_depth,
    summarise_image,
};
pub use error::{ImageError, ListError, SourceError};
pub use folder::FolderSource;
pub use imu::Gyroscope;
pub use recording::{LensFit, MessageError, RecordingError, RecordingSource};
pub use simulation::{SceneName, SimulatedSource, SimulationOptions};
pub use source::{FrameBuffers, FrameInfo, Pairing, Source};
pub use spec::{SourceOptions, SourceSpec, open};
