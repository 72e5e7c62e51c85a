//! Records of version 16: a frame's evidence of noise had the mean residual of its surfaces where that of the two
//! halves of the image is now.

use serde::{Deserialize, Serialize};
use tessera_journal::decode;
use tessera_slam::{
    AlignRecord, AppliedCorrection, BlockRecord, ColourPoseRecord, ColourRecord, EvidenceRecord, FrameCauses,
    FrameRecord, MapChange, MapRecord, NoiseRecord, PoseRecord, RequestRecord, SkippedFrames, State,
};
use tessera_surface::WorkloadLevel;

#[derive(Serialize, Deserialize)]
enum Align {
    Frame(Box<Frame>),
    Skipped(SkippedFrames),
    Correction(Box<AppliedCorrection>),
    End { n_frames: u64, request: Option<RequestRecord> },
    Map(Box<MapRecord>),
}

#[derive(Serialize, Deserialize)]
struct Frame {
    index: u64,
    stamp_nanos: i64,
    workload: WorkloadLevel,
    state: State,
    reason: String,
    causes: FrameCauses,
    submap: u32,
    lost_nanos: i64,
    evidence_nats: f64,
    pose: PoseRecord,
    evidence: Evidence,
    change: MapChange,
}

#[derive(Serialize, Deserialize)]
struct Evidence {
    repeats_colour: bool,
    colour: Option<ColourRecord>,
    noise: Option<Noise>,
    colour_pose: Option<ColourPoseRecord>,
    blocks: Vec<BlockRecord>,
}

#[derive(Serialize, Deserialize)]
struct Noise {
    surface_residual: f64,
    squared: [f64; 2],
    redundancy: [f64; 2],
    step_variance: Option<[f64; 6]>,
}

/// Ratio of the surfaces' scale to the residual by which it was then begun.
const CORRELATION: f64 = 10.0;
/// Directions of a pose.
const DIRECTIONS: f64 = 6.0;

impl From<Noise> for NoiseRecord {
    fn from(noise: Noise) -> Self {
        let Noise { surface_residual, squared, redundancy, step_variance } = noise;
        let halves = [CORRELATION * surface_residual * DIRECTIONS, DIRECTIONS];
        Self { halves, squared, redundancy, step_variance }
    }
}

impl From<Evidence> for EvidenceRecord {
    fn from(evidence: Evidence) -> Self {
        let Evidence { repeats_colour, colour, noise, colour_pose, blocks } = evidence;
        Self { repeats_colour, colour, noise: noise.map(NoiseRecord::from), colour_pose, blocks }
    }
}

impl From<Frame> for FrameRecord {
    fn from(frame: Frame) -> Self {
        let Frame {
            index,
            stamp_nanos,
            workload,
            state,
            reason,
            causes,
            submap,
            lost_nanos,
            evidence_nats,
            pose,
            evidence,
            change,
        } = frame;
        let evidence = evidence.into();
        Self {
            index,
            stamp_nanos,
            workload,
            state,
            reason,
            causes,
            submap,
            lost_nanos,
            evidence_nats,
            pose,
            evidence,
            change,
        }
    }
}

/// The aligner's record in a payload of that version.
pub(super) fn align(payload: &[u8]) -> Result<AlignRecord, String> {
    Ok(match decode(payload)? {
        Align::Frame(frame) => AlignRecord::Frame(Box::new((*frame).into())),
        Align::Skipped(skipped) => AlignRecord::Skipped(skipped),
        Align::Correction(correction) => AlignRecord::Correction(correction),
        Align::End { n_frames, request } => AlignRecord::End { n_frames, request },
        Align::Map(map) => AlignRecord::Map(map),
    })
}
