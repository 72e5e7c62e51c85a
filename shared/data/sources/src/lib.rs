//! Opening a source of frames by its name: a folder in the TUM RGB-D layout, an MCAP recording or
//! a simulated world, all behind the trait [`Source`].
//!
//! To add a source, implement [`Source`] in a file of its own and add a case to [`SourceSpec`].
#![forbid(unsafe_code)]

mod folder;
mod skipped;
mod spec;

pub use folder::FolderSource;
pub use spec::{SourceOptions, SourceSpec, open};
pub use tessera_frames::*;
pub use tessera_recording::{LensFit, MessageError, RecordingError, RecordingOptions, RecordingSource};
pub use tessera_simulation::{SceneName, SimulatedSource, SimulationOptions};
