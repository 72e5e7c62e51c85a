//! Tracking, keyframes, loop closure and optimisation; their state as a fold over records.
//!
//! [`Tracker`] aligns one frame at a time against a local window of fixed poses and decides on
//! keyframes and loops; [`Optimiser`] solves for all keyframes at once. Both are folds over
//! [`records`](AlignRecord) plus a pure step, so that a process that restarted and one that did
//! not hold the same bits. Holz and Behnke 2015, III-F to III-H.
#![forbid(unsafe_code)]

mod estimation;
mod evidence;
mod map;
mod merging;
mod optimise;
mod pairs;
mod settings;
mod step;
mod submaps;
mod tracker;
mod tracking;

pub use estimation::colour_model::{
    CameraEvidence, ColourModel, ColourPoseRecord, ColourRecord, ColourState,
};
pub use estimation::noise_scales::{NoiseRecord, NoiseScales, NoiseState};
pub use estimation::readout::ReadoutRecord;
pub use evidence::same_place::{PlaceEvidence, PlaceProbe};
pub use map::appearance::{Ferns, N_FERNS, PlaceCode, similarity};
pub use map::cameras::{SessionCamera, SessionCameras};
pub use map::cause::{CandidatePlace, Cause, DegenerateMotion, Levelling, MotionKind, ReferenceFit};
pub use map::context::Context;
pub use map::given_up::GivenUp;
pub use map::pose_history::{FramePose, PoseHistory};
pub use map::records::{
    AlignRecord, AppliedCorrection, BlockRecord, ContradictionRecord, Correction, EdgeRecord, EvidenceRecord,
    FrameRecord, JoinRecord, KeyframePose, KeyframeRecord, KeyframeState, LoopRecord, LoopVerdict, MapChange,
    MapRecord, MatchPose, MatchRecord, OptimiseRecord, PairChanges, PoseRecord, RefinedCamera, Refinement,
    RequestRecord, RetiredRecord, SightingRecord, SkippedFrames, SplitRecord, State, StoreSlot,
};
pub use map::state::TrackerState;
pub use map::submaps::{Origin, Submaps};
pub use map::surfaces::KeyframeSurfaces;
pub use merging::joint::JointMap;
pub use merging::joint_cache::JointCache;
pub use merging::meeting::Meeting;
pub use optimise::optimiser::{Optimiser, OptimiserState};
pub use optimise::refine::FrameHistory;
pub use pairs::covisibility::pairs as neighbour_pairs;
pub use pairs::seen_focal::{FocalView, seen_focal_ratio};
pub use settings::{
    FeatureUse, GlobalSettings, KeyframeSettings, LoopSettings, MappingSettings, RelocaliseSettings,
    SubmapSettings, WindowSettings, WorldUp,
};
pub use tracker::Tracker;
pub use tracking::input::FrameSurface;
