//! Settings of sampling, search and weights.

use serde::{Deserialize, Serialize};
use tessera_numerics::{Isa, MethodVariant, SettingError, check_range};

/// Settings of the alignment (method 4, method 5 and method 10).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RegistrationSettings {
    /// Query points drawn uniformly over the image.
    pub uniform_samples: u32,
    /// Query points drawn uniformly over normal directions.
    pub normal_space_samples: u32,
    /// Seed of the samples, mixed with the frame's index.
    pub seed: u64,
    /// Search for a query's partner, and weights of the correspondences.
    pub variant: MethodVariant,
    /// Vector instructions; `run.isa` sets them for all algorithms.
    #[serde(skip)]
    pub isa: Isa,
}

impl Default for RegistrationSettings {
    fn default() -> Self {
        Self {
            uniform_samples: 800,
            normal_space_samples: 1200,
            seed: 0,
            variant: MethodVariant::Tessera,
            isa: Isa::Auto,
        }
    }
}

impl RegistrationSettings {
    /// Variance along the normal over the variance across it (eq. 9, epsilon).
    pub fn covariance_epsilon(&self) -> f32 {
        if self.variant.is_paper() { 1e-3 } else { 1e-4 }
    }

    /// Checks every range, NaN included.
    ///
    /// # Errors
    /// Names the first key that is out of range, its value and the rule.
    pub fn check(&self) -> Result<(), SettingError> {
        check_range("uniform_samples", self.uniform_samples.into(), 0.0, 1e6)?;
        check_range("normal_space_samples", self.normal_space_samples.into(), 0.0, 1e6)
    }
}
