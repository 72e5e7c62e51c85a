//! The keyframe test: whether the previous frame becomes a keyframe (III-H, method 9).

use crate::settings::KeyframeSettings;
use tessera_geometry::{Pose, translation_rotation_norms};

/// Input of the test.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Distance<'a> {
    /// The new frame relative to the last keyframe.
    pub(crate) keyframe_from_camera: &'a Pose,
    /// Entropy of that pose, nats; NaN where unknown.
    pub(crate) entropy_nats: f64,
    /// Entropy of the first frame aligned to the keyframe.
    pub(crate) reference_entropy: Option<f64>,
}

/// Whether a motion exceeds the limits.
pub(crate) fn is_far(settings: &KeyframeSettings, motion: &Pose) -> bool {
    let (translation_m, rotation_rad) = translation_rotation_norms(motion);
    translation_m > settings.translation_m || rotation_rad > settings.rotation_deg.to_radians()
}

/// Fixed limits on motion first, then the entropy of eq. 15 by difference or by ratio.
pub(crate) fn is_due(settings: &KeyframeSettings, distance: &Distance<'_>) -> bool {
    if is_far(settings, distance.keyframe_from_camera) {
        return true;
    }
    let Some(reference) = distance.reference_entropy else { return false };
    if !distance.entropy_nats.is_finite() {
        return false;
    }
    let gained =
        settings.entropy_gain_nats > 0.0 && distance.entropy_nats - reference > settings.entropy_gain_nats;
    // The ratio means something only while both entropies are clearly negative (method T58).
    let is_ratio_valid = settings.entropy_ratio > 0.0 && distance.entropy_nats < -1.0 && reference < -1.0;
    gained || (is_ratio_valid && distance.entropy_nats / reference < settings.entropy_ratio)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motion_entropy_gain_and_ratio_each_trigger() {
        let settings = KeyframeSettings { entropy_ratio: 0.95, ..KeyframeSettings::default() };
        let near = Pose::translation(0.05, 0.0, 0.0);
        let far = Pose::translation(0.15, 0.0, 0.0);
        let check = |pose: &Pose, entropy_nats: f64| {
            is_due(
                &settings,
                &Distance { keyframe_from_camera: pose, entropy_nats, reference_entropy: Some(-86.0) },
            )
        };
        assert!(check(&far, -86.0));
        assert!(!check(&near, -84.0));
        assert!(check(&near, -81.5));
        assert!(!check(&near, f64::NAN));
    }
}
