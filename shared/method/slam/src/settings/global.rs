//! Settings of the global optimisation.

use serde::{Deserialize, Serialize};
use tessera_numerics::{SettingError, check_range};

/// The optimisation of all keyframes (method 8).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GlobalSettings {
    /// Pairs farther apart take no part, metres.
    pub radius_m: f64,
    /// Pairs looking elsewhere take no part, degrees between optical axes.
    pub angle_deg: f64,
    /// Neighbours of a keyframe, half of them nearest in pose, half far in index.
    pub neighbours: u32,
    /// Queries of a pair.
    pub queries_per_pair: u32,
    /// Outer iterations of a request during the run.
    pub outer_iterations: u32,
    /// Outer iterations of the final request.
    pub final_iterations: u32,
    /// First distance limit, metres.
    pub first_distance_m: f64,
    /// Least share of queries with a match for a pair to count.
    pub min_overlap: f64,
    /// Largest share of queries in front of what the other keyframe of a loop pair saw.
    pub max_in_front: f64,
    /// Largest disagreement between both directions of a loop pair, standard deviations of depth.
    pub max_inconsistency_sigmas: f64,
    /// A loop pair that disagrees with the graph by more loses its weight, standard deviations of
    /// depth; 0 switches this off.
    pub loop_residual_sigmas: f64,
    /// The final request solves for the camera too. What was tracked and mapped stays as it is;
    /// the outputs are those of the refined camera.
    pub refine_camera: bool,
}

impl Default for GlobalSettings {
    fn default() -> Self {
        Self {
            radius_m: 1.5,
            angle_deg: 45.0,
            neighbours: 12,
            queries_per_pair: 150,
            outer_iterations: 2,
            final_iterations: 4,
            first_distance_m: 0.15,
            min_overlap: 0.2,
            max_in_front: 0.2,
            max_inconsistency_sigmas: 1.5,
            loop_residual_sigmas: 1.0,
            refine_camera: false,
        }
    }
}

impl GlobalSettings {
    /// Checks every range, NaN included.
    pub(super) fn check(&self) -> Result<(), SettingError> {
        check_range("global.radius_m", self.radius_m, 0.0, 100.0)?;
        check_range("global.angle_deg", self.angle_deg, 0.0, 180.0)?;
        check_range("global.neighbours", self.neighbours.into(), 1.0, 1e4)?;
        check_range("global.queries_per_pair", self.queries_per_pair.into(), 20.0, 1e6)?;
        check_range("global.outer_iterations", self.outer_iterations.into(), 1.0, 100.0)?;
        check_range("global.final_iterations", self.final_iterations.into(), 1.0, 100.0)?;
        check_range("global.first_distance_m", self.first_distance_m, 0.001, 10.0)?;
        check_range("global.min_overlap", self.min_overlap, 0.0, 1.0)?;
        check_range("global.max_in_front", self.max_in_front, 0.0, 1.0)?;
        check_range("global.max_inconsistency_sigmas", self.max_inconsistency_sigmas, 0.0, 1e3)?;
        check_range("global.loop_residual_sigmas", self.loop_residual_sigmas, 0.0, 1e3)
    }
}
