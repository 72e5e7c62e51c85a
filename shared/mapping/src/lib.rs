//! Keyframes, local windows, loops, and the tracker's state as a fold over its records.
//!
//! [`Tracker`] aligns one frame at a time against a local window of fixed poses and decides on
//! keyframes and loops; [`Optimiser`] solves for all keyframes at once. Both are folds over
//! [`records`](AlignRecord) plus a pure step, so that a process which restarted and one which did
//! not hold the same bits. Holz and Behnke 2015, III-F to III-H.
#![forbid(unsafe_code)]

mod alignment;
mod attempt;
mod budget;
mod context;
mod covariance;
mod degeneracy;
mod drawn;
mod effort;
mod extended;
mod frame_record;
mod gaps;
mod global;
mod judge;
mod keyframes;
mod loops;
mod neighbours;
mod optimiser;
mod orient;
mod parts;
mod promotion;
mod recognised;
mod records;
mod refine;
mod refine_camera;
mod relocalise;
mod robust;
mod settings;
mod state;
mod stride;
mod tracker;
mod trees;
mod verify;
mod window;

pub use context::Context;
pub use neighbours::pairs as neighbour_pairs;
pub use optimiser::{Optimiser, OptimiserState};
pub use records::{
    AlignRecord, AppliedCorrection, BlockRecord, Correction, EdgeRecord, FrameRecord, KeyframePose,
    KeyframeRecord, LoopRecord, LoopVerdict, MapRecord, OptimiseRecord, RefinedCamera, Refinement,
    RequestRecord, RetiredRecord, State, StoreSlot,
};
pub use refine::FrameHistory;
pub use settings::{
    GlobalSettings, KeyframeSettings, LoopSettings, MappingSettings, RelocaliseSettings, WindowSettings,
};
pub use state::{KeyframeState, TrackerState};
pub use tracker::{FrameSurface, KeyframeSurfaces, Tracker};
