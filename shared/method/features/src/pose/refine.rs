//! Iteratively reweighted least squares over all correspondences.

use super::correspondence::Correspondence;
use super::linearise::{NormalEquations, RelativeMotion, ReprojectionResidual, linearise};
use crate::settings::PoseSettings;
use tessera_geometry::{Pose, Twist, compose_normalised};

/// Squared normalised error of an inlier at most: the same share of a chi-square distribution of
/// two and of three dimensions.
#[inline(always)]
pub(crate) fn limit_sq(residual: &ReprojectionResidual, inlier_sigmas: f64) -> f64 {
    let of_dimensions = if residual.n_dimensions > 2.5 { 1.25 } else { 1.0 };
    inlier_sigmas * inlier_sigmas * of_dimensions
}

/// Errors beyond this times the limit have weight 0 (in squares), so that far outliers do not add up.
const CUT: f64 = 4.0;

/// A step of a tenth of the pose's standard deviation is the last.
const STILL_SQ: f64 = 0.01;

/// Least squares with the weights of Geman and McClure from a first pose; `None` where the
/// correspondences near it do not determine a pose.
#[inline(always)]
pub(crate) fn refine(
    correspondences: &[Correspondence],
    start: &Pose,
    settings: &PoseSettings,
    n_iterations: u32,
) -> Option<Pose> {
    let mut target_from_query = *start;
    for _ in 0..n_iterations {
        let motion = RelativeMotion::from(&target_from_query);
        let mut normal = NormalEquations::zero();
        // A closure would be compiled apart, for the oldest processors.
        for correspondence in correspondences {
            let Some(residual) = linearise(correspondence, &motion) else { continue };
            let relative = residual.squared / limit_sq(&residual, settings.inlier_sigmas);
            if relative < CUT {
                let weight = 1.0 / (1.0 + relative);
                normal.add(&residual, weight * weight);
            }
        }
        let delta = normal.solve()?;
        target_from_query = compose_normalised(&target_from_query, &Twist::from_vector(&delta));
        // The squared step in standard deviations of the pose.
        if !(normal.gradient.dot(&delta) > STILL_SQ) {
            break;
        }
    }
    Some(target_from_query)
}

/// Gauss-Newton steps over a minimal sample, which its covariances overdetermine: the bearings are
/// far better known than the depths.
pub(crate) fn polish(sample: &[&Correspondence; 3], start: &Pose, n_iterations: u32) -> Option<Pose> {
    let mut target_from_query = *start;
    for _ in 0..n_iterations {
        let motion = RelativeMotion::from(&target_from_query);
        let mut normal = NormalEquations::zero();
        for correspondence in sample {
            normal.add(&linearise(correspondence, &motion)?, 1.0);
        }
        target_from_query = compose_normalised(&target_from_query, &Twist::from_vector(&normal.solve()?));
    }
    Some(target_from_query)
}
