//! What the aligner and the optimiser write down: their whole durable state.
//!
//! The state of both is a fold over these records and nothing else, so a process
//! that restarted and one that did not hold the same bits.

use crate::state::KeyframeState;
use serde::{Deserialize, Serialize};
use tessera_geometry::{Camera, InertialRotation, PoseBits};
use tessera_recognition::PlaceCode;
use tessera_surface::Effort;

/// Where a keyframe's surface lies in the keyframe store.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoreSlot {
    /// Byte offset of the first vertex.
    pub offset: u64,
    /// Length in bytes.
    pub len: u64,
    /// CRC-32 of those bytes.
    pub crc: u32,
}

/// Whether a frame's pose can be trusted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// Aligned to the map.
    #[default]
    Tracking,
    /// Not aligned: the row holds the prediction.
    Lost,
    /// Found again by place recognition, not yet confirmed.
    Relocalising,
}

/// The result for one frame: exactly one per processed frame index.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameRecord {
    /// Frame index as the source counts.
    pub index: u64,
    /// Sensor time.
    pub stamp_nanos: i64,
    /// How much work it got; less than full in live mode alone.
    pub effort: Effort,
    /// Whether the pose can be trusted.
    pub state: State,
    /// Why, in words and numbers; empty while tracking normally.
    pub reason: String,
    /// Pose as first published, in the map's frame.
    pub world_from_camera: PoseBits,
    /// What corrections change; `world_from_camera = world_from_odom * odom_from_camera`.
    pub world_from_odom: PoseBits,
    /// The keyframe that this frame hangs on.
    pub keyframe: u32,
    /// Pose relative to that keyframe.
    pub keyframe_from_camera: PoseBits,
    /// 6x6 covariance of `world_from_camera` (upper triangle, row by row, translation first), m
    /// and rad: of the tangent `d` in `world_from_camera * exp(d)`, thus along the camera's axes.
    /// The first frame is certain. Empty where the frame is lost.
    pub covariance: Vec<f64>,
    /// Correspondences in the last outer iteration.
    pub n_correspondences: u32,
    /// The frame's own motion per second in its camera frame, `rho phi`: the next prediction,
    /// and the rolling shutter of this frame.
    pub velocity: [f64; 6],
    /// What a gyroscope says of the camera's rotation since the source's first frame.
    pub rotation: Option<InertialRotation>,
    /// Entropy of the pose relative to the last keyframe, nats (SPEC 9.4); NaN where unknown.
    pub entropy_nats: f64,
    /// Matches with the keyframes of the window, so that the frame can be solved again; none where
    /// the map has a budget: the frame then hangs on its keyframe.
    pub blocks: Vec<BlockRecord>,
    /// Keyframes of the window that moved with this frame, because what was seen long ago
    /// contradicted what was seen just now (SPEC 7).
    pub moved: Vec<KeyframePose>,
    /// A keyframe made at this step: always the previous frame or, for the first frame, this one.
    pub new_keyframe: Option<KeyframeRecord>,
    /// An optimisation asked for at this step.
    pub request: Option<RequestRecord>,
}

/// All matches between a frame and one keyframe: the exact sufficient statistics (SPEC 5.4).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BlockRecord {
    /// The keyframe that was searched.
    pub keyframe: u32,
    /// The transform at which the matches were found.
    pub keyframe_from_camera: PoseBits,
    /// `Q`, `l` and `c`, 73 numbers.
    pub sums: Vec<f64>,
    /// Matches.
    pub n_matches: u32,
}

/// A keyframe, whose surface is in the store.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeyframeRecord {
    /// 0, 1, 2, … in the order of creation.
    pub id: u32,
    /// The frame it was.
    pub frame_index: u64,
    /// Its stamp.
    pub stamp_nanos: i64,
    /// Pose when it was made.
    pub world_from_camera: PoseBits,
    /// Its own motion per second in its camera frame, `rho phi`, for the rolling shutter.
    pub velocity: [f64; 6],
    /// Where its surface lies; filled in by whoever writes the store.
    pub slot: StoreSlot,
    /// Keyframes it shares an edge with (ids below its own), loops among them.
    pub edges: Vec<EdgeRecord>,
    /// What the place looks like, to recognise it.
    pub place: PlaceCode,
    /// Keyframes that leave the working map for it, because there are more than the budget.
    pub retires: Vec<RetiredRecord>,
}

/// A keyframe that nothing is aligned to any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RetiredRecord {
    /// The keyframe.
    pub keyframe: u32,
    /// The keyframe of the working map that it moves along with from now on.
    pub hangs_on: u32,
}

/// A connection between two keyframes, made when the newer one was aligned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EdgeRecord {
    /// The older keyframe.
    pub to: u32,
    /// Whether it closes a loop.
    pub is_loop: bool,
}

