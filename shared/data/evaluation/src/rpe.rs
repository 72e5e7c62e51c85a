//! Relative pose error: how the motion over a second differs from the true one.

use crate::error::EvaluationError;
use crate::{Statistics, Trajectory};
use tessera_geometry::{Pose, translation_rotation_norms};

/// Which motions the RPE compares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RpeOptions {
    /// Time from the earlier to the later pose, seconds.
    pub delta_s: f64,
    /// Added to the estimate's times, seconds.
    pub offset_s: f64,
}

impl Default for RpeOptions {
    fn default() -> Self {
        Self { delta_s: 1.0, offset_s: 0.0 }
    }
}

/// The relative pose error.
#[derive(Clone, Debug, PartialEq)]
pub struct Rpe {
    /// Indices in the estimate of the earlier and the later pose of each pair.
    pub pairs: Vec<(usize, usize)>,
    /// Translation part of each error, metres (per `delta_s`; the script does not divide by it).
    pub translation_errors_m: Vec<f64>,
    /// Rotation angle of each error, radians.
    pub rotation_errors_rad: Vec<f64>,
    /// Translation errors summed up, metres.
    pub translation_m: Statistics,
    /// Rotation errors summed up, degrees.
    pub rotation_deg: Statistics,
}

/// RPE as `evaluate_rpe.py --fixed_delta --delta_unit s --max_pairs 0` defines it.
///
/// For each pose the partner is the one nearest to `delta_s` later; pairs whose partner is the
/// last pose are passed over; ground truth is the nearest pose, refused when farther than twice
/// the median interval of the ground truth; motions are expressed in the later frame.
///
/// # Errors
/// No pair is left.
pub fn rpe(
    estimate: &Trajectory,
    groundtruth: &Trajectory,
    options: &RpeOptions,
) -> Result<Rpe, EvaluationError> {
    let estimate_s = estimate.seconds();
    let truth_s = groundtruth.seconds();
    let intervals_s: Vec<f64> = truth_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let Some(intervals) = Statistics::of(&intervals_s) else {
        return Err(EvaluationError::too_few_pairs(0, estimate, groundtruth, 0.0));
    };
    let limit_s = 2.0 * intervals.median;
    let truth_at = |index: usize| {
        let time_s = estimate_s[index] + options.offset_s;
        let at = find_closest(&truth_s, time_s);
        let apart_s = (truth_s[at] - time_s).abs();
        (apart_s <= limit_s).then(|| &groundtruth.poses[at])
    };
    let mut pairs = Vec::new();
    let mut translation_errors_m = Vec::new();
    let mut rotation_errors_rad = Vec::new();
    for (earlier, &time_s) in estimate_s.iter().enumerate() {
        let later = find_closest(&estimate_s, time_s + options.delta_s);
        if later + 1 == estimate_s.len() {
            continue;
        }
        let (Some(truth_earlier), Some(truth_later)) = (truth_at(earlier), truth_at(later)) else { continue };
        let motion = later_from_earlier(&estimate.poses[earlier], &estimate.poses[later]);
        let true_motion = later_from_earlier(truth_earlier, truth_later);
        let (translation, rotation) = translation_rotation_norms(&(motion.inverse() * true_motion));
        pairs.push((earlier, later));
        translation_errors_m.push(translation);
        rotation_errors_rad.push(rotation);
    }
    match (Statistics::of(&translation_errors_m), Statistics::of(&rotation_errors_rad)) {
        (Some(translation_m), Some(rotation_rad)) => Ok(Rpe {
            pairs,
            translation_errors_m,
            rotation_errors_rad,
            translation_m,
            rotation_deg: rotation_rad.scaled(180.0 / std::f64::consts::PI),
        }),
        _ => Err(EvaluationError::NoMotions { delta_s: options.delta_s }),
    }
}

fn later_from_earlier(world_from_earlier: &Pose, world_from_later: &Pose) -> Pose {
    world_from_later.inverse() * world_from_earlier
}

/// The script's own bisection, ties included: a list of one or more sorted times.
fn find_closest(sorted_s: &[f64], time_s: f64) -> usize {
    let (mut begin, mut end) = (0, sorted_s.len());
    let mut best = 0;
    let mut difference = (sorted_s[0] - time_s).abs();
    while begin < end {
        let middle = (begin + end) / 2;
        let here = (sorted_s[middle] - time_s).abs();
        if here < difference {
            difference = here;
            best = middle;
        }
        if sorted_s[middle] == time_s {
            return middle;
        } else if sorted_s[middle] > time_s {
            end = middle;
        } else {
            begin = middle + 1;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Translation3, UnitQuaternion, Vector3};

    fn turning(rate_rad_per_s: f64) -> Trajectory {
        let mut trajectory = Trajectory::default();
        for k in 0..40i64 {
            let t = k as f64 * 0.1;
            let rotation = UnitQuaternion::from_scaled_axis(Vector3::y() * (rate_rad_per_s * t));
            let pose = Pose::from_parts(Translation3::new(t, 0.0, 0.0), rotation);
            trajectory.push(k * 100_000_000, pose).unwrap();
        }
        trajectory
    }

    #[test]
    fn pairs_whose_partner_is_the_last_pose_are_passed_over() {
        let rpe = rpe(&turning(0.0), &turning(0.0), &RpeOptions::default()).unwrap();
        // Poses 0..=28 have their partner below 39; 29 and all later ones have 39.
        assert_eq!(rpe.pairs.len(), 29);
        assert_eq!(rpe.translation_m.max, 0.0);
    }

    #[test]
    fn a_turn_too_fast_shows_as_rotation_error() {
        let rpe = rpe(&turning(0.3), &turning(0.2), &RpeOptions::default()).unwrap();
        assert!((rpe.rotation_deg.rmse - 0.1f64.to_degrees()).abs() < 1e-9, "{:?}", rpe.rotation_deg);
    }

    #[test]
    fn the_bisection_finds_the_nearest() {
        let times = [0.0, 1.0, 2.0, 4.0];
        for (time, at) in [(-5.0, 0), (0.4, 0), (0.6, 1), (2.9, 2), (3.1, 3), (9.0, 3), (2.0, 2)] {
            assert_eq!(find_closest(&times, time), at, "{time}");
        }
    }
}
