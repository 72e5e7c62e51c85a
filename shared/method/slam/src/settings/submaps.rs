//! Settings of submaps.

use serde::{Deserialize, Serialize};
use tessera_numerics::{SettingError, check_range};

/// When a lost camera goes on in a map of its own (method 12.8).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SubmapSettings {
    /// Time for which the camera is lost, with usable frames, before a submap begins, seconds; 0: none
    /// ever does.
    pub after_s: f64,
}

impl Default for SubmapSettings {
    fn default() -> Self {
        Self { after_s: 1.0 }
    }
}

impl SubmapSettings {
    /// Checks every range, NaN included.
    pub(super) fn check(&self) -> Result<(), SettingError> {
        check_range("submaps.after_s", self.after_s, 0.0, 1e6)
    }
}
