//! Keyframes, local windows, loops, and the tracker's state as a fold over its records.
#![forbid(unsafe_code)]

mod optimiser;
mod records;
mod tracker;

pub use optimiser::Optimiser;
pub use records::{
    AlignRecord, AppliedCorrection, Correction, EdgeRecord, FrameRecord, KeyframePose, KeyframeRecord,
    OptimiseRecord, RequestRecord, State, StoreSlot,
};
pub use tracker::{FrameSurface, KeyframeSurfaces, Tracker};
