//! Settings of the reconstruction, with the defaults of the default preset beside them.

use serde::{Deserialize, Serialize};
use tessera_numerics::{Isa, MethodVariant, SettingError, check_range};

/// Settings of the reconstruction (method 1-3).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SurfaceSettings {
    /// Subsampling step `n`: 1, 2, 4 or 8 pixels between vertices.
    pub step: u32,
    /// Largest depth that counts as a measurement, metres.
    pub max_depth_m: f32,
    /// Rings of the multilateral filter, 0 to 4; 0 switches it off.
    pub filter_rings: u32,
    /// Weight of the L1 difference of normals in the filter (eq. 7, beta); calibration raises it.
    #[serde(skip)]
    pub filter_normal: f32,
    /// Choice of a cell's depth, combination of the edge tests, depth edges in the filter, normals after it.
    pub variant: MethodVariant,
    /// Vector instructions; `run.isa` sets them for all algorithms.
    #[serde(skip)]
    pub isa: Isa,
}

impl Default for SurfaceSettings {
    fn default() -> Self {
        Self {
            step: 4,
            max_depth_m: 8.0,
            filter_rings: 1,
            filter_normal: 1.0,
            variant: MethodVariant::Tessera,
            isa: Isa::Auto,
        }
    }
}

impl SurfaceSettings {
    /// Checks every range, NaN included.
    ///
    /// # Errors
    /// Names the first key that is out of range, its value and the rule.
    pub fn check(&self) -> Result<(), SettingError> {
        if ![1, 2, 4, 8].contains(&self.step) {
            return Err(SettingError {
                key: "step",
                found: self.step.to_string(),
                rule: "1, 2, 4 or 8".into(),
            });
        }
        check_range("max_depth_m", self.max_depth_m.into(), 0.5, 50.0)?;
        check_range("filter_rings", self.filter_rings.into(), 0.0, 4.0)?;
        check_range("filter_normal", self.filter_normal.into(), 0.0, 1e4)
    }
}
