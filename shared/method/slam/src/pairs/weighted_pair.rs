//! Features that two views share, as a term of their alignment.

use crate::pairs::residuals;
use std::sync::Arc;
use tessera_features::Correspondence;
use tessera_geometry::Pose;
use tessera_graph::BlockSums;

/// Matches that agree on a relative pose.
#[derive(Clone, Debug)]
pub(crate) struct FeaturePair {
    pub(crate) target_from_query: Pose,
    pub(crate) inliers: Vec<Correspondence>,
    /// Of the variances of the inliers.
    pub(crate) variance_factor: f64,
    /// Of the inliers, about that pose, metric.
    pub(crate) sums: BlockSums,
}

impl FeaturePair {
    /// Of matches that agree on a pose.
    pub(crate) fn new(target_from_query: Pose, inliers: Vec<Correspondence>) -> Self {
        let (variance_factor, sums) = residuals::variance_and_sums(&inliers, &target_from_query);
        Self { target_from_query, inliers, variance_factor, sums }
    }
}

/// Mean squared normalised error at which a pair has its full weight, at most: two standard deviations.
const MEAN_SQ: f64 = 4.0;

/// A pair as an alignment takes it: with its weight in the units of the blocks' information.
#[derive(Clone, Debug)]
pub(crate) struct WeightedPair {
    pub(crate) found: Arc<FeaturePair>,
    pub(crate) weight: f64,
}

impl WeightedPair {
    /// `weight`: of metric information in the units of the blocks, where the pair agrees with `start`. Features that
    /// lie far beyond their noise there are of another scene or time.
    pub(crate) fn new(found: Arc<FeaturePair>, weight: f64, start: &Pose) -> Self {
        let cost = found.sums.about(&found.target_from_query, start).c;
        let mean_sq = cost * found.variance_factor / f64::from(found.sums.n.max(1));
        Self { found, weight: weight * MEAN_SQ / mean_sq.max(MEAN_SQ) }
    }

    /// Adds the features' residuals to a pair's sums, which are about `target_from_query`.
    pub(crate) fn add_to(&self, sums: &mut BlockSums, target_from_query: &Pose) {
        let seen = self.found.sums.about(&self.found.target_from_query, target_from_query);
        sums.add_scaled(&seen, self.weight);
    }
}
