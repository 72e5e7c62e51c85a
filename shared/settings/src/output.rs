//! What is written at the end.

use serde::{Deserialize, Serialize};

/// The outputs made from the run directory.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OutputSettings {
    /// Edge of the voxels that thin `map.ply` to one point each, metres.
    pub map_voxel_m: f64,
    /// Points farther from their camera than this are left out of `map.ply`, metres.
    pub map_max_depth_m: f64,
}

impl Default for OutputSettings {
    fn default() -> Self {
        Self { map_voxel_m: 0.01, map_max_depth_m: 6.0 }
    }
}

impl OutputSettings {
    /// Checks every range; NaN is outside of each.
    ///
    /// # Errors
    /// `key is value, expected rule` for the first that cannot be.
    pub fn check(&self) -> Result<(), String> {
        let &Self { map_voxel_m, map_max_depth_m } = self;
        if !(0.001..=1.0).contains(&map_voxel_m) {
            return Err(format!("map_voxel_m is {map_voxel_m}, expected 0.001 to 1 metre"));
        }
        if !(0.1..=100.0).contains(&map_max_depth_m) {
            return Err(format!("map_max_depth_m is {map_max_depth_m}, expected 0.1 to 100 metres"));
        }
        Ok(())
    }
}