/// A request to optimise all keyframes made so far.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RequestRecord {
    /// 0, 1, 2, …
    pub request: u64,
    /// Keyframes `0..n_keyframes` take part.
    pub n_keyframes: u32,
    /// The correction takes effect before this frame index is aligned.
    pub effective_before: u64,
    /// The optimisation at the end of the run.
    pub is_final: bool,
}

/// One corrected keyframe.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeyframePose {
    /// Keyframe.
    pub id: u32,
    /// Its corrected pose.
    pub world_from_camera: PoseBits,
}

/// What became of a loop pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LoopVerdict {
    /// It takes part.
    Accepted,
    /// Too few queries have a match, in one of the directions.
    LittleOverlap,
    /// Points of one keyframe float in what the other saw to be empty.
    FreeSpaceViolated,
    /// Aligning the newer to the older and the older to the newer gives different answers.
    Inconsistent,
    /// The tests passed, but it contradicts the rest of the graph: the optimiser took its weight.
    Outvoted,
}

/// A pair of keyframes that would close a loop, and why it does or does not take part.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LoopRecord {
    /// The newer keyframe.
    pub newer: u32,
    /// The older keyframe.
    pub older: u32,
    /// Smaller share of queries with a match, of both directions.
    pub overlap: f64,
    /// Larger share of queries in view more than three standard deviations in front of what the
    /// other keyframe saw there, of both directions.
    pub in_front: f64,
    /// Root mean square disagreement between both directions, standard deviations of depth.
    pub inconsistency_sigmas: f64,
    /// Root mean square disagreement between the pair and the graph, standard deviations of depth.
    pub residual_sigmas: f64,
    /// Factor of the pair's cost at the end.
    pub weight: f64,
    /// Why.
    pub verdict: LoopVerdict,
}

/// The answer to a request.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Correction {
    /// Which request.
    pub request: u64,
    /// Hash of the input it was computed from.
    pub input_hash: u64,
    /// Corrected keyframes, by id.
    pub keyframes: Vec<KeyframePose>,
    /// Frames solved again against the optimised keyframes (final optimisation only).
    pub frames: Vec<(u64, PoseBits)>,
    /// Loop pairs with what their tests found and the weight that the optimiser left them.
    pub loops: Vec<LoopRecord>,
    /// Outer iterations done.
    pub outer_iterations: u32,
    /// Rounds of graduated non-convexity over all outer iterations; 0: every loop fitted at once.
    pub n_graduated_rounds: u32,
    /// The camera as a further unknown (final optimisation only, where the settings ask for it).
    pub refinement: Option<Refinement>,
}

/// What became of the camera when it was solved for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Refinement {
    /// Another camera fits the frames better.
    Refined(Box<RefinedCamera>),
    /// The frames determine none, and why: the run's camera stays.
    Kept(String),
}

/// A camera from the frames themselves, with the poses that go with it.
///
/// The map's own poses are those of [`Correction::keyframes`]: they fit the surfaces in the store,
/// which the run's camera made. These fit the surfaces as this camera would have made them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RefinedCamera {
    /// The camera.
    pub camera: Camera,
    /// How far the image moved from the run's camera to this one, root mean square pixels.
    pub moved_px: f64,
    /// Combinations of parameters that the motion does not determine: they keep the run's values.
    pub n_held: u32,
    /// Root mean square normal residual of keyframe pairs before and after, standard deviations
    /// of depth.
    pub residual_sigmas: [f64; 2],
    /// Every keyframe's pose, by id.
    pub keyframes: Vec<KeyframePose>,
    /// Frames solved again against those keyframes.
    pub frames: Vec<(u64, PoseBits)>,
}

/// A correction taking effect: the whole correction is copied into the aligner's own
/// journal, so that its state is a fold over one file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AppliedCorrection {
    /// First frame index aligned after it.
    pub before_frame: u64,
    /// What was applied.
    pub correction: Correction,
}

/// The map of an earlier run, in which a run starts: the first record of its journal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapRecord {
    /// All keyframes of the map as finally corrected, by id; slots are those of this run's store.
    pub keyframes: Vec<KeyframeState>,
    /// Where the camera stands in the map at the first frame, where somebody knows.
    pub start: Option<PoseBits>,
}

/// One record of the aligner's journal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum AlignRecord {
    /// A frame was aligned (or lost), with all that happened at this step.
    Frame(Box<FrameRecord>),
    /// A frame was skipped in live mode: index and reason.
    Skipped(u64, String),
    /// A correction took effect.
    Correction(Box<AppliedCorrection>),
    /// The source is exhausted after this many frames, and the final request.
    End {
        /// Frames in the source.
        n_frames: u64,
        /// The final optimisation, unless there is nothing to optimise.
        request: Option<RequestRecord>,
    },
    /// The run starts in this map. First of all records, or absent.
    Map(Box<MapRecord>),
}

/// One record of the optimiser's journal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum OptimiseRecord {
    /// A request was answered.
    Correction(Box<Correction>),
}
