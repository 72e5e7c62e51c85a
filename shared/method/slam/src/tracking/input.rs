//! The input of one tracking step.

use crate::map::appearance::Ferns;
use crate::map::context::Context;
use crate::map::map_view::MapView;
use crate::map::surfaces::KeyframeSurfaces;
use crate::tracking::window::Member;
use tessera_features::Feature;
use tessera_geometry::{InertialRotation, UpDirection};
use tessera_registration::Sample;
use tessera_surface::{SurfaceView, WorkloadLevel};

/// Fewer samples than this cannot be aligned.
pub(crate) const MIN_SAMPLES: usize = 100;

/// One frame: its identity, its surface, and what else was measured with it.
#[derive(Clone, Copy, Debug)]
pub struct FrameSurface<'a> {
    /// Frame index as the source counts.
    pub index: u64,
    /// Sensor time.
    pub stamp_nanos: i64,
    /// The camera's rotation since the source's first frame, where a gyroscope measured it.
    pub rotation: Option<InertialRotation>,
    /// The direction against gravity, where an accelerometer measured it.
    pub up: Option<UpDirection>,
    /// The surface, read in place.
    pub surface: SurfaceView<'a>,
    /// How much work it gets; the same in each replay.
    pub workload: WorkloadLevel,
    /// Relocalisation is asked for from this frame index on: the first frame from there drops the pose that
    /// was tracked so far. The same in each later frame; 0: it was never asked for.
    pub relocalise_from: u64,
    /// Features of its colour image; none where there is no colour.
    pub features: &'a [Feature],
}

impl<'a> FrameSurface<'a> {
    /// A frame at full workload of which only the surface was measured.
    pub fn new(index: u64, stamp_nanos: i64, surface: SurfaceView<'a>) -> Self {
        let workload = WorkloadLevel::Full;
        Self {
            index,
            stamp_nanos,
            rotation: None,
            up: None,
            surface,
            workload,
            relocalise_from: 0,
            features: &[],
        }
    }
}

/// Surfaces that one step may read.
#[derive(Clone, Copy)]
pub(crate) struct Surfaces<'a> {
    pub(crate) recent: &'a [FrameSurface<'a>],
    pub(crate) keyframes: &'a dyn KeyframeSurfaces,
}

/// Everything that one step reads. Nothing of it changes within the step.
#[derive(Clone, Copy)]
pub(crate) struct TrackingInput<'a> {
    /// Camera, grid and settings at the frame's workload.
    pub(crate) context: &'a Context,
    pub(crate) map: MapView<'a>,
    pub(crate) ferns: &'a Ferns,
    pub(crate) frame: &'a FrameSurface<'a>,
    /// Samples of the frame's surface.
    pub(crate) samples: &'a [Sample],
    pub(crate) surfaces: Surfaces<'a>,
    /// The camera's view before: how many of the frame's features last from one to the next, it tells.
    pub(crate) view_before: Option<Member>,
}

impl TrackingInput<'_> {
    /// The same with the map as seen from another submap.
    pub(crate) fn in_submap(&self, submap: u32) -> Self {
        Self { map: self.map.in_submap(submap), ..*self }
    }
}
