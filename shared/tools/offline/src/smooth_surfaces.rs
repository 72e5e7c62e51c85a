//! The keyframes' surfaces as a calibration takes them.

use crate::{Method, RawFrame, Run};
use tessera_geometry::Camera;
use tessera_numerics::SettingError;
use tessera_surface::{Reconstructor, SurfaceSettings, Vertex};

/// Rings and weight of the normals' difference in the filter. Noise in the surfaces does not only
/// scatter the camera, it draws it aside; what the default filter rounds off at creases does so too.
const RINGS: u32 = 2;
const NORMAL_WEIGHT: f32 = 5.0;

/// Surfaces of the keyframes: smoother than those that are tracked, with sharper creases.
pub(crate) struct SmoothSurfaces {
    reconstructor: Reconstructor,
    previous: Vec<Vertex>,
    /// By keyframe.
    pub(crate) keyframes: Vec<Vec<Vertex>>,
}

impl SmoothSurfaces {
    pub(crate) fn new(camera: &Camera, method: &Method) -> Result<Self, SettingError> {
        let settings =
            SurfaceSettings { filter_rings: RINGS, filter_normal: NORMAL_WEIGHT, ..method.surface.clone() };
        let reconstructor = Reconstructor::new(camera, &settings)?;
        Ok(Self { reconstructor, previous: Vec::new(), keyframes: Vec::new() })
    }

    /// Keeps the surface of a keyframe that the run has just made: of this frame or the one before.
    pub(crate) fn push(&mut self, frame: &RawFrame, run: &Run) {
        let mut vertices = vec![Vertex::default(); self.reconstructor.grid().len()];
        self.reconstructor.reconstruct(&frame.depth, frame.colour.as_deref(), &mut vertices);
        let state = run.tracker.state();
        if let Some(keyframe) = state.keyframes.get(self.keyframes.len()) {
            let is_current = keyframe.frame_index + 1 == state.next_index;
            self.keyframes.push(if is_current { vertices.clone() } else { self.previous.clone() });
        }
        self.previous = vertices;
    }
}
