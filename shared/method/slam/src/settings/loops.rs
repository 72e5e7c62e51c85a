//! Settings of loop-closure detection.

use serde::{Deserialize, Serialize};
use tessera_numerics::{SettingError, check_range};

/// Loop-closure detection, and the optimisation requests that follow (method 7).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LoopSettings {
    /// Least difference of frame indices between the two sides of a loop.
    pub min_frames: u64,
    /// Least similarity of appearance at which two keyframes are tried as a loop wherever they lie,
    /// 0 to 1.
    pub min_similarity: f64,
    /// Keyframes between two requests, at least.
    pub request_interval: u32,
    /// Frames between a request and its effect, beside 0.05 frames for each active keyframe.
    pub delay_frames: u32,
}

impl Default for LoopSettings {
    fn default() -> Self {
        Self { min_frames: 150, request_interval: 30, delay_frames: 15, min_similarity: 0.75 }
    }
}

impl LoopSettings {
    /// Least number of keyframes between the two of a loop.
    pub const MIN_KEYFRAMES: u32 = 5;

    /// Checks every range, NaN included.
    pub(super) fn check(&self) -> Result<(), SettingError> {
        check_range("loop.min_frames", self.min_frames as f64, 1.0, 1e9)?;
        check_range("loop.request_interval", self.request_interval.into(), 1.0, 1e6)?;
        check_range("loop.delay_frames", self.delay_frames.into(), 1.0, 1e6)?;
        check_range("loop.min_similarity", self.min_similarity, 0.0, 1.0)
    }
}
