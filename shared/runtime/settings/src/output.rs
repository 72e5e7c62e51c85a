//! Settings of the outputs.

use serde::{Deserialize, Serialize};
use tessera_numerics::{SettingError, check_range};

/// The outputs made from the run directory.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OutputSettings {
    /// Edge of the voxels that thin `map.ply` to one point each, metres.
    pub map_voxel_m: f64,
    /// Points farther from their camera than this are left out of `map.ply`, metres.
    pub map_max_depth_m: f64,
    /// Whether `report.html` is written at the end of a run; `tessera report` writes it at any time.
    pub report: bool,
}

impl Default for OutputSettings {
    fn default() -> Self {
        Self { map_voxel_m: 0.01, map_max_depth_m: 6.0, report: true }
    }
}

impl OutputSettings {
    /// Checks every range; NaN is outside of each.
    ///
    /// # Errors
    /// Names the first key that is out of range, its value and the rule.
    pub fn check(&self) -> Result<(), SettingError> {
        check_range("map_voxel_m", self.map_voxel_m, 0.001, 1.0)?;
        check_range("map_max_depth_m", self.map_max_depth_m, 0.1, 100.0)
    }
}
