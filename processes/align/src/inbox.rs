//! Surfaces in shared memory: the one that is next, some that came early, and the recent ones.
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::indexing_slicing,
        clippy::cast_possible_truncation,
        clippy::arithmetic_side_effects
    )
)]

use std::collections::BTreeMap;
use tessera_features::Feature;
use tessera_messages::{Kind, Refusal, SurfaceExpectation, SurfaceHeader, read_features};
use tessera_slam::FrameSurface;
use tessera_stage::{Pulse, StageError};
use tessera_surface::{Grid, SurfaceView, Vertex};
use tessera_transport::{Link, Received, SliceSubscriber};

/// A checked surface, read in place.
pub(crate) struct ReceivedSurface {
    /// A private copy.
    pub(crate) header: SurfaceHeader,
    pub(crate) kind: Kind,
    received: Received<SurfaceHeader, Vertex>,
    /// Vertices of the grid; what follows them in the payload are features.
    n_vertices: usize,
    features: Vec<Feature>,
}

impl ReceivedSurface {
    /// The vertices, in place.
    pub(crate) fn vertices(&self) -> &[Vertex] {
        self.received.payload().get(..self.n_vertices).unwrap_or_default()
    }

    /// Vertices and features as a keyframe keeps them, in place.
    pub(crate) fn payload(&self) -> &[Vertex] {
        self.received.payload()
    }

    /// As the tracker takes it.
    pub(crate) fn view(&self, grid: Grid) -> FrameSurface<'_> {
        FrameSurface {
            index: self.header.index,
            stamp_nanos: self.header.stamp_nanos,
            // Checked when it came, in a private copy.
            rotation: self.header.rotation.read(self.header.index).unwrap_or(None),
            up: self.header.up.read(self.header.index).unwrap_or(None),
            surface: SurfaceView { grid, vertices: self.vertices() },
            features: &self.features,
            workload: self.header.workload(),
            relocalise_from: self.header.relocalise_from,
        }
    }
}

/// Index and epoch of each surface that was received and passed its checks.
pub(crate) type SeenSurfaces = Vec<(u64, u64)>;

/// Surfaces by index, as many as may be held.
pub(crate) struct Inbox {
    subscriber: SliceSubscriber<SurfaceHeader, Vertex>,
    held: BTreeMap<u64, ReceivedSurface>,
    capacity: usize,
    pub(crate) grid: Grid,
    /// Frames of the source, where known.
    n_frames: Option<u64>,
}

impl Inbox {
    pub(crate) fn open(link: &Link, n_frames: Option<u64>) -> Result<Self, StageError> {
        let layout = link.layout();
        Ok(Self {
            subscriber: link.surface_subscriber()?,
            held: BTreeMap::new(),
            // One less than may be borrowed: the one being looked at.
            capacity: layout.surfaces().borrowed.saturating_sub(1),
            grid: layout.grid,
            n_frames,
        })
    }

    /// Receives the surfaces at or above `first` and below `limit`; answers index and epoch of all
    /// that passed their checks.
    pub(crate) fn fill(
        &mut self,
        first: u64,
        limit: Option<u64>,
        pulse: &mut Pulse,
    ) -> Result<SeenSurfaces, StageError> {
        let expected = SurfaceExpectation { grid: self.grid, limit };
        let mut seen = Vec::new();
        while self.held.len() < self.capacity {
            let Some(received) = self.subscriber.receive()? else { break };
            let header = received.header();
            if header.index < first || self.held.contains_key(&header.index) {
                pulse.beat.duplicates = pulse.beat.duplicates.saturating_add(1);
                continue;
            }
            let checked = header.validate(&expected, received.payload()).and_then(|kind| {
                Refusal::unless_in_source(header.index, kind, self.n_frames, first)?;
                Ok(kind)
            });
            match checked {
                Ok(kind) => {
                    seen.push((header.index, header.epoch));
                    let n_vertices = self.grid.len();
                    let features = read_features(received.payload(), n_vertices);
                    let surface = ReceivedSurface { header, kind, received, n_vertices, features };
                    self.held.insert(header.index, surface);
                }
                Err(refusal) => {
                    tracing::warn!(frame = header.index, "refused: {refusal}");
                    pulse.beat.refused = pulse.beat.refused.saturating_add(1);
                }
            }
        }
        pulse.beat.queue = self.held.len() as u64;
        Ok(seen)
    }

    /// The surface of a frame.
    pub(crate) fn get(&self, index: u64) -> Option<&ReceivedSurface> {
        self.held.get(&index)
    }

    /// Index of the surface to work on next in live mode, `next` or above.
    pub(crate) fn newest(&self, next: u64) -> Option<u64> {
        newest_before_end(self.held.range(next..).map(|(&index, surface)| (index, surface.kind)))
    }

    /// The first index in `first..=next` that is not here, or `next` where only that may be missing.
    pub(crate) fn first_missing(&self, first: u64, next: u64) -> u64 {
        (first..next).find(|index| !self.held.contains_key(index)).unwrap_or(next)
    }

    /// Surfaces of the frames `first..next` that are here, in order.
    pub(crate) fn recent(&self, first: u64, next: u64) -> Vec<FrameSurface<'_>> {
        self.held.range(first..next.max(first)).map(|(_, surface)| surface.view(self.grid)).collect()
    }

    /// Releases the surfaces below `first`.
    pub(crate) fn release_below(&mut self, first: u64) {
        self.held = self.held.split_off(&first);
    }

    /// Releases all surfaces.
    pub(crate) fn clear(&mut self) {
        self.held.clear();
    }
}

/// The newest frame, or the end where no frame is left: the last frame must not be left out
/// because the end came with it.
fn newest_before_end(held: impl DoubleEndedIterator<Item = (u64, Kind)>) -> Option<u64> {
    let mut end = None;
    for (index, kind) in held.rev() {
        match kind {
            Kind::Frame => return Some(index),
            Kind::End => end = Some(index),
        }
    }
    end
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_does_not_displace_the_last_frame() {
        let newest = |held: &[(u64, Kind)]| newest_before_end(held.iter().copied());
        assert_eq!(newest(&[(3, Kind::Frame), (4, Kind::Frame), (5, Kind::End)]), Some(4));
        assert_eq!(newest(&[(5, Kind::End)]), Some(5));
        assert_eq!(newest(&[(3, Kind::Frame), (4, Kind::Frame)]), Some(4));
        assert_eq!(newest(&[]), None);
    }
}
