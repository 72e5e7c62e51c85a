//! The aligner's pure step: a frame's surface in, its record out.

use crate::records::{AlignRecord, AppliedCorrection, Correction, FrameRecord, RequestRecord};
use tessera_geometry::Camera;
use tessera_surface::{SurfaceView, Vertex};

/// A frame's surface with its identity.
#[derive(Clone, Copy, Debug)]
pub struct FrameSurface<'a> {
    /// Frame index as the source counts.
    pub index: u64,
    /// Sensor time.
    pub stamp_nanos: i64,
    /// The surface, read in place.
    pub surface: SurfaceView<'a>,
}

/// Read access to the surfaces of keyframes, in place.
pub trait KeyframeSurfaces: Sync {
    /// Vertices of a keyframe, row by row; the grid is the same for all.
    fn vertices(&self, keyframe: u32) -> &[Vertex];
}

/// The aligner: a fold over [`AlignRecord`]s plus a pure step that makes the next one.
pub struct Tracker {
    next_index: u64,
}

impl Tracker {
    /// A tracker that has seen nothing.
    pub fn new(_camera: &Camera) -> Self {
        Self { next_index: 0 }
    }

    /// Takes a record into the state. The only way the state changes, live and in replay.
    pub fn apply(&mut self, record: &AlignRecord) {
        if let AlignRecord::Frame(frame) = record {
            self.next_index = frame.index + 1;
        }
    }

    /// The index that must be aligned next (lossless), or the lowest acceptable (live).
    pub fn next_index(&self) -> u64 {
        self.next_index
    }

    /// Surfaces of frames from this index on are needed beside the keyframes' to align `next_index`.
    pub fn first_recent_index(&self) -> u64 {
        self.next_index.saturating_sub(1)
    }

    /// The request whose correction must be applied before frame `index` is aligned.
    pub fn correction_due(&self, _index: u64) -> Option<u64> {
        None
    }

    /// The record by which a correction takes effect before `before_frame`.
    pub fn correction_record(&self, correction: Correction, before_frame: u64) -> AlignRecord {
        AlignRecord::Correction(Box::new(AppliedCorrection { before_frame, correction }))
    }

    /// Aligns a frame. `recent` holds the surfaces from [`Self::first_recent_index`] on that the
    /// shell still has, in order of index. A `new_keyframe` in the answer has an empty store slot:
    /// the shell writes that frame's surface to the store and fills the slot in before it journals.
    pub fn align(
        &self,
        _frame: &FrameSurface<'_>,
        _recent: &[FrameSurface<'_>],
        _keyframes: &dyn KeyframeSurfaces,
    ) -> FrameRecord {
        unimplemented!("comes with the alignment")
    }

    /// The final request once the source is exhausted.
    pub fn final_request(&self) -> Option<RequestRecord> {
        None
    }
}
