//! The optimiser's pure step: all keyframes in, a correction out.

use crate::records::{AlignRecord, Correction, OptimiseRecord, RequestRecord};
use crate::tracker::KeyframeSurfaces;
use tessera_geometry::Camera;

/// The optimiser: a fold over both journals plus a pure solve.
pub struct Optimiser {}

impl Optimiser {
    /// An optimiser that has seen nothing.
    pub fn new(_camera: &Camera) -> Self {
        Self {}
    }

    /// Takes a record of the aligner's journal into the state.
    pub fn apply(&mut self, _record: &AlignRecord) {}

    /// Takes a record of its own journal into the state.
    pub fn apply_own(&mut self, _record: &OptimiseRecord) {}

    /// The oldest request without an answer.
    pub fn next_request(&self) -> Option<RequestRecord> {
        None
    }

    /// Whether the aligner's journal has ended and every request is answered.
    pub fn is_done(&self) -> bool {
        false
    }

    /// Answers a request; `progress` is called in each inner iteration (a heartbeat).
    pub fn solve(
        &self,
        _request: &RequestRecord,
        _keyframes: &dyn KeyframeSurfaces,
        _progress: &mut dyn FnMut(),
    ) -> Correction {
        unimplemented!("comes with the global optimisation")
    }
}
