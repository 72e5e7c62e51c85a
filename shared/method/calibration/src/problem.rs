//! Input of a calibration.

use crate::parameters::Parameter;
use tessera_geometry::{Camera, DepthNoise, Pose, Twist};
use tessera_registration::RegistrationSettings;
use tessera_surface::{Grid, Vertex};

/// A keyframe with its surface as `made_with` saw it.
#[derive(Clone, Copy, Debug)]
pub struct CalibrationKeyframe<'a> {
    /// Frame index: the seed of its samples.
    pub frame_index: u64,
    /// Pose at the frame's stamp.
    pub world_from_camera: Pose,
    /// Motion per second in the camera's frame.
    pub velocity: Twist,
    /// Vertices, row by row.
    pub vertices: &'a [Vertex],
}

/// The calibration problem.
#[derive(Clone, Debug)]
pub struct Problem<'a> {
    /// The camera with which the surfaces and poses were made: where the iteration begins.
    pub made_with: &'a Camera,
    /// The camera to which values are drawn where the motion determines little.
    pub start: &'a Camera,
    /// Shape of all surfaces.
    pub grid: Grid,
    /// Where the measurement of a cell lies relative to the cell's first pixel.
    pub offset_px: f64,
    /// Noise of the depth.
    pub noise: DepthNoise,
    /// Sampling, search and weights.
    pub registration: &'a RegistrationSettings,
    /// Keyframes; the first one's pose is fixed.
    pub keyframes: &'a [CalibrationKeyframe<'a>],
    /// Pairs `(query, target)` of keyframes that see the same.
    pub pairs: &'a [(usize, usize)],
    /// Queries of a pair.
    pub queries_per_pair: usize,
    /// Largest distance of a match in the first iteration, metres.
    pub first_distance_m: f64,
    /// Least share of queries with a match for a pair to count.
    pub min_overlap: f64,
    /// How far the start may be off, pixels of image motion: what is known before a frame is seen.
    pub start_px: f64,
    /// Parameters that keep their start whatever the motion.
    pub fixed: &'a [Parameter],
}

impl Problem<'_> {
    /// The median depth of all keyframes' usable vertices.
    pub(crate) fn median_depth_m(&self) -> f64 {
        let inner = self.keyframes.iter().flat_map(|k| k.vertices.iter().step_by(7)).filter(|v| v.is_inner());
        let mut depths: Vec<f32> = inner.map(|v| v.position[2]).collect();
        if depths.is_empty() {
            return 1.0;
        }
        let middle = depths.len() / 2;
        f64::from(*depths.select_nth_unstable_by(middle, f32::total_cmp).1)
    }
}
