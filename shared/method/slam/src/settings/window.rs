//! Settings of the local window and its alignment.

use serde::{Deserialize, Serialize};
use tessera_numerics::{SettingError, check_range};

/// The local window and its alignment (method 5.1, 6).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WindowSettings {
    /// Fixed reference poses `w`, 1 to 10.
    pub size: u32,
    /// Largest distance of a window keyframe from the predicted camera centre, metres.
    #[serde(skip)]
    pub radius_m: f64,
    /// Largest angle between the optical axes of a window keyframe and of the predicted camera, degrees.
    #[serde(skip)]
    pub angle_deg: f64,
    /// Correspondences sought per frame, split evenly over the window.
    #[serde(skip)]
    pub match_budget: u32,
    /// Share of the correspondences sought in all but the last outer iteration.
    #[serde(skip)]
    pub early_share: f64,
    /// Outer iterations while tracking.
    pub outer_iterations: u32,
    /// Outer iterations of the second attempt, after a failure.
    #[serde(skip)]
    pub retry_iterations: u32,
    /// Lower bound of the first distance limit while tracking, metres.
    pub min_first_distance_m: f64,
    /// Upper bound of the first distance limit while tracking, metres.
    pub max_first_distance_m: f64,
    /// Pose change below which the schedule skips to its last, tightest step, metres (and radians).
    #[serde(skip)]
    pub converged_step: f64,
    /// Whether the rotation of the prediction is the gyroscope's where the source has one.
    #[serde(skip)]
    pub inertial_rotation: bool,
    /// Whether a frame is aligned without what stands where a moment ago nothing stood; not where
    /// `registration.weight.robust_sigmas` is 0.
    #[serde(skip)]
    pub at_rest_only: bool,
    /// Whether large-displacement hypotheses are tried where the other attempts fail.
    pub long_strides: bool,
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
    /// A translation is free when its matches claim a larger standard deviation, metres, and it
    /// is `free_ratio` times that of the best known translation.
    #[serde(skip)]
    pub free_translation_m: f64,
    /// A rotation is free when its matches claim a larger standard deviation, degrees, and it is
    /// `free_ratio` times that of the best known rotation.
    #[serde(skip)]
    pub free_rotation_deg: f64,
    /// See `free_translation_m`.
    #[serde(skip)]
    pub free_ratio: f64,
}

impl Default for WindowSettings {
    fn default() -> Self {
        Self {
            size: 5,
            radius_m: 0.3,
            angle_deg: 30.0,
            match_budget: 4000,
            early_share: 0.3,
            outer_iterations: 6,
            retry_iterations: 10,
            min_first_distance_m: 0.1,
            max_first_distance_m: 0.5,
            converged_step: 2e-4,
            inertial_rotation: true,
            at_rest_only: true,
            long_strides: true,
            min_match_share: 0.15,
            max_residual_sigmas: 3.0,
            min_matched: 0.3,
            max_in_front: 0.4,
            free_translation_m: 0.0015,
            free_rotation_deg: 0.1,
            free_ratio: 10.0,
        }
    }
}

impl WindowSettings {
    /// Checks every range, NaN included.
    pub(super) fn check(&self) -> Result<(), SettingError> {
        check_range("window.size", self.size.into(), 1.0, 10.0)?;
        check_range("window.radius_m", self.radius_m, 0.0, 100.0)?;
        check_range("window.angle_deg", self.angle_deg, 0.0, 180.0)?;
        check_range("window.match_budget", self.match_budget.into(), 50.0, 1e6)?;
        check_range("window.early_share", self.early_share, 0.01, 1.0)?;
        check_range("window.outer_iterations", self.outer_iterations.into(), 2.0, 100.0)?;
        check_range("window.retry_iterations", self.retry_iterations.into(), 2.0, 100.0)?;
        check_range("window.min_first_distance_m", self.min_first_distance_m, 0.001, 10.0)?;
        check_range(
            "window.max_first_distance_m",
            self.max_first_distance_m,
            self.min_first_distance_m,
            10.0,
        )?;
        check_range("window.converged_step", self.converged_step, 0.0, 0.1)?;
        check_range("window.min_match_share", self.min_match_share, 0.0, 1.0)?;
        check_range("window.max_residual_sigmas", self.max_residual_sigmas, 0.1, 1e3)?;
        check_range("window.min_matched", self.min_matched, 0.0, 1.0)?;
        check_range("window.max_in_front", self.max_in_front, 0.0, 1.0)?;
        check_range("window.free_translation_m", self.free_translation_m, 1e-4, 1e3)?;
        check_range("window.free_rotation_deg", self.free_rotation_deg, 1e-2, 1e3)?;
        check_range("window.free_ratio", self.free_ratio, 1.0, 1e6)
    }
}
