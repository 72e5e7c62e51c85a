//! Settings of relocalisation.

use serde::{Deserialize, Serialize};
use tessera_numerics::{SettingError, check_range};

/// How a lost camera finds its place again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RelocaliseSettings {
    /// Whether a lost camera is searched in the map.
    pub enabled: bool,
    /// Keyframes that look most like the frame and are tried.
    #[serde(skip)]
    pub n_recognised: u32,
    /// Turned and shifted views that are tried in each frame.
    #[serde(skip)]
    pub n_turned: u32,
    /// Least share of the frame that the best reference sees.
    #[serde(skip)]
    pub min_in_view: f64,
    /// Least share of that part that has a match.
    #[serde(skip)]
    pub min_matched: f64,
    /// Largest share of that part that floats in front of what the reference saw.
    #[serde(skip)]
    pub max_in_front: f64,
    /// Largest median normal residual, standard deviations of depth.
    #[serde(skip)]
    pub max_residual_sigmas: f64,
    /// Frames in a row that must pass after a place was found before the map may change again.
    #[serde(skip)]
    pub confirm_frames: u32,
}

impl Default for RelocaliseSettings {
    fn default() -> Self {
        Self {
            enabled: true,
            n_recognised: 3,
            n_turned: 6,
            min_in_view: 0.3,
            min_matched: 0.5,
            max_in_front: 0.1,
            max_residual_sigmas: 0.7,
            confirm_frames: 3,
        }
    }
}

impl RelocaliseSettings {
    /// Looser limits, for the first alignment of a candidate.
    pub(crate) fn coarse(&self) -> Self {
        Self {
            min_in_view: 0.8 * self.min_in_view,
            min_matched: 0.7 * self.min_matched,
            max_in_front: 2.0 * self.max_in_front,
            max_residual_sigmas: 1.5 * self.max_residual_sigmas,
            ..self.clone()
        }
    }
}

impl RelocaliseSettings {
    /// Checks every range, NaN included.
    pub(super) fn check(&self) -> Result<(), SettingError> {
        check_range("relocalise.n_recognised", self.n_recognised.into(), 0.0, 1e3)?;
        check_range("relocalise.n_turned", self.n_turned.into(), 0.0, 1e3)?;
        check_range("relocalise.min_in_view", self.min_in_view, 0.0, 1.0)?;
        check_range("relocalise.min_matched", self.min_matched, 0.0, 1.0)?;
        check_range("relocalise.max_in_front", self.max_in_front, 0.0, 1.0)?;
        check_range("relocalise.max_residual_sigmas", self.max_residual_sigmas, 0.0, 1e3)?;
        check_range("relocalise.confirm_frames", self.confirm_frames.into(), 1.0, 1e3)
    }
}
