//! The record of one frame: where it is, what it measured, and what changes in the map with it.

use crate::estimation::colour_model::{CameraEvidence, ColourPoseRecord, ColourRecord};
use crate::estimation::noise_scales::NoiseRecord;
use crate::estimation::readout::ReadoutRecord;
use crate::map::cause::{Cause, words};
use crate::map::keyframe::{KeyframePose, KeyframeRecord};
use crate::map::records::{
    BlockRecord, ContradictionRecord, JoinRecord, RequestRecord, SightingRecord, SplitRecord,
};
use crate::map::single;
use serde::{Deserialize, Serialize};
use tessera_geometry::{InertialRotation, PoseBits, UpDirection};
use tessera_surface::WorkloadLevel;

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
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameRecord {
    /// Frame index as the source counts.
    pub index: u64,
    /// Sensor time.
    pub stamp_nanos: i64,
    /// How much work it got; less than full in live mode alone.
    pub workload: WorkloadLevel,
    /// Whether the pose can be trusted.
    pub state: State,
    /// Why; none while tracking normally.
    pub causes: Vec<Cause>,
    /// The submap in whose gauge the poses are; where it is a new one, it begins with this frame.
    pub submap: u32,
    /// Time for which the camera has been lost with usable frames, nanoseconds.
    pub lost_nanos: i64,
    /// Sum of the evidence for a place that was found and is not yet certain, nats; 0 otherwise (method 12.7).
    pub evidence_nats: f64,
    /// Pose and motion of the camera.
    pub pose: PoseRecord,
    /// Measurements of the frame.
    pub evidence: EvidenceRecord,
    /// Changes of the map.
    pub change: MapChange,
}

impl FrameRecord {
    /// Whether the frame was tracked with a direction that its surfaces do not determine: the pose along
    /// it is the prediction.
    pub fn is_degenerate(&self) -> bool {
        self.state == State::Tracking && self.causes.iter().any(Cause::is_degenerate)
    }

    /// Whether relocalisation was asked for with the frame.
    pub fn is_relocalisation_asked(&self) -> bool {
        self.causes.iter().any(Cause::is_relocalisation_asked)
    }

    /// Whether the frame has too few points to be aligned.
    pub fn has_too_few_points(&self) -> bool {
        self.causes.iter().any(Cause::has_too_few_points)
    }

    /// Its causes in words and numbers; empty while tracking normally.
    pub fn reason(&self) -> String {
        words::joined(&self.causes)
    }
}

/// Pose and motion of the camera at a frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseRecord {
    /// Pose as first published, in the map's frame.
    pub world_from_camera: PoseBits,
    /// What corrections change; `world_from_camera = world_from_odom * odom_from_camera`.
    pub world_from_odom: PoseBits,
    /// Reference keyframe of this frame: the newest one when it was recorded.
    pub keyframe: u32,
    /// Pose relative to that keyframe.
    pub keyframe_from_camera: PoseBits,
    /// 6x6 covariance of `world_from_camera` (upper triangle, row by row, translation first), m
    /// and rad: of the tangent `d` in `world_from_camera * exp(d)`, thus along the camera's axes.
    /// The first frame is certain. Empty where the frame is lost. Numbers of single precision.
    #[serde(with = "single")]
    pub covariance: Vec<f64>,
    /// Correspondences in the last outer iteration.
    pub n_correspondences: u32,
    /// The frame's own motion per second in its camera frame, `rho phi`: the next prediction,
    /// and the rolling shutter of this frame.
    pub velocity: [f64; 6],
    /// The camera's rotation since the source's first frame, where a gyroscope measured it.
    pub rotation: Option<InertialRotation>,
    /// Entropy of the pose relative to the last keyframe, nats (method 9.4); NaN where unknown.
    pub entropy_nats: f64,
}

impl Default for PoseRecord {
    /// The origin of the map, at rest, and nothing known of it.
    fn default() -> Self {
        Self {
            world_from_camera: PoseBits::IDENTITY,
            world_from_odom: PoseBits::IDENTITY,
            keyframe: 0,
            keyframe_from_camera: PoseBits::IDENTITY,
            covariance: Vec::new(),
            n_correspondences: 0,
            velocity: [0.0; 6],
            rotation: None,
            entropy_nats: f64::NAN,
        }
    }
}

/// A frame's measurements: of its pose, of the noise, and of colour.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EvidenceRecord {
    /// Its colour image is that of the frame before: no measurement.
    pub repeats_colour: bool,
    /// Audit of colour by its features; none where too few match.
    pub colour: Option<ColourRecord>,
    /// Evidence of the noise scales; none where it was not aligned.
    pub noise: Option<NoiseRecord>,
    /// Evidence of the colour model, where it makes a keyframe.
    pub colour_pose: Option<ColourPoseRecord>,
    /// Evidence of the readout, where it makes a keyframe.
    pub readout: Option<ReadoutRecord>,
    /// The direction against gravity, where an accelerometer measured it.
    pub up: Option<UpDirection>,
    /// Matches with the keyframes of the window, so that the frame can be solved again.
    pub blocks: Vec<BlockRecord>,
}

impl EvidenceRecord {
    /// What it tells of the camera.
    pub fn of_camera(&self) -> CameraEvidence<'_> {
        (self.colour.as_ref(), self.colour_pose.as_ref(), self.readout.as_ref())
    }
}

/// Changes of the map with a frame, and the tests under way that may change it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapChange {
    /// The newest keyframes, which were solved for together with the one that this frame makes (method 7).
    pub moved: Vec<KeyframePose>,
    /// A place of another submap that the camera is thought to see.
    pub sighting: Option<SightingRecord>,
    /// Submaps that are joined behind this frame.
    pub join: Option<JoinRecord>,
    /// A join that would be due, and that what both submaps saw contradicts.
    pub refused: Option<JoinRecord>,
    /// Keyframes of long ago that are not seen where the map has them, so far.
    pub contradiction: Option<ContradictionRecord>,
    /// Keyframes that are not of the submap that they were made in: it was left unnoticed.
    pub split: Option<SplitRecord>,
    /// A keyframe made at this step: always the previous frame or, for the first frame of a submap, this
    /// one.
    pub new_keyframe: Option<KeyframeRecord>,
    /// An optimisation asked for at this step.
    pub request: Option<RequestRecord>,
}
