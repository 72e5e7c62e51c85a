//! Settings of the global optimisation, and its fixed numbers.

use serde::{Deserialize, Serialize};

/// The optimisation of all keyframes (method 8).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GlobalSettings {
    /// The final request solves for the camera too. What was tracked and mapped stays as it is;
    /// the outputs are those of the refined camera.
    pub refine_camera: bool,
}

impl GlobalSettings {
    /// Least share of queries with a match for a pair to count.
    pub const MIN_OVERLAP: f64 = 0.2;
    /// Largest distance between the keyframes of a pair, metres: in a room, farther keyframes see
    /// the same surface too obliquely to be matched.
    pub const RADIUS_M: f64 = 1.5;
    /// Largest angle between the optical axes of a pair, degrees: most of half a field of view
    /// overlaps.
    pub const ANGLE_DEG: f64 = 45.0;
    /// Neighbours of a keyframe, half of them nearest in pose, half far in index.
    pub const NEIGHBOURS: usize = 12;
    /// Queries of a pair: few, as a keyframe has many pairs.
    pub const QUERIES_PER_PAIR: usize = 150;
    /// Outer iterations of a request: more change nothing (lab/notes.md).
    pub const OUTER_ITERATIONS: u32 = 2;
    /// First distance limit, metres: the drift that a pair may have.
    pub const FIRST_DISTANCE_M: f64 = 0.15;
    /// Largest share of queries of a loop pair that violate free space.
    pub const MAX_IN_FRONT: f64 = 0.2;
    /// Disagreement beyond which a loop pair is refused, between its two directions, or loses its weight, with the
    /// graph, standard deviations of depth (method 8.3).
    pub const LOOP_RESIDUAL_SIGMAS: f64 = 1.0;
}
