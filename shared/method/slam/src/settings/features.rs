//! Settings of sparse features beside the surfaces (method 14.2).

use serde::{Deserialize, Serialize};
use tessera_features::{Extractor, FeatureSettings};
use tessera_geometry::Camera;
use tessera_numerics::{Isa, SettingError, check_range};

/// How features take part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FeatureUse {
    /// Whether features take part.
    pub enabled: bool,
    /// Factor of the features' information in the window, where colour agrees with the surfaces.
    pub weight: f64,
    /// Further factor between keyframes.
    pub keyframe_weight: f64,
    /// Whether lag and focal ratio of colour are estimated, and corrected once they are certain.
    pub correct: bool,
    /// Whether the pose that they agree on is an initial guess.
    #[serde(skip)]
    pub gives_guess: bool,
    /// Whether their weight follows from the residual against the surfaces.
    #[serde(skip)]
    pub weight_by_residual: bool,
}

impl Default for FeatureUse {
    fn default() -> Self {
        Self {
            enabled: true,
            weight: 0.1,
            keyframe_weight: 0.1,
            correct: true,
            gives_guess: true,
            weight_by_residual: true,
        }
    }
}

impl FeatureUse {
    /// The extractor for the colour images of a camera; it finds nothing where features are off or
    /// colour is not registered to depth.
    pub fn extractor(&self, camera: &Camera, isa: Isa) -> Extractor {
        let is_on = self.enabled && camera.colour_registered;
        let size_px = [camera.width as usize, camera.height as usize];
        Extractor::new(is_on.then(FeatureSettings::default), size_px, isa.arch())
    }

    pub(super) fn check(&self) -> Result<(), SettingError> {
        check_range("features.weight", self.weight, 0.0, 1e3)?;
        check_range("features.keyframe_weight", self.keyframe_weight, 0.0, 1e3)
    }
}
