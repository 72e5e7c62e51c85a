//! Tracking, keyframes, loop closure and optimisation; their state as a fold over records.
//!
//! [`Tracker`] aligns one frame at a time against a local window of fixed poses and decides on
//! keyframes and loops; [`Optimiser`] solves for all keyframes at once. Both are folds over
//! [`records`](AlignRecord) plus a pure step, so that a process that restarted and one that did
//! not hold the same bits. Holz and Behnke 2015, III-F to III-H.
#![forbid(unsafe_code)]

mod evidence;
mod features;
mod loops;
mod map;
mod optimise;
mod settings;
mod tracking;

pub use evidence::same_place::{PlaceEvidence, PlaceProbe};
pub use features::colour_model::{ColourModel, ColourPoseRecord, ColourRecord, ColourState, UNTRUSTED};
pub use features::seen_focal::{FocalView, seen_focal_ratio};
pub use loops::appearance::{Ferns, N_FERNS, PlaceCode, similarity};
pub use loops::covisibility::pairs as neighbour_pairs;
pub use loops::meeting::Meeting;
pub use map::cameras::{SessionCamera, SessionCameras};
pub use map::context::Context;
pub use map::given_up::GivenUp;
pub use map::joint::JointMap;
pub use map::joint_cache::JointCache;
pub use map::pose_history::{FramePose, PoseHistory};
pub use map::records::{
    AlignRecord, AppliedCorrection, BlockRecord, ContradictionRecord, Correction, EdgeRecord, FrameCauses,
    FrameRecord, JoinRecord, KeyframePose, KeyframeRecord, KeyframeState, LoopRecord, LoopVerdict, MapRecord,
    OptimiseRecord, RefinedCamera, Refinement, RequestRecord, RetiredRecord, SightingRecord, SkippedFrames,
    SplitRecord, State, StoreSlot,
};
pub use map::state::TrackerState;
pub use map::submaps::{Origin, Submaps};
pub use map::surfaces::KeyframeSurfaces;
pub use optimise::optimiser::{Optimiser, OptimiserState};
pub use optimise::refine::FrameHistory;
pub use settings::{
    FeatureUse, GlobalSettings, KeyframeSettings, LoopSettings, MappingSettings, RelocaliseSettings,
    SubmapSettings, WindowSettings,
};
pub use tracking::input::FrameSurface;
pub use tracking::noise_scales::{NoiseRecord, NoiseScales, NoiseState};
pub use tracking::tracker::Tracker;
