//! Standard deviations of the camera's parameters by a jackknife over keyframes.

use crate::parameters::Parameters;
use crate::residuals::PairSums;
use crate::system::{CameraMatrix, Reduced};
use crate::widths::Widths;

/// Runs of consecutive keyframes whose residuals count as independent: neighbours see the same
/// walls with the same errors.
const MOST_RUNS: usize = 10;
/// What all runs have in common no jackknife sees: where the truth is known (room, kitchen_exact_120),
/// errors are up to this many times the spread between runs.
const COMMON_ERRORS: f64 = 3.0;

/// The gradient's variance as the residuals themselves show it, whatever correlates them: a
/// jackknife over runs of keyframes. For each run the camera is solved for without the pairs
/// that touch it, in one step; how far that moves the camera is how well the camera is known.
/// Each pair is left out twice, so the variance is somewhat too large rather than too small.
///
/// `unit`: variance of a residual of weight one. `None` when a system has no solution.
pub(crate) fn gradient_variance(
    reduced: &Reduced,
    pairs: &[PairSums],
    n_poses: usize,
    widths: &Widths,
    unit: f64,
) -> Option<CameraMatrix> {
    let (to, from) = (widths.to_parameters, widths.from_parameters);
    let information = to.transpose() * reduced.information * to + CameraMatrix::identity() * unit;
    // What is still to be gained is no noise: pulls are those after the whole step.
    let step = -(to * information.cholesky()?.solve(&(to.transpose() * reduced.gradient)));
    let n_runs = n_poses.min(MOST_RUNS);
    let run_of = |pose: usize| pose * n_runs / n_poses.max(1);
    let mut runs = vec![(CameraMatrix::zeros(), Parameters::zeros()); n_runs];
    for pair in pairs {
        let (h, g) = reduced.share_of(pair, &step);
        let (query, target) = (run_of(pair.query), run_of(pair.target));
        for run in [query].into_iter().chain((target != query).then_some(target)) {
            runs[run].0 += to.transpose() * h * to;
            runs[run].1 += to.transpose() * g;
        }
    }
    let mut covariance = CameraMatrix::zeros();
    for (of_run, pull) in &runs {
        let moved = (information - of_run).cholesky()?.solve(pull);
        covariance += moved * moved.transpose();
    }
    covariance *= COMMON_ERRORS.powi(2) * (n_runs as f64 - 1.0) / n_runs as f64;
    let variance = information * covariance * information;
    Some(from.transpose() * variance * from)
}
