//! Opening a source of frames by its name: a folder of images in one of several layouts, an MCAP
//! recording, a bag of ROS or a simulated world, all behind the trait [`Source`].
//!
//! To add a layout of folders, see `folder/layouts/mod.rs`. To add another source, implement
//! [`Source`] in a file of its own and add a case to [`open`].
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::indexing_slicing,
        clippy::cast_possible_truncation,
        clippy::arithmetic_side_effects
    )
)]

mod bag;
mod folder;
mod joined;
mod klg;
mod partial;
mod sens;
mod spec;
mod stored;
mod unread;

pub use folder::FolderSource;
pub use spec::{COLOUR_NONE, SourceOptions, SourceSpec, open};
pub use tessera_frames::*;
pub use tessera_recording::{MessageError, RecordingError, RecordingOptions, RecordingSource};
pub use tessera_simulation::{DepthSensor, SceneName, SimulatedSource, SimulationOptions};
