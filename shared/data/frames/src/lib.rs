//! Sources of frames: the trait, for all who read frames and all who provide them.
//!
//! Everything stands behind one trait, [`Source`]: frames are numbered from 0, each can be read
//! again at any time and by several threads at once, and reading an index twice gives the same
//! bytes. That is what lets a restarted sensor go on where its predecessor died.
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

mod along_ray;
pub mod camera_forms;
pub mod cameras;
mod check;
mod check_words;
mod colour_camera;
pub mod colour_offset;
pub mod decode;
mod depth_units;
mod error;
pub mod imu;
pub mod judge;
pub mod large;
mod lens;
mod odd_camera;
mod odd_depth;
pub mod pairing;
mod sent_window;
mod source;
pub mod timeline;
mod warp;

pub use along_ray::{Bent, RayLengths};
pub use cameras::{CAMERA_NAMES, CameraFile, load_camera, named_camera};
pub use check::{CheckReport, Gaps, check};
pub use colour_camera::ColourCamera;
pub use depth_units::{
    DepthSummary, DepthUnitsError, doubt_units, refuse_impossible_depth, summarise_depth, summarise_image,
};
pub use error::{ImageError, ListError, SourceError};
pub use imu::ImuModel;
pub use lens::{OtherLens, StatedLens, Undistortion};
pub use odd_camera::odd_camera;
pub use odd_depth::OddDepth;
pub use sent_window::SentWindow;
pub use source::{FrameBuffers, FrameInfo, Pairing, Source, TakenColour};
pub use warp::ColourWarp;
