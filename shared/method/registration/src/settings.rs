//! Settings of sampling, search, weights and the optimiser.

use serde::{Deserialize, Serialize};
use tessera_numerics::{Isa, SettingError, check_range};

/// How a query's partner on the target is found (method 10.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SearchMethod {
    /// Descent from the cell that sees the query: a few cells are read, and no tree is built.
    #[default]
    Projective,
    /// The nearest vertex anywhere, by a tree: the paper's.
    Exact,
}

/// How much a correspondence counts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WeightSettings {
    /// Variance along the normal over the variance across it (eq. 9, epsilon).
    pub covariance_epsilon: f32,
    /// Whether far, noisy points count less, by the inverse variance of their depth.
    pub noise_scaled: bool,
    /// Cauchy kernel on the normal residual, in standard deviations of depth; 0 switches it off.
    pub robust_sigmas: f32,
}

impl Default for WeightSettings {
    fn default() -> Self {
        Self { covariance_epsilon: 1e-4, noise_scaled: true, robust_sigmas: 1.0 }
    }
}

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
    /// Search for a query's partner.
    pub search: SearchMethod,
    /// Weights.
    pub weight: WeightSettings,
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
            search: SearchMethod::Projective,
            weight: WeightSettings::default(),
            isa: Isa::Auto,
        }
    }
}

impl RegistrationSettings {
    /// Checks every range, NaN included.
    ///
    /// # Errors
    /// Names the first key that is out of range, its value and the rule.
    pub fn check(&self) -> Result<(), SettingError> {
        check_range("uniform_samples", self.uniform_samples.into(), 0.0, 1e6)?;
        check_range("normal_space_samples", self.normal_space_samples.into(), 0.0, 1e6)?;
        let w = &self.weight;
        check_range("weight.covariance_epsilon", w.covariance_epsilon.into(), 1e-6, 1.0)?;
        check_range("weight.robust_sigmas", w.robust_sigmas.into(), 0.0, 1e3)
    }
}
