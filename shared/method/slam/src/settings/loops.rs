//! Settings of loop-closure detection.

use serde::{Deserialize, Serialize};
use tessera_numerics::{SettingError, check_range};

/// When a loop is a loop, and when it asks for an optimisation (method 7).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LoopSettings {
    /// Least difference of frame indices.
    pub min_frames: u64,
    /// Least difference of stamps, seconds.
    pub min_seconds: f64,
    /// Least number of keyframes between.
    pub min_keyframes: u32,
    /// A jump by the old poses beyond this is a conflict, metres.
    pub conflict_translation_m: f64,
    /// A jump by the old poses beyond this is a conflict, degrees.
    pub conflict_rotation_deg: f64,
    /// Whether a conflict is settled at once between the frame and the keyframes of its window.
    pub extended_window: bool,
    /// Keyframes between two requests, at least.
    pub request_interval: u32,
    /// Frames between a request and its effect: `delay_frames + keyframes * delay_per_keyframe`.
    pub delay_frames: u32,
    /// See `delay_frames`.
    pub delay_per_keyframe: f64,
    /// Keyframes that look more alike than this are tried as a loop wherever they lie, 0 to 1.
    pub min_similarity: f64,
}

impl Default for LoopSettings {
    fn default() -> Self {
        Self {
            min_frames: 150,
            min_seconds: 5.0,
            min_keyframes: 5,
            conflict_translation_m: 0.05,
            conflict_rotation_deg: 3.0,
            extended_window: true,
            request_interval: 30,
            delay_frames: 15,
            delay_per_keyframe: 0.5,
            min_similarity: 0.75,
        }
    }
}

impl LoopSettings {
    /// Checks every range, NaN included.
    pub(super) fn check(&self) -> Result<(), SettingError> {
        check_range("loop.min_frames", self.min_frames as f64, 1.0, 1e9)?;
        check_range("loop.min_seconds", self.min_seconds, 0.0, 1e6)?;
        check_range("loop.min_keyframes", self.min_keyframes.into(), 0.0, 1e6)?;
        check_range("loop.conflict_translation_m", self.conflict_translation_m, 0.0, 100.0)?;
        check_range("loop.conflict_rotation_deg", self.conflict_rotation_deg, 0.0, 180.0)?;
        check_range("loop.request_interval", self.request_interval.into(), 1.0, 1e6)?;
        check_range("loop.delay_frames", self.delay_frames.into(), 1.0, 1e6)?;
        check_range("loop.delay_per_keyframe", self.delay_per_keyframe, 0.0, 100.0)?;
        check_range("loop.min_similarity", self.min_similarity, 0.0, 1.0)
    }
}
