//! The keyframe test: whether the previous frame becomes a keyframe (III-H, method 9).

use crate::settings::{KeyframeSettings, MappingSettings};
use tessera_geometry::{Pose, translation_rotation_norms};
use tessera_numerics::MethodVariant;

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

/// Fixed limits on motion first, then the entropy of eq. 15: by its difference of 4 nats, in the paper by its ratio of
/// 0.95.
pub(crate) fn is_due(settings: &MappingSettings, distance: &Distance<'_>) -> bool {
    if is_far(&settings.keyframe, distance.keyframe_from_camera) {
        return true;
    }
    let Some(reference) = distance.reference_entropy else { return false };
    if !distance.entropy_nats.is_finite() {
        return false;
    }
    match settings.variant {
        MethodVariant::Tessera => distance.entropy_nats - reference > 4.0,
        // The ratio means something only while both entropies are clearly negative (method T58).
        MethodVariant::Paper => {
            distance.entropy_nats < -1.0 && reference < -1.0 && distance.entropy_nats / reference < 0.95
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motion_entropy_gain_and_ratio_each_trigger() {
        let near = Pose::translation(0.05, 0.0, 0.0);
        let far = Pose::translation(0.15, 0.0, 0.0);
        let check = |variant: MethodVariant, pose: &Pose, entropy_nats: f64| {
            let settings = MappingSettings { variant, ..MappingSettings::default() };
            let reference_entropy = Some(-86.0);
            is_due(&settings, &Distance { keyframe_from_camera: pose, entropy_nats, reference_entropy })
        };
        for (variant, below, above) in
            [(MethodVariant::Tessera, -82.5, -81.5), (MethodVariant::Paper, -82.0, -81.5)]
        {
            assert!(check(variant, &far, -86.0));
            assert!(!check(variant, &near, below));
            assert!(check(variant, &near, above));
            assert!(!check(variant, &near, f64::NAN));
        }
    }
}
