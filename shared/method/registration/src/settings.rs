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

/// How correspondences are found and rejected (method 10).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SearchSettings {
    /// How a query's partner is found.
    pub method: SearchMethod,
    /// Cells between the neighbours that a descent compares first, in the first outer iteration:
    /// 1, 2, 4 or 8; from coarse to fine.
    pub first_stride: u32,
    /// Steps of the descent to the nearest vertex in the first outer iteration, grid cells.
    pub first_reach: u32,
    /// Steps of the descent in the last outer iteration, grid cells.
    pub last_reach: u32,
    /// Least cosine between normals in the first outer iteration.
    pub first_normal_cosine: f32,
    /// Least cosine between normals in the last outer iteration.
    pub last_normal_cosine: f32,
    /// Whether a target vertex serves only its nearest query.
    pub one_to_one: bool,
    /// Distances beyond this factor of the median are rejected; 0 switches it off.
    pub median_factor: f32,
}

impl Default for SearchSettings {
    fn default() -> Self {
        Self {
            method: SearchMethod::Projective,
            first_stride: 1,
            first_reach: 4,
            last_reach: 2,
            first_normal_cosine: 0.707,
            last_normal_cosine: 0.866,
            one_to_one: true,
            median_factor: 3.0,
        }
    }
}

/// When brightness is a residual beside geometry (method 12.1). Never where the camera's colours are
/// not registered to its depth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BrightnessUse {
    /// Never: geometry alone, as in the paper.
    #[default]
    Off,
    /// Where geometry leaves a direction free: a wall, a corridor.
    WhereFree,
    /// In each alignment: for cameras whose colour and depth are exposed at the same time.
    Always,
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
    /// When brightness counts too.
    pub brightness: BrightnessUse,
    /// Standard deviation of a difference of brightness, 0 to 1.
    pub brightness_sigma: f32,
}

impl Default for WeightSettings {
    fn default() -> Self {
        Self {
            covariance_epsilon: 1e-4,
            noise_scaled: true,
            robust_sigmas: 1.0,
            brightness: BrightnessUse::Off,
            brightness_sigma: 0.1,
        }
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
    /// Points beyond this depth are not sampled, metres.
    pub max_sample_depth_m: f32,
    /// Seed of the samples, mixed with the frame's index.
    pub seed: u64,
    /// Most inner iterations for one set of correspondences.
    pub inner_iterations: u32,
    /// Search and rejection.
    pub search: SearchSettings,
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
            max_sample_depth_m: 5.0,
            seed: 0,
            inner_iterations: 10,
            search: SearchSettings::default(),
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
        check_range("max_sample_depth_m", self.max_sample_depth_m.into(), 0.5, 50.0)?;
        check_range("inner_iterations", self.inner_iterations.into(), 1.0, 100.0)?;
        let s = &self.search;
        if !matches!(s.first_stride, 1 | 2 | 4 | 8) {
            return Err(SettingError {
                key: "search.first_stride",
                found: s.first_stride.to_string(),
                rule: "1, 2, 4 or 8".into(),
            });
        }
        check_range("search.first_reach", s.first_reach.into(), 0.0, 20.0)?;
        check_range("search.last_reach", s.last_reach.into(), 0.0, 20.0)?;
        check_range("search.first_normal_cosine", s.first_normal_cosine.into(), -1.0, 1.0)?;
        check_range("search.last_normal_cosine", s.last_normal_cosine.into(), -1.0, 1.0)?;
        check_range("search.median_factor", s.median_factor.into(), 0.0, 1e3)?;
        let w = &self.weight;
        check_range("weight.covariance_epsilon", w.covariance_epsilon.into(), 1e-6, 1.0)?;
        check_range("weight.robust_sigmas", w.robust_sigmas.into(), 0.0, 1e3)?;
        check_range("weight.brightness_sigma", w.brightness_sigma.into(), 0.001, 1.0)
    }
}
