//! Absolute trajectory error: distances after the best rigid alignment.

use crate::align::align_rigid;
use crate::associate::{associate_evo, associate_tum};
use crate::error::EvaluationError;
use crate::{Statistics, Trajectory};
use nalgebra::Vector3;
use tessera_geometry::Pose;

/// How poses are paired for the ATE.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AteOptions {
    /// Largest difference of paired times, seconds.
    pub max_difference_s: f64,
    /// Added to the estimate's times, seconds.
    pub offset_s: f64,
}

impl Default for AteOptions {
    fn default() -> Self {
        Self { max_difference_s: 0.02, offset_s: 0.0 }
    }
}

/// The absolute trajectory error.
#[derive(Clone, Debug, PartialEq)]
pub struct Ate {
    /// Index in the ground truth and index in the estimate of each pair.
    pub pairs: Vec<(usize, usize)>,
    /// Distance of each pair after alignment, metres.
    pub errors_m: Vec<f64>,
    /// The errors summed up, metres.
    pub statistics_m: Statistics,
    /// The alignment.
    pub groundtruth_from_estimate: Pose,
}

/// ATE as `evaluate_ate.py` defines it: no scale, greedy one-to-one pairs.
///
/// # Errors
/// Fewer than two poses can be paired.
pub fn ate(
    estimate: &Trajectory,
    groundtruth: &Trajectory,
    options: &AteOptions,
) -> Result<Ate, EvaluationError> {
    let (truth_s, estimate_s) = (groundtruth.seconds(), estimate.seconds());
    let pairs = associate_tum(&truth_s, &estimate_s, options.max_difference_s, options.offset_s);
    aligned(estimate, groundtruth, pairs, options.max_difference_s)
}

/// Absolute pose error (translation part) as evo defines it: Umeyama alignment without scale,
/// each pose of the shorter trajectory with the nearest of the longer.
///
/// # Errors
/// Fewer than two poses can be paired.
pub fn ape_evo(
    estimate: &Trajectory,
    groundtruth: &Trajectory,
    max_difference_s: f64,
) -> Result<Ate, EvaluationError> {
    let pairs = associate_evo(&groundtruth.seconds(), &estimate.seconds(), max_difference_s);
    aligned(estimate, groundtruth, pairs, max_difference_s)
}

fn aligned(
    estimate: &Trajectory,
    groundtruth: &Trajectory,
    pairs: Vec<(usize, usize)>,
    max_difference_s: f64,
) -> Result<Ate, EvaluationError> {
    if pairs.len() < 2 {
        return Err(EvaluationError::too_few_pairs(pairs.len(), estimate, groundtruth, max_difference_s));
    }
    let (source, target) = paired_positions(estimate, groundtruth, &pairs);
    let groundtruth_from_estimate = align_rigid(&source, &target);
    let errors_m: Vec<f64> = source
        .iter()
        .zip(&target)
        .map(|(a, b)| {
            let moved = groundtruth_from_estimate.rotation * a + groundtruth_from_estimate.translation.vector;
            (moved - b).norm()
        })
        .collect();
    let statistics_m = Statistics::of(&errors_m).unwrap_or_default();
    Ok(Ate { pairs, errors_m, statistics_m, groundtruth_from_estimate })
}

/// Positions of the estimate and of the ground truth, pair by pair.
pub(crate) fn paired_positions(
    estimate: &Trajectory,
    groundtruth: &Trajectory,
    pairs: &[(usize, usize)],
) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
    let position = |trajectory: &Trajectory, at: usize| trajectory.poses[at].translation.vector;
    (
        pairs.iter().map(|&(_, at)| position(estimate, at)).collect(),
        pairs.iter().map(|&(at, _)| position(groundtruth, at)).collect(),
    )
}
