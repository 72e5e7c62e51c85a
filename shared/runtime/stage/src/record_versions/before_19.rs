//! Records of version 18: a frame had no evidence of the readout.

use super::before_18::{AlignOf, EvidenceOf, FrameOf};
use tessera_journal::decode;
use tessera_slam::{AlignRecord, ColourRecord, NoiseRecord};

/// The aligner's record in a payload of that version.
pub(super) fn align(payload: &[u8]) -> Result<AlignRecord, String> {
    decode::<AlignOf<FrameOf<EvidenceOf<ColourRecord, NoiseRecord>>>>(payload).map(AlignRecord::from)
}
