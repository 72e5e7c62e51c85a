//! Settings of the keyframe test and of the size of the map.

use serde::{Deserialize, Serialize};
use tessera_numerics::{SettingError, check_range};

/// When a frame becomes a keyframe (method 9).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct KeyframeSettings {
    /// Distance from the last keyframe, metres.
    pub translation_m: f64,
    /// Rotation from the last keyframe, degrees.
    pub rotation_deg: f64,
    /// Distance to another keyframe below which one is culled, metres, a degree as a centimetre:
    /// nothing is aligned to it any more. 0: none is.
    pub redundant_within_m: f64,
    /// Keyframes of the working map at most; 0: no limit. Those beyond it are culled too, those with
    /// the least room first.
    pub budget: u32,
}

impl Default for KeyframeSettings {
    fn default() -> Self {
        Self { translation_m: 0.1, rotation_deg: 6.0, redundant_within_m: 0.075, budget: 0 }
    }
}

impl KeyframeSettings {
    /// Checks every range, NaN included.
    pub(super) fn check(&self) -> Result<(), SettingError> {
        check_range("keyframe.translation_m", self.translation_m, 0.001, 10.0)?;
        check_range("keyframe.rotation_deg", self.rotation_deg, 0.1, 180.0)?;
        check_range("keyframe.redundant_within_m", self.redundant_within_m, 0.0, 10.0)?;
        if self.budget != 0 {
            check_range("keyframe.budget", self.budget.into(), 10.0, 2000.0)?;
        }
        Ok(())
    }
}
