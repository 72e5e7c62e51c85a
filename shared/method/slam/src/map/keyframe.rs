//! Keyframes: as journaled, and as the tracker holds them.

use crate::map::appearance::PlaceCode;
use serde::{Deserialize, Serialize};
use tessera_geometry::{PoseBits, UpDirection};

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
    /// Where its surface lies; filled in when the store is written.
    pub slot: StoreSlot,
    /// Keyframes it shares an edge with (ids below its own), loops among them.
    pub edges: Vec<EdgeRecord>,
    /// Appearance code of the place, for recognition.
    pub place: PlaceCode,
    /// Keyframes of long before that look like it, the most alike first: with them it may close a loop.
    pub alike: Vec<u32>,
    /// Keyframes that leave the working map for it, because there are more than the budget.
    pub retires: Vec<RetiredRecord>,
}

impl KeyframeRecord {
    /// A keyframe at rest of which no more is known, and whose surface is not in the store yet; `frame`: index and time
    /// in nanoseconds of what it was made of.
    pub fn new(id: u32, frame: (u64, i64), world_from_camera: PoseBits, place: PlaceCode) -> Self {
        Self {
            id,
            frame_index: frame.0,
            stamp_nanos: frame.1,
            world_from_camera,
            velocity: [0.0; 6],
            slot: StoreSlot::default(),
            edges: Vec::new(),
            place,
            alike: Vec::new(),
            retires: Vec::new(),
        }
    }
}

/// A keyframe that nothing is aligned to any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RetiredRecord {
    /// The keyframe.
    pub keyframe: u32,
    /// The keyframe of the working map that it moves along with from now on.
    pub anchored_to: u32,
}

/// A connection between two keyframes, made when the newer one was aligned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EdgeRecord {
    /// The older keyframe.
    pub to: u32,
    /// Whether it closes a loop.
    pub is_loop: bool,
}

/// One corrected keyframe.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeyframePose {
    /// Keyframe.
    pub id: u32,
    /// Its corrected pose.
    pub world_from_camera: PoseBits,
}

/// A keyframe as the aligner knows it now.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeyframeState {
    /// 0, 1, 2, …
    pub id: u32,
    /// Which run made it: 0, 1, 2, … in the order in which runs extended the map.
    pub session: u32,
    /// The submap that it was made in.
    pub submap: u32,
    /// The frame it was, as that run counts.
    pub frame_index: u64,
    /// Its stamp.
    pub stamp_nanos: i64,
    /// Its pose after all corrections so far.
    pub world_from_camera: PoseBits,
    /// Its own motion per second, `rho phi`.
    pub velocity: [f64; 6],
    /// Where its surface lies.
    pub slot: StoreSlot,
    /// Keyframes it was aligned to.
    pub edges: Vec<EdgeRecord>,
    /// Covariance of its pose when it was made, as in `PoseRecord::covariance`.
    pub covariance: Vec<f64>,
    /// The direction against gravity, where an accelerometer measured it.
    pub up: Option<UpDirection>,
    /// Appearance code of the place.
    pub place: PlaceCode,
    /// Keyframes that look like it, as journaled.
    pub alike: Vec<u32>,
    /// The keyframe that this one moves along with since it left the working map; itself, where it is of what
    /// the camera was carried in.
    pub anchored_to: Option<u32>,
}

impl KeyframeState {
    /// The keyframe of a record that a run made in a submap, of which no covariance and no direction of gravity is known.
    pub(crate) fn made(record: &KeyframeRecord, session: u32, submap: u32) -> Self {
        Self {
            id: record.id,
            session,
            submap,
            frame_index: record.frame_index,
            stamp_nanos: record.stamp_nanos,
            world_from_camera: record.world_from_camera,
            velocity: record.velocity,
            slot: record.slot,
            edges: record.edges.clone(),
            covariance: Vec::new(),
            up: None,
            place: record.place.clone(),
            alike: record.alike.clone(),
            anchored_to: None,
        }
    }

    /// Whether it belongs to the working map: others may be aligned to it.
    pub fn is_active(&self) -> bool {
        self.anchored_to.is_none()
    }
}
