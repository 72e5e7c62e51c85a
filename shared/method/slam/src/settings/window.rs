//! Settings of the local window and its alignment.

use serde::{Deserialize, Serialize};
use tessera_numerics::{SettingError, check_range};

/// The local window and its alignment (method 5.1, 6).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WindowSettings {
    /// Fixed reference poses `w`, 1 to 10.
    pub size: u32,
    /// Correspondences sought per frame, split evenly over the window.
    #[serde(skip)]
    pub match_budget: u32,
    /// Whether dynamic points are excluded; never in the paper's variant.
    #[serde(skip)]
    pub at_rest_only: bool,
    /// Least share of queries with a match.
    #[serde(skip)]
    pub min_match_share: f64,
    /// Largest median normal residual, standard deviations of depth.
    #[serde(skip)]
    pub max_residual_sigmas: f64,
    /// Least share with a match of what the best reference sees of the frame.
    #[serde(skip)]
    pub min_matched: f64,
    /// Largest share of that in front of what the reference saw.
    #[serde(skip)]
    pub max_in_front: f64,
}

impl Default for WindowSettings {
    fn default() -> Self {
        Self {
            size: 5,
            match_budget: 4000,
            at_rest_only: true,
            min_match_share: 0.15,
            max_residual_sigmas: 3.0,
            min_matched: 0.3,
            max_in_front: 0.4,
        }
    }
}

impl WindowSettings {
    /// Largest distance of a window keyframe from the predicted camera centre, metres.
    pub const RADIUS_M: f64 = 0.3;
    /// Largest angle between the optical axes of a window keyframe and of the predicted camera, degrees.
    pub const ANGLE_DEG: f64 = 30.0;
    /// Share of the correspondences sought in all but the last outer iteration.
    pub const EARLY_SHARE: f64 = 0.3;
    /// Outer iterations from a start that is at a solution, or not far from one.
    pub const REFINING_ITERATIONS: u32 = 3;
    /// Pose change that no sensor resolves, metres and radians: below it the schedule skips to its last, tightest step.
    pub const CONVERGED_STEP: f64 = 1e-4;
    /// A translation, or a rotation, is free when its matches claim a larger standard deviation, metres or radians, and
    /// it is [`Self::FREE_RATIO`] times that of the best known one.
    pub const FREE_SIGMA: f64 = 0.0015;
    /// See [`Self::FREE_SIGMA`].
    pub const FREE_RATIO: f64 = 10.0;

    /// Checks every range, NaN included.
    pub(super) fn check(&self) -> Result<(), SettingError> {
        check_range("window.size", self.size.into(), 1.0, 10.0)?;
        check_range("window.match_budget", self.match_budget.into(), 50.0, 1e6)?;
        check_range("window.min_match_share", self.min_match_share, 0.0, 1.0)?;
        check_range("window.max_residual_sigmas", self.max_residual_sigmas, 0.1, 1e3)?;
        check_range("window.min_matched", self.min_matched, 0.0, 1.0)?;
        check_range("window.max_in_front", self.max_in_front, 0.0, 1.0)
    }
}
