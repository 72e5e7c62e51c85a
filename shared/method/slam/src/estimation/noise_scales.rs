//! Variance components of surfaces and features, estimated while the run goes on (method 9.5).
//!
//! A reference that shares both kinds of measurement with a frame gives the relative pose twice: from
//! surfaces with normal matrix `N_s` and gradient `g_s`, from features with `N_f` and `g_f`, each under its
//! sensor's model. With the covariances `s_s^2 N_s^-1` and `s_f^2 N_f^-1`, the part of the two solutions'
//! disagreement that belongs to a kind `k` at their joint optimum is `q_k`, its redundancy
//! `r_k = 6 - tr(N_k N^-1)`, and Förstner's estimator `s_k^2 <- s_k^2 sum q_k / sum r_k` is a step of
//! expectation maximisation (Förstner 1979; Teunissen and Amiri-Simkooei, J. Geodesy 2008).
//!
//! As poses are compared, not points, the scales hold what all matches of a kind err by together
//! (calibration, lag, blur, the filter's correlation): the error of the reference's own pose alone cancels.
//!
//! Surfaces alone give the relative pose twice as well, from the upper and from the lower half of the image. The one
//! scale under which both agree is the prior of `s_s^2`.

use crate::estimation::FORGETTING;
use serde::{Deserialize, Serialize};

/// Degrees of freedom of the prior: about what four frames with both kinds add.
pub(crate) const PRIOR_FREEDOM: f64 = 20.0;
/// Scale of the surfaces before any were compared.
const SURFACE_SCALE: f64 = 0.05;

/// A frame's evidence of the scales: sums over its pairs, divided by their number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NoiseRecord {
    /// Squared disagreement of the surfaces of both halves of the image in units of their model, and its redundancy.
    pub halves: [f64; 2],
    /// Squared disagreement that falls to surfaces and to features, in units of their models.
    pub squared: [f64; 2],
    /// Redundancy of each.
    pub redundancy: [f64; 2],
    /// Mean variance factor of the matches of its pairs, and 1 where it has pairs with features, else nothing.
    pub variance_factor: [f64; 2],
    /// Variance of the pose along and about each axis of the camera with its references fixed, m^2 and rad^2;
    /// nothing where a direction is degenerate.
    pub step_variance: Option<[f64; 6]>,
}

/// The scales as of all frames so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NoiseState {
    halves: [f64; 2],
    squared: [f64; 2],
    redundancy: [f64; 2],
    variance_factor: [f64; 2],
}

/// Factors of the covariances that the sensors' models state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseScales {
    /// Of a pose from surfaces.
    pub surfaces: f64,
    /// Of a pose from features.
    pub features: f64,
}

impl NoiseState {
    /// The state as of these records, in order of frames.
    pub fn of_records<'a>(records: impl IntoIterator<Item = &'a NoiseRecord>) -> Self {
        let mut state = Self::default();
        records.into_iter().for_each(|record| state.apply(record));
        state
    }

    /// Takes a frame's record in.
    pub(crate) fn apply(&mut self, record: &NoiseRecord) {
        let kept = 1.0 - FORGETTING;
        for k in 0..2 {
            self.halves[k] = kept * self.halves[k] + record.halves[k];
            self.squared[k] = kept * self.squared[k] + record.squared[k];
            self.redundancy[k] = kept * self.redundancy[k] + record.redundancy[k];
            self.variance_factor[k] = kept * self.variance_factor[k] + record.variance_factor[k];
        }
    }

    /// The scales: the evidence with the prior's degrees of freedom.
    pub fn scales(&self) -> NoiseScales {
        let scale =
            |squared, redundancy, prior| (squared + PRIOR_FREEDOM * prior) / (redundancy + PRIOR_FREEDOM);
        let of_halves = scale(self.halves[0], self.halves[1], SURFACE_SCALE);
        NoiseScales {
            surfaces: scale(self.squared[0], self.redundancy[0], of_halves),
            // Before any was compared the features' own model holds for a pair of the usual variance.
            features: scale(self.squared[1], self.redundancy[1], 1.0 / self.usual_variance_factor()),
        }
    }

    /// Mean of the variance factors by which the pairs of features were divided.
    fn usual_variance_factor(&self) -> f64 {
        let [sum, n] = self.variance_factor;
        if n > 0.0 { sum / n } else { 1.0 }
    }

    /// Relative standard deviation of each scale, surfaces first: that of a chi-square of as many degrees of freedom.
    pub fn relative_deviations(&self) -> [f64; 2] {
        self.redundancy.map(|r| (2.0 / (r + PRIOR_FREEDOM)).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_features_the_scale_is_that_of_the_halves() {
        let mut state = NoiseState::default();
        for _ in 0..1000 {
            state.apply(&NoiseRecord { halves: [6.0 * 0.2, 6.0], ..NoiseRecord::default() });
        }
        let scales = state.scales();
        assert!((scales.surfaces - 0.2).abs() < 0.01, "{scales:?}");
        assert_eq!(scales.features, 1.0);
    }

    #[test]
    fn the_usual_variance_of_pairs_is_no_evidence_that_features_know_poses_better() {
        let mut state = NoiseState::default();
        let record = NoiseRecord { variance_factor: [0.5, 1.0], ..NoiseRecord::default() };
        for _ in 0..10 {
            state.apply(&record);
        }
        assert!((state.scales().features * 0.5 - 1.0).abs() < 1e-12, "{:?}", state.scales());
    }
}
