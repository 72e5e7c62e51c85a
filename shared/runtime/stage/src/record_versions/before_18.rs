//! Records of version 17: a frame's evidence of noise had no variance factor of its features, and its audit of colour
//! measured a disagreement.

use super::before_20::Map19;
use serde::{Deserialize, Serialize};
use tessera_journal::decode;
use tessera_slam::{
    AlignRecord, AppliedCorrection, BlockRecord, Cause, ColourPoseRecord, ColourRecord, EvidenceRecord,
    FrameRecord, MapChange, NoiseRecord, PoseRecord, RequestRecord, SkippedFrames, State,
};
use tessera_surface::WorkloadLevel;

/// The aligner's record of versions 16 to 19, with the frames `F` of one of them.
#[derive(Serialize, Deserialize)]
pub(super) enum AlignOf<F> {
    Frame(Box<F>),
    Skipped(SkippedFrames),
    Correction(Box<AppliedCorrection>),
    End { n_frames: u64, request: Option<RequestRecord> },
    Map(Box<Map19>),
}

/// A frame of versions 17 to 19, with the evidence `E` of one of them.
#[derive(Serialize, Deserialize)]
pub(super) struct FrameOf<E> {
    index: u64,
    stamp_nanos: i64,
    workload: WorkloadLevel,
    state: State,
    causes: Vec<Cause>,
    submap: u32,
    lost_nanos: i64,
    evidence_nats: f64,
    pose: PoseRecord,
    evidence: E,
    change: MapChange,
}

/// A frame's evidence of versions 16 to 18, with the audit of colour `C` and the noise record `N` of one of them.
#[derive(Serialize, Deserialize)]
pub(super) struct EvidenceOf<C, N> {
    repeats_colour: bool,
    colour: Option<C>,
    noise: Option<N>,
    colour_pose: Option<ColourPoseRecord>,
    blocks: Vec<BlockRecord>,
}

#[derive(Serialize, Deserialize)]
struct Noise17 {
    halves: [f64; 2],
    squared: [f64; 2],
    redundancy: [f64; 2],
    step_variance: Option<[f64; 6]>,
}

/// The audit of a frame's colour of versions 16 and 17.
#[derive(Serialize, Deserialize)]
pub(super) struct Colour16 {
    n_pairs: u32,
    residual_px: f64,
    disagreement: f64,
}

impl From<Colour16> for ColourRecord {
    fn from(colour: Colour16) -> Self {
        let Colour16 { n_pairs, residual_px, disagreement } = colour;
        // 0.85 was the limit; 0.3 was usual of a camera's own colour, 1.3 of another time's.
        Self { n_pairs, residual_px, nats: -4.0 * (disagreement / 0.85).max(0.01).ln() }
    }
}

impl From<Noise17> for NoiseRecord {
    fn from(noise: Noise17) -> Self {
        let Noise17 { halves, squared, redundancy, step_variance } = noise;
        // Its features were not divided by any.
        Self { halves, squared, redundancy, variance_factor: [0.0; 2], step_variance }
    }
}

impl<C, N> From<EvidenceOf<C, N>> for EvidenceRecord
where
    ColourRecord: From<C>,
    NoiseRecord: From<N>,
{
    fn from(evidence: EvidenceOf<C, N>) -> Self {
        let EvidenceOf { repeats_colour, colour, noise, colour_pose, blocks } = evidence;
        let (colour, noise) = (colour.map(ColourRecord::from), noise.map(NoiseRecord::from));
        Self { repeats_colour, colour, noise, colour_pose, readout: None, up: None, blocks }
    }
}

impl<E> From<FrameOf<E>> for FrameRecord
where
    EvidenceRecord: From<E>,
{
    fn from(frame: FrameOf<E>) -> Self {
        Self {
            index: frame.index,
            stamp_nanos: frame.stamp_nanos,
            workload: frame.workload,
            state: frame.state,
            causes: frame.causes,
            submap: frame.submap,
            lost_nanos: frame.lost_nanos,
            evidence_nats: frame.evidence_nats,
            pose: frame.pose,
            evidence: frame.evidence.into(),
            change: frame.change,
        }
    }
}

impl<F> From<AlignOf<F>> for AlignRecord
where
    FrameRecord: From<F>,
{
    fn from(record: AlignOf<F>) -> Self {
        match record {
            AlignOf::Frame(frame) => Self::Frame(Box::new((*frame).into())),
            AlignOf::Skipped(skipped) => Self::Skipped(skipped),
            AlignOf::Correction(correction) => Self::Correction(correction),
            AlignOf::End { n_frames, request } => Self::End { n_frames, request },
            AlignOf::Map(map) => Self::Map(Box::new((*map).into())),
        }
    }
}

/// The aligner's record in a payload of that version.
pub(super) fn align(payload: &[u8]) -> Result<AlignRecord, String> {
    decode::<AlignOf<FrameOf<EvidenceOf<Colour16, Noise17>>>>(payload).map(AlignRecord::from)
}
