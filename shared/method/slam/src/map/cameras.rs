//! The cameras of several runs whose keyframes are in one map: each keyframe is seen by that of its run.

use crate::estimation::colour_model::ColourModel;
use std::sync::Arc;
use tessera_geometry::Camera;
use tessera_surface::Grid;

/// The camera of one run, with the shape of its surfaces.
#[derive(Clone, Debug, PartialEq)]
pub struct SessionCamera {
    /// The camera.
    pub camera: Camera,
    /// Shape of its surfaces.
    pub grid: Grid,
    /// Where the measurement of a cell lies relative to the cell's first pixel.
    pub offset_px: f64,
    /// How its colour lies against its depth; `None`: as that of the context's own run.
    pub colour: Option<ColourModel>,
}

impl SessionCamera {
    /// Whether surfaces of both are matched alike; how their colour lies apart.
    pub fn is_alike(&self, other: &Self) -> bool {
        let geometry = |of: &Self| {
            let c = &of.camera;
            let size = (c.width, c.height, of.grid);
            (size, [c.fx, c.fy, c.cx, c.cy, c.readout_s, c.depth_offset_m, of.offset_px], c.distortion)
        };
        geometry(self) == geometry(other)
    }
}

/// Cameras by the number of the run that they are of ([`KeyframeState::session`](crate::KeyframeState)). Nothing
/// where all are one: then that of the [`Context`](crate::Context) is each run's.
#[derive(Clone, Debug, Default)]
pub struct SessionCameras(Arc<[SessionCamera]>);

impl SessionCameras {
    /// Cameras of the runs 0, 1, 2, ...; the last one is that of all later runs too.
    pub fn new(cameras: &[SessionCamera]) -> Self {
        let are_alike = cameras.windows(2).all(|pair| pair[0].is_alike(&pair[1]));
        Self(if are_alike { Arc::default() } else { cameras.into() })
    }

    /// All of them; nothing where there is one camera.
    pub(crate) fn all(&self) -> &[SessionCamera] {
        &self.0
    }

    /// Whether there is one camera.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// How colour of a run and of those before it lies.
    pub(crate) fn colours(&self, session: u32) -> Vec<Option<ColourModel>> {
        self.0.iter().take((session as usize).saturating_add(1)).map(|of| of.colour).collect()
    }

    /// The camera of a run; `None` where there is one camera.
    pub(crate) fn of(&self, session: u32) -> Option<&SessionCamera> {
        self.0.get(session as usize).or_else(|| self.0.last())
    }
}
