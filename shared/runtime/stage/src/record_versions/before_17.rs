//! Records of version 16: a frame's evidence of noise had the mean residual of its surfaces where that of the two
//! halves of the image is now, and its causes were a sentence with three answers beside it.

use super::before_18::{AlignOf, Colour16, EvidenceOf};
use serde::{Deserialize, Serialize};
use tessera_journal::decode;
use tessera_slam::{AlignRecord, Cause, FrameRecord, MapChange, NoiseRecord, PoseRecord, State};
use tessera_surface::WorkloadLevel;

#[derive(Serialize, Deserialize)]
struct Frame16 {
    index: u64,
    stamp_nanos: i64,
    workload: WorkloadLevel,
    state: State,
    reason: String,
    causes: Causes16,
    submap: u32,
    lost_nanos: i64,
    evidence_nats: f64,
    pose: PoseRecord,
    evidence: EvidenceOf<Colour16, Noise16>,
    change: MapChange,
}

#[derive(Serialize, Deserialize)]
struct Causes16 {
    is_degenerate: bool,
    is_relocalisation_asked: bool,
    has_too_few_points: bool,
}

impl Causes16 {
    /// One cause, with the words of all; none of a frame without words.
    fn with(self, words: String) -> Vec<Cause> {
        if words.is_empty() {
            return Vec::new();
        }
        let Self { is_degenerate, is_relocalisation_asked, has_too_few_points } = self;
        vec![Cause::Recorded { words, is_degenerate, is_relocalisation_asked, has_too_few_points }]
    }
}

#[derive(Serialize, Deserialize)]
struct Noise16 {
    surface_residual: f64,
    squared: [f64; 2],
    redundancy: [f64; 2],
    step_variance: Option<[f64; 6]>,
}

/// Ratio of the surfaces' scale to the residual by which it was then begun.
const CORRELATION: f64 = 10.0;
/// Directions of a pose.
const DIRECTIONS: f64 = 6.0;

impl From<Noise16> for NoiseRecord {
    fn from(noise: Noise16) -> Self {
        let Noise16 { surface_residual, squared, redundancy, step_variance } = noise;
        let halves = [CORRELATION * surface_residual * DIRECTIONS, DIRECTIONS];
        Self { halves, squared, redundancy, variance_factor: [0.0; 2], step_variance }
    }
}

impl From<Frame16> for FrameRecord {
    fn from(frame: Frame16) -> Self {
        Self {
            index: frame.index,
            stamp_nanos: frame.stamp_nanos,
            workload: frame.workload,
            state: frame.state,
            causes: frame.causes.with(frame.reason),
            submap: frame.submap,
            lost_nanos: frame.lost_nanos,
            evidence_nats: frame.evidence_nats,
            pose: frame.pose,
            evidence: frame.evidence.into(),
            change: frame.change,
        }
    }
}

/// The aligner's record in a payload of that version.
pub(super) fn align(payload: &[u8]) -> Result<AlignRecord, String> {
    decode::<AlignOf<Frame16>>(payload).map(AlignRecord::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sentence_keeps_its_words_and_its_answers() {
        let frame = |is_degenerate, words: &str| {
            let causes = Causes16 { is_degenerate, is_relocalisation_asked: true, has_too_few_points: false };
            FrameRecord { causes: causes.with(words.into()), ..FrameRecord::default() }
        };
        let words = "a relocalisation was asked for; lost for 3 frames";
        let open = frame(true, words);
        assert_eq!(open.reason(), words);
        assert!(open.is_degenerate() && open.is_relocalisation_asked() && !open.has_too_few_points());
        assert!(!frame(false, words).is_degenerate());
        assert!(frame(false, "").causes.is_empty());
    }
}
