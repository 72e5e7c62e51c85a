//! Records of version 19: neither frames nor the keyframes of a map had a direction of gravity.

use super::before_18::{AlignOf, FrameOf};
use serde::{Deserialize, Serialize};
use tessera_geometry::PoseBits;
use tessera_journal::decode;
use tessera_slam::{
    AlignRecord, BlockRecord, ColourPoseRecord, ColourRecord, EdgeRecord, EvidenceRecord, KeyframeState,
    MapRecord, NoiseRecord, PlaceCode, ReadoutRecord, StoreSlot, Submaps,
};

/// The map of an earlier run in versions 16 to 19.
#[derive(Serialize, Deserialize)]
pub(super) struct Map19 {
    keyframes: Vec<Keyframe19>,
    submaps: Submaps,
    start: Option<PoseBits>,
}

#[derive(Serialize, Deserialize)]
struct Keyframe19 {
    id: u32,
    session: u32,
    submap: u32,
    frame_index: u64,
    stamp_nanos: i64,
    world_from_camera: PoseBits,
    velocity: [f64; 6],
    slot: StoreSlot,
    edges: Vec<EdgeRecord>,
    covariance: Vec<f64>,
    place: PlaceCode,
    alike: Vec<u32>,
    anchored_to: Option<u32>,
}

#[derive(Serialize, Deserialize)]
struct Evidence19 {
    repeats_colour: bool,
    colour: Option<ColourRecord>,
    noise: Option<NoiseRecord>,
    colour_pose: Option<ColourPoseRecord>,
    readout: Option<ReadoutRecord>,
    blocks: Vec<BlockRecord>,
}

impl From<Map19> for MapRecord {
    fn from(map: Map19) -> Self {
        let Map19 { keyframes, submaps, start } = map;
        Self { keyframes: keyframes.into_iter().map(KeyframeState::from).collect(), submaps, start }
    }
}

impl From<Keyframe19> for KeyframeState {
    fn from(keyframe: Keyframe19) -> Self {
        Self {
            id: keyframe.id,
            session: keyframe.session,
            submap: keyframe.submap,
            frame_index: keyframe.frame_index,
            stamp_nanos: keyframe.stamp_nanos,
            world_from_camera: keyframe.world_from_camera,
            velocity: keyframe.velocity,
            slot: keyframe.slot,
            edges: keyframe.edges,
            covariance: keyframe.covariance,
            up: None,
            place: keyframe.place,
            alike: keyframe.alike,
            anchored_to: keyframe.anchored_to,
        }
    }
}

impl From<Evidence19> for EvidenceRecord {
    fn from(evidence: Evidence19) -> Self {
        let Evidence19 { repeats_colour, colour, noise, colour_pose, readout, blocks } = evidence;
        Self { repeats_colour, colour, noise, colour_pose, readout, up: None, blocks }
    }
}

/// The aligner's record in a payload of that version.
pub(super) fn align(payload: &[u8]) -> Result<AlignRecord, String> {
    decode::<AlignOf<FrameOf<Evidence19>>>(payload).map(AlignRecord::from)
}
