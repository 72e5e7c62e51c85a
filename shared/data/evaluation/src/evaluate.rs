//! Everything that `tessera evaluate` and a run's summary say about a trajectory.

use crate::align::align_similarity;
use crate::ate::{AteOptions, ate, paired_positions};
use crate::error::EvaluationError;
use crate::offset::best_time_offset_s;
use crate::rpe::{RpeOptions, rpe};
use crate::{Statistics, Trajectory};
use serde::Serialize;

/// What to report beside the standard figures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EvaluationOptions {
    /// Report the best constant offset of stamps and the figures under it.
    pub time_offset: bool,
    /// Report the ATE with scale corrected.
    pub scale: bool,
}

/// How much was compared.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Coverage {
    /// Poses in the estimate.
    pub estimate_poses: usize,
    /// Share of the estimate's poses that were compared, 0 to 1.
    pub share_of_estimate: f64,
    /// Share of the ground truth's duration between the first and the last pose compared, 0 to 1.
    /// Small where a run stopped early, whose ATE then flatters it.
    pub share_of_groundtruth_time: f64,
}

/// Further figures: with the best constant offset of the estimate's stamps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TimeOffsetReport {
    /// Seconds added to the estimate's stamps.
    pub offset_s: f64,
    /// ATE under that offset, metres.
    pub ate_rmse_m: f64,
    /// RPE under that offset, metres per second; absent where the run is shorter than a second.
    pub rpe_translation_rmse_m_per_s: Option<f64>,
}

/// Further figures: with the scale corrected.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ScaleReport {
    /// Factor on the estimate that fits the ground truth best.
    pub scale: f64,
    /// ATE with that factor, metres.
    pub ate_rmse_m: f64,
}

/// The standard figures, and beside them what was asked for.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluation {
    /// Pairs compared by the ATE.
    pub pairs: usize,
    /// How much was compared.
    pub coverage: Coverage,
    /// ATE, RMSE, metres.
    pub ate_rmse_m: f64,
    /// ATE, all figures, metres.
    pub ate_m: Statistics,
    /// How far the last compared pose is off, seen from the first one, metres: the drift over the
    /// whole run, and where it ends at its start, how well the end meets it.
    pub end_error_m: f64,
    /// Pairs compared by the RPE.
    pub rpe_pairs: usize,
    /// RPE over one second, translation, RMSE; absent where the run is shorter than a second.
    pub rpe_translation_rmse_m_per_s: Option<f64>,
    /// RPE over one second, rotation, RMSE.
    pub rpe_rotation_rmse_deg_per_s: Option<f64>,
    /// RPE over one second, translation, all figures, metres per second.
    pub rpe_translation_m_per_s: Option<Statistics>,
    /// RPE over one second, rotation, all figures, degrees per second.
    pub rpe_rotation_deg_per_s: Option<Statistics>,
    /// With the best constant offset, if asked for and if there is enough overlap.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub with_time_offset: Option<TimeOffsetReport>,
    /// With the scale corrected, if asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub with_scale: Option<ScaleReport>,
}

/// Compares an estimate with the ground truth.
///
/// # Errors
/// Fewer than two poses can be paired.
pub fn evaluate(
    estimate: &Trajectory,
    groundtruth: &Trajectory,
    options: &EvaluationOptions,
) -> Result<Evaluation, EvaluationError> {
    let ate_standard = ate(estimate, groundtruth, &AteOptions::default())?;
    let rpe_standard = rpe(estimate, groundtruth, &RpeOptions::default()).ok();
    let with_time_offset = options
        .time_offset
        .then(|| best_time_offset_s(estimate, groundtruth))
        .flatten()
        .and_then(|offset_s| time_offset_report(estimate, groundtruth, offset_s));
    let with_scale = options.scale.then(|| scale_report(estimate, groundtruth, &ate_standard.pairs));
    Ok(Evaluation {
        pairs: ate_standard.pairs.len(),
        coverage: coverage(estimate, groundtruth, &ate_standard.pairs),
        ate_rmse_m: ate_standard.statistics_m.rmse,
        ate_m: ate_standard.statistics_m,
        end_error_m: end_error_m(estimate, groundtruth, &ate_standard.pairs),
        rpe_pairs: rpe_standard.as_ref().map_or(0, |rpe| rpe.pairs.len()),
        rpe_translation_rmse_m_per_s: rpe_standard.as_ref().map(|rpe| rpe.translation_m.rmse),
        rpe_rotation_rmse_deg_per_s: rpe_standard.as_ref().map(|rpe| rpe.rotation_deg.rmse),
        rpe_translation_m_per_s: rpe_standard.as_ref().map(|rpe| rpe.translation_m),
        rpe_rotation_deg_per_s: rpe_standard.as_ref().map(|rpe| rpe.rotation_deg),
        with_time_offset,
        with_scale,
    })
}

fn coverage(estimate: &Trajectory, groundtruth: &Trajectory, pairs: &[(usize, usize)]) -> Coverage {
    let span_s = |from: usize, to: usize| {
        groundtruth.stamps_nanos[to].saturating_sub(groundtruth.stamps_nanos[from]) as f64 * 1e-9
    };
    let whole_s = span_s(0, groundtruth.len() - 1);
    let compared_s = match pairs {
        [(first, _), .., (last, _)] => span_s(*first, *last),
        _ => 0.0,
    };
    Coverage {
        estimate_poses: estimate.len(),
        share_of_estimate: pairs.len() as f64 / estimate.len() as f64,
        share_of_groundtruth_time: if whole_s > 0.0 { compared_s / whole_s } else { 1.0 },
    }
}

