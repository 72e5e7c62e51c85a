//! From angular rates to rotations at the times of the frames.

use super::{GyroSample, ImuModel};
use nalgebra::UnitQuaternion;
use tessera_geometry::{InertialRotation, rotation_exp};

/// Between samples farther apart than this nothing is known of the rotation, seconds.
const LONGEST_GAP_S: f64 = 0.05;
/// What the rate may be where nothing is known of it, radians per second.
const UNKNOWN_RATE_RAD_PER_S: f64 = 3.0;

/// The rotation at each stamp since the first one. Rates between two samples are taken to change
/// evenly; before the first, after the last and in gaps the nearest one holds, and the variance
/// says that this is a guess. Both lists increase.
pub fn rotations(model: &ImuModel, samples: &[GyroSample], stamps_nanos: &[i64]) -> Vec<InertialRotation> {
    let mut rotation = UnitQuaternion::identity();
    let mut variance_rad2 = 0.0;
    // Samples up to this one lie at or before `now`.
    let (Some(&start), false) = (stamps_nanos.first(), samples.is_empty()) else { return Vec::new() };
    let mut next = samples.partition_point(|s| s.stamp_nanos <= start);
    let mut now = start;
    stamps_nanos
        .iter()
        .map(|&stamp| {
            while now < stamp {
                let end = samples.get(next).map_or(stamp, |s| s.stamp_nanos.min(stamp));
                let seconds = end.saturating_sub(now) as f64 * 1e-9;
                let before = next.checked_sub(1).and_then(|at| samples.get(at)).copied();
                let after = samples.get(next).copied();
                let (rate, is_known) = mean_rate(before, after, now, end);
                rotation =
                    UnitQuaternion::new_normalize(*(rotation * rotation_exp(&(rate * seconds))).quaternion());
                variance_rad2 += if is_known {
                    model.noise_rad_per_s_sqrt_hz * model.noise_rad_per_s_sqrt_hz * seconds
                } else {
                    // Steady and unknown: the standard deviation grows in proportion to time.
                    (UNKNOWN_RATE_RAD_PER_S * seconds) * (UNKNOWN_RATE_RAD_PER_S * seconds)
                };
                now = end;
                next = next.saturating_add(usize::from(after.is_some_and(|s| s.stamp_nanos <= now)));
            }
            InertialRotation {
                start_from_camera_xyzw: [rotation.i, rotation.j, rotation.k, rotation.w],
                variance_rad2,
                bias_sigma_rad_per_s: model.bias_sigma_rad_per_s,
            }
        })
        .collect()
}

/// The rate in the middle of an interval that no sample divides, and whether it is more than a guess.
fn mean_rate(
    before: Option<GyroSample>,
    after: Option<GyroSample>,
    from: i64,
    to: i64,
) -> (nalgebra::Vector3<f64>, bool) {
    match (before, after) {
        (Some(a), Some(b)) => {
            let whole = b.stamp_nanos.saturating_sub(a.stamp_nanos) as f64;
            let since = |nanos: i64| nanos.saturating_sub(a.stamp_nanos) as f64;
            let middle = 0.5 * (since(from) + since(to));
            let rate = a.rate_rad_per_s.lerp(&b.rate_rad_per_s, middle / whole);
            (rate, whole <= LONGEST_GAP_S * 1e9)
        }
        (Some(only), None) => {
            (only.rate_rad_per_s, to.saturating_sub(only.stamp_nanos) as f64 <= LONGEST_GAP_S * 1e9)
        }
        (None, Some(only)) => {
            (only.rate_rad_per_s, only.stamp_nanos.saturating_sub(from) as f64 <= LONGEST_GAP_S * 1e9)
        }
        (None, None) => (nalgebra::Vector3::zeros(), false),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    const MS: i64 = 1_000_000;

    /// Samples of a rate that is a function of time in seconds.
    fn samples(every_ms: i64, until_ms: i64, rate: impl Fn(f64) -> Vector3<f64>) -> Vec<GyroSample> {
        (0..=until_ms / every_ms)
            .map(|k| k * every_ms)
            .map(|ms| GyroSample { stamp_nanos: ms * MS, rate_rad_per_s: rate(ms as f64 * 1e-3) })
            .collect()
    }

    #[test]
    fn a_growing_rate_about_one_axis_is_integrated_exactly() {
        let found = rotations(
            &ImuModel::default(),
            &samples(5, 1000, |t| Vector3::new(0.0, 2.0 * t, 0.0)),
            &[100 * MS, 133 * MS, 167 * MS, 900 * MS],
        );
        for (rotation, t) in found.iter().zip([0.1f64, 0.133, 0.167, 0.9]) {
            let turned = found[0].until(rotation, (t - 0.1).max(1e-9));
            let expected = t * t - 0.01;
            let angle = turned.earlier_from_later.angle();
            assert!((angle - expected).abs() < 1e-12, "{angle} instead of {expected} after {t} s");
            assert!(turned.sigma_rad < 0.01);
        }
    }

    #[test]
    fn where_there_are_no_samples_the_variance_says_so() {
        let mut list = samples(5, 1000, |_| Vector3::x());
        list.retain(|s| !(300 * MS..500 * MS).contains(&s.stamp_nanos));
        let stamps = [200, 233, 400, 433, 600, 633, 1500].map(|ms| ms * MS);
        let found = rotations(&ImuModel::default(), &list, &stamps);
        let sigma = |k: usize| found[k].until(&found[k + 1], 0.033).sigma_rad;
        assert!(sigma(0) < 1e-3 && sigma(4) < 1e-3, "{} {}", sigma(0), sigma(4));
        assert!(sigma(1) > 0.2 && sigma(2) > 0.09 && sigma(5) > 1.0, "{found:?}");
    }

    #[test]
    fn the_rotation_between_two_frames_does_not_depend_on_those_before() {
        let list = samples(7, 2000, |t| Vector3::new(t, 1.0 - t, 0.3));
        let stamps: Vec<i64> = (0..30).map(|k| k * 33 * MS).collect();
        let all = rotations(&ImuModel::default(), &list, &stamps);
        let later = rotations(&ImuModel::default(), &list, &stamps[10..]);
        let a = all[10].until(&all[29], 0.6).earlier_from_later;
        let b = later[0].until(&later[19], 0.6).earlier_from_later;
        assert!((a.inverse() * b).angle() < 1e-12);
        assert!(rotations(&ImuModel::default(), &[], &stamps).is_empty());
    }
}
