//! Whether the pose on which two keyframes' features agree is one that the track allows.
//!
//! A dozen features agree by chance as well, where texture repeats. Loops are weighed against each other; nothing
//! weighs a pair that closes none.

use crate::evidence::pose_agreement::is_allowed;
use crate::map::state::KeyframeState;
use crate::pairs::weighted_pair::FeaturePair;
use tessera_graph::PairBlock;

/// Whether the features' relative pose agrees with that of the keyframes; `variance_scale`: of the features.
pub(crate) fn is_of_track(
    keyframes: (&KeyframeState, &KeyframeState),
    found: &FeaturePair,
    variance_scale: f64,
) -> bool {
    let pose = found.target_from_query;
    let information = PairBlock::new(&pose, &found.sums).linearise(&pose).0;
    let inverse = information.try_inverse();
    inverse.is_none_or(|inverse| is_allowed(keyframes, pose, inverse * variance_scale))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::test_wall::keyframe;
    use nalgebra::{Matrix3, Vector3};
    use tessera_geometry::{Matrix6, Pose, upper_triangle};
    use tessera_graph::BlockSums;

    /// Features that agree on a pose, to 3 mm each.
    fn found(x_m: f64, n: u32) -> FeaturePair {
        let mut sums = BlockSums::default();
        for k in 0..n {
            let [row, column] = [k / 4, k % 4].map(f64::from);
            let point = Vector3::new(0.3 * row - 0.5, 0.3 * column - 0.5, 2.0 + 0.1 * (row - column));
            sums.add(&point, &Vector3::zeros(), &(Matrix3::identity() / (0.003 * 0.003)));
            sums.n += 1;
        }
        FeaturePair {
            target_from_query: Pose::translation(x_m, 0.0, 0.0),
            inliers: Vec::new(),
            variance_factor: 1.0,
            sums,
        }
    }

    #[test]
    fn features_that_agree_far_from_the_track_are_refused() {
        let with = |id: u32, x_m: f64, sigma: f64| {
            let covariance = upper_triangle(&(Matrix6::identity() * (sigma * sigma))).to_vec();
            crate::map::state::KeyframeState { covariance, ..keyframe(id, 0, x_m) }
        };
        let (older, newer) = (with(0, 0.0, 0.001), with(1, 0.1, 0.004));
        let is_of_track = |found: &FeaturePair| is_of_track((&newer, &older), found, 1.0);
        assert!(is_of_track(&found(0.1, 16)) && is_of_track(&found(0.11, 16)));
        assert!(!is_of_track(&found(0.2, 16)), "by 0.1 m");
        assert!(is_of_track(&found(0.2, 1)), "one feature has no pose");
        let unknown = crate::map::state::KeyframeState { covariance: Vec::new(), ..newer.clone() };
        assert!(super::is_of_track((&unknown, &older), &found(0.2, 16), 1.0));
        let drifted = with(1, 0.1, 0.05);
        assert!(super::is_of_track((&drifted, &older), &found(0.2, 16), 1.0), "drift allows it");
    }
}