fn end_error_m(estimate: &Trajectory, groundtruth: &Trajectory, pairs: &[(usize, usize)]) -> f64 {
    let (Some(first), Some(last)) = (pairs.first(), pairs.last()) else { return 0.0 };
    let found = estimate.poses[first.1].inverse() * estimate.poses[last.1];
    let expected = groundtruth.poses[first.0].inverse() * groundtruth.poses[last.0];
    (expected.inverse() * found).translation.vector.norm()
}

fn time_offset_report(
    estimate: &Trajectory,
    groundtruth: &Trajectory,
    offset_s: f64,
) -> Option<TimeOffsetReport> {
    const NO_WORSE: f64 = 1.001;
    let without = ate(estimate, groundtruth, &AteOptions::default()).ok()?.statistics_m.rmse;
    let ate = ate(estimate, groundtruth, &AteOptions { offset_s, ..AteOptions::default() }).ok()?;
    if ate.statistics_m.rmse > NO_WORSE * without {
        return None;
    }
    let rpe = rpe(estimate, groundtruth, &RpeOptions { offset_s, ..RpeOptions::default() }).ok();
    Some(TimeOffsetReport {
        offset_s,
        ate_rmse_m: ate.statistics_m.rmse,
        rpe_translation_rmse_m_per_s: rpe.map(|rpe| rpe.translation_m.rmse),
    })
}

fn scale_report(estimate: &Trajectory, groundtruth: &Trajectory, pairs: &[(usize, usize)]) -> ScaleReport {
    let (source, target) = paired_positions(estimate, groundtruth, pairs);
    let similarity = align_similarity(&source, &target);
    let errors_m: Vec<f64> =
        source.iter().zip(&target).map(|(a, b)| (similarity.apply(a) - b).norm()).collect();
    ScaleReport { scale: similarity.scale, ate_rmse_m: Statistics::of(&errors_m).unwrap_or_default().rmse }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_geometry::Pose;

    fn spiral(n: i64, scale: f64) -> Trajectory {
        let mut trajectory = Trajectory::default();
        for k in 0..n {
            let t = k as f64 * 0.05;
            let pose = Pose::translation(t.sin() * scale, t.cos() * scale, 0.1 * t * scale);
            trajectory.push(k * 50_000_000, pose).unwrap();
        }
        trajectory
    }

    #[test]
    fn scale_and_offset_stand_beside_the_standard_figures() {
        let options = EvaluationOptions { time_offset: true, scale: true };
        let with = evaluate(&spiral(200, 0.5), &spiral(200, 1.0), &options).unwrap();
        let without = evaluate(&spiral(200, 0.5), &spiral(200, 1.0), &EvaluationOptions::default()).unwrap();
        assert_eq!(with.ate_m, without.ate_m);
        let scale = with.with_scale.unwrap();
        assert!((scale.scale - 2.0).abs() < 1e-9 && scale.ate_rmse_m < 1e-9, "{scale:?}");
        assert!(with.ate_rmse_m > 0.3);
    }

    #[test]
    fn the_end_is_seen_from_the_first_pose() {
        let truth = spiral(200, 1.0);
        let mut drifted = Trajectory::default();
        let elsewhere = Pose::translation(5.0, 0.0, 1.0);
        for (stamp, pose) in truth.stamps_nanos.iter().zip(&truth.poses) {
            let drift_m = *stamp as f64 / truth.stamps_nanos[199] as f64 * 0.25;
            drifted.push(*stamp, elsewhere * pose * Pose::translation(0.0, drift_m, 0.0)).unwrap();
        }
        let result = evaluate(&drifted, &truth, &EvaluationOptions::default()).unwrap();
        assert!((result.end_error_m - 0.25).abs() < 1e-9, "{}", result.end_error_m);
    }

    #[test]
    fn a_run_that_stopped_early_shows_its_coverage() {
        let result = evaluate(&spiral(50, 1.0), &spiral(200, 1.0), &EvaluationOptions::default()).unwrap();
        assert_eq!(result.pairs, 50);
        assert_eq!(result.coverage.share_of_estimate, 1.0);
        assert!((result.coverage.share_of_groundtruth_time - 49.0 / 199.0).abs() < 1e-12);
    }

    #[test]
    fn times_that_do_not_meet_are_an_error_that_shows_both() {
        let mut late = spiral(5, 1.0);
        late.stamps_nanos.iter_mut().for_each(|t| *t += 100_000_000_000);
        let message =
            evaluate(&late, &spiral(5, 1.0), &EvaluationOptions::default()).unwrap_err().to_string();
        assert!(message.contains("found 0 pairs within 0.02 s, expected at least 2"), "{message}");
        assert!(message.contains("100.000000 to 100.200000"), "{message}");
    }

    #[test]
    fn a_run_shorter_than_a_second_has_no_relative_error() {
        let result = evaluate(&spiral(5, 1.0), &spiral(5, 1.0), &EvaluationOptions::default()).unwrap();
        assert_eq!((result.rpe_pairs, result.rpe_translation_rmse_m_per_s), (0, None));
    }
}
