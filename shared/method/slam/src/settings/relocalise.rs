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
}

impl Default for RelocaliseSettings {
    fn default() -> Self {
        Self { enabled: true, n_recognised: 3 }
    }
}

impl RelocaliseSettings {
    /// Frames in a row that must pass after a place was found by surfaces alone before the map may change again.
    pub const CONFIRM_FRAMES: u32 = 3;

    /// Checks every range, NaN included.
    pub(super) fn check(&self) -> Result<(), SettingError> {
        check_range("relocalise.n_recognised", self.n_recognised.into(), 0.0, 1e3)
    }
}
