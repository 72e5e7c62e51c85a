//! Settings of sparse features beside the surfaces (method 14.2).

use serde::{Deserialize, Serialize};
use tessera_features::{Extractor, FeatureSettings};
use tessera_geometry::Camera;
use tessera_numerics::Isa;

/// How features take part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FeatureUse {
    /// Whether features take part.
    pub enabled: bool,
    /// Whether lag and focal ratio of colour are estimated, and corrected once they are certain.
    pub correct: bool,
    /// Whether the pose that they agree on is an initial guess.
    #[serde(skip)]
    pub gives_guess: bool,
}

impl Default for FeatureUse {
    fn default() -> Self {
        Self { enabled: true, correct: true, gives_guess: true }
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
}
