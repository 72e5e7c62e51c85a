//! Messages between the processes: plain data with a versioned wire name, and the checks
//! that a receiver makes before it believes a word of it.
//!
//! Nothing here knows iceoryx2. A layout change means a new version in [`Message::NAME`]: two
//! processes that disagree then fail to open the service instead of misreading each other.
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

mod beat;
mod camera;
mod flow;
mod frame;
mod message;
mod pose;
mod rotation;
mod stage;
mod stage_times;
mod stored_surface;
mod surface;
mod surface_payload;
mod time_counts;

pub use beat::{Beat, BeatState, Latency, WaitingOn};
pub use camera::{CameraFlow, CameraFrame};
pub use flow::Flow;
pub use frame::{FrameHeader, FramePayload, FrameShape, Kind};
pub use message::{Element, MOST_LEFT_OUT, Message, Refusal, StepTimes};
pub use pose::{POSE_STATES, PoseMessage, pack_reason};
pub use rotation::{RotationBits, UpBits};
pub use stage::Stage;
pub use stage_times::{Phase, StageTimes, TIME_ROWS, TimeRow};
pub use stored_surface::{
    POSITION_STEP_PX, StoredSurfaceError, load_features, load_first, load_surface, max_stored_bytes,
    places_under, store_surface,
};
pub use surface::{SurfaceExpectation, SurfaceHeader};
pub use surface_payload::{MAX_FEATURES, read_features, vertices_of_features, write_features};
pub use time_counts::TimeCounts;
