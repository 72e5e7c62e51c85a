//! The direction against gravity, by the mean of what an accelerometer measures.
//!
//! An accelerometer measures the specific force: the camera's acceleration less gravity. Turned into one frame by the
//! gyroscope, its mean over a time is up, up to the change of velocity over that time.

use super::{ForceSample, GyroSample, ImuModel, rotations};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use tessera_geometry::{InertialRotation, UpDirection};

/// Standard gravity, metres per second squared; over the earth it differs by 0.03.
const GRAVITY: f64 = 9.81;
/// Lengths of time over which the mean is taken, seconds; the one of the least deviation counts.
const WINDOWS_S: [f64; 3] = [1.0, 2.0, UpDirection::LONGEST_S];
/// Standard deviation of the change of velocity over such a time, metres per second: that of a hand or a slow robot.
const VELOCITY_CHANGE_M_PER_S: f64 = 0.5;
/// An acceleration that lasts is at most so many times the standard deviation of what varies: nothing moves without
/// shaking. Bounds the deviation of a camera that stands.
const LASTING: f64 = 3.0;
/// A direction less certain than this tells nothing, radians.
const MOST_SIGMA_RAD: f64 = 0.1;
/// Least share of a time that measurements must cover.
const LEAST_COVERED: f64 = 0.9;
/// A rotation between two measurements that is this uncertain was not measured, radians per second.
const GAP_RAD_PER_S: f64 = 1.0;
/// Least number of measurements of a time.
const LEAST_SAMPLES: usize = 10;

/// Which measurements there are around a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImuReach {
    /// Those before and after it: a recording.
    Around,
    /// Those before it: a live camera.
    Before,
}

/// Up in the camera's axes at a time; `None` where too little was measured around it. Both lists increase.
pub fn up_at(
    model: &ImuModel,
    rates: &[GyroSample],
    forces: &[ForceSample],
    stamp_nanos: i64,
    reach: ImuReach,
) -> Option<UpDirection> {
    let turned = turned(model, rates, forces, stamp_nanos, reach);
    let ups = WINDOWS_S.iter().filter_map(|length_s| mean_up(model, &turned, *length_s));
    let best = ups.min_by(|a, b| a.sigma_rad.total_cmp(&b.sigma_rad))?;
    (best.sigma_rad <= MOST_SIGMA_RAD).then_some(best)
}

/// A specific force in the camera's axes of another time.
struct TurnedForce {
    /// Since that time, seconds.
    since_s: f64,
    force: Vector3<f64>,
}

/// The forces around a time, in the camera's axes of that time: those between which the gyroscope has no gap.
fn turned(
    model: &ImuModel,
    rates: &[GyroSample],
    forces: &[ForceSample],
    stamp_nanos: i64,
    reach: ImuReach,
) -> Vec<TurnedForce> {
    let longest_nanos = WINDOWS_S.iter().fold(0.0, |most: f64, s| most.max(*s)) * 1e9;
    let since = |nanos: i64| nanos.saturating_sub(stamp_nanos) as f64;
    let from = forces.partition_point(|force| since(force.stamp_nanos) < -longest_nanos);
    let to = forces.partition_point(|force| match reach {
        ImuReach::Around => since(force.stamp_nanos) <= longest_nanos,
        ImuReach::Before => force.stamp_nanos <= stamp_nanos,
    });
    let near = forces.get(from..to).unwrap_or_default();
    let at = near.partition_point(|force| force.stamp_nanos <= stamp_nanos);
    let mut stamps: Vec<i64> = near.iter().map(|force| force.stamp_nanos).collect();
    stamps.insert(at, stamp_nanos);
    let mut attitudes = rotations(model, rates, &stamps);
    if attitudes.len() != stamps.len() {
        return Vec::new();
    }
    let gaps = gaps(&stamps, &attitudes);
    let begin = gaps.iter().take(at).rposition(|is_gap| *is_gap).map_or(0, |gap| gap.saturating_add(1));
    let end =
        gaps.iter().skip(at).position(|is_gap| *is_gap).map_or(near.len(), |gap| at.saturating_add(gap));
    let now = attitudes.remove(at);
    let turn = |[x, y, z, w]: [f64; 4]| UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z));
    let camera_from_start = turn(now.start_from_camera_xyzw).inverse();
    let with_attitude = near.iter().zip(attitudes).take(end).skip(begin);
    with_attitude
        .map(|(sample, then)| TurnedForce {
            since_s: since(sample.stamp_nanos) * 1e-9,
            force: camera_from_start * (turn(then.start_from_camera_xyzw) * sample.force_m_per_s2),
        })
        .collect()
}

/// Whether nothing is known of the rotation from each time to the next one.
fn gaps(stamps_nanos: &[i64], attitudes: &[InertialRotation]) -> Vec<bool> {
    let pairs = stamps_nanos.windows(2).zip(attitudes.windows(2));
    pairs
        .map(|(stamps, attitudes)| match (stamps, attitudes) {
            ([before, after], [earlier, later]) => {
                let most_rad = GAP_RAD_PER_S * after.saturating_sub(*before) as f64 * 1e-9;
                later.variance_rad2 - earlier.variance_rad2 > most_rad * most_rad
            }
            _ => true,
        })
        .collect()
}

/// Up by the mean over a time of that length, with the frame in its middle as far as there are measurements.
fn mean_up(model: &ImuModel, turned: &[TurnedForce], length_s: f64) -> Option<UpDirection> {
    let (first, last) = (turned.first()?.since_s, turned.last()?.since_s);
    let begin_s = (-0.5 * length_s).min(last - length_s).max(first);
    let is_within = |force: &&TurnedForce| (begin_s..=begin_s + length_s).contains(&force.since_s);
    let within = || turned.iter().filter(is_within);
    let n = within().count();
    let covered_s = within().next_back()?.since_s - within().next()?.since_s;
    if n < LEAST_SAMPLES || covered_s < LEAST_COVERED * length_s {
        return None;
    }
    let n = n as f64;
    let mean: Vector3<f64> = within().map(|force| force.force).sum::<Vector3<f64>>() / n;
    let spread_sq = within().map(|force| (force.force - mean).norm_squared()).sum::<f64>() / (3.0 * n);
    // What lasts of an acceleration, and what shows of it in the length of the mean.
    let lasting = (VELOCITY_CHANGE_M_PER_S / covered_s).min(LASTING * spread_sq.sqrt());
    let bias = model.bias_sigma_m_per_s2;
    // A horizontal acceleration a makes the force longer by a^2 / 2 g.
    let excess = ((mean.norm() - GRAVITY).abs() - 3.0 * bias).max(0.0);
    let force_sq = lasting * lasting + bias * bias + 2.0 * GRAVITY * excess + spread_sq / n;
    // The constant error of the rate turns each force by its distance in time.
    let off_s = within().map(|force| force.since_s).sum::<f64>() / n;
    let drift_rad = model.bias_sigma_rad_per_s * off_s;
    let variance = force_sq / (GRAVITY * GRAVITY) + drift_rad * drift_rad;
    UpDirection::of(&mean, variance.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    /// Ten seconds at 200 Hz of an instrument that turns steadily about the vertical axis and is tilted.
    fn samples(acceleration: impl Fn(f64) -> Vector3<f64>) -> (Vec<GyroSample>, Vec<ForceSample>) {
        let rate = 0.6;
        let world_from_start = UnitQuaternion::from_euler_angles(0.3, -0.2, 0.0);
        let all = (0..2000).map(|k| {
            let (stamp_nanos, seconds) = (k * 5 * MS, 0.005 * k as f64);
            let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), rate * seconds);
            let camera_from_world = (turn * world_from_start).inverse();
            let force_m_per_s2 = camera_from_world * (Vector3::z() * GRAVITY + acceleration(seconds));
            let rate_rad_per_s = camera_from_world * (Vector3::z() * rate);
            (GyroSample { stamp_nanos, rate_rad_per_s }, ForceSample { stamp_nanos, force_m_per_s2 })
        });
        all.unzip()
    }

    fn error_rad(up: &UpDirection, stamp_nanos: i64) -> f64 {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.6 * stamp_nanos as f64 * 1e-9);
        let camera_from_world = (turn * UnitQuaternion::from_euler_angles(0.3, -0.2, 0.0)).inverse();
        Vector3::from(up.in_camera).angle(&(camera_from_world * Vector3::z()))
    }

    #[test]
    fn a_turning_camera_that_does_not_accelerate_has_gravity_alone() {
        let (rates, forces) = samples(|_| Vector3::zeros());
        for (stamp, reach) in [(0, ImuReach::Around), (5000, ImuReach::Around), (5000, ImuReach::Before)] {
            let up = up_at(&ImuModel::default(), &rates, &forces, stamp * MS, reach).unwrap();
            assert!(error_rad(&up, stamp * MS) < 1e-3, "{stamp}: {}", error_rad(&up, stamp * MS));
            // The bias of a cheap accelerometer is what is left.
            assert!((0.02..0.025).contains(&up.sigma_rad), "{stamp}: {}", up.sigma_rad);
        }
    }

    #[test]
    fn accelerations_are_within_the_deviation() {
        // To and fro in a second; away and to a stop; a vehicle that gathers speed for ten seconds.
        let shake = |t: f64| Vector3::new(3.0 * (6.3 * t).sin(), 2.0 * (5.0 * t).cos(), 1.0);
        let start = |t: f64| if t < 0.5 { Vector3::x() * 1.0 } else { Vector3::zeros() };
        let vehicle = |t: f64| Vector3::new(4.0 + 0.7 * (40.0 * t).sin(), 0.0, 0.0);
        let motions: [&dyn Fn(f64) -> Vector3<f64>; 3] = [&shake, &start, &vehicle];
        for (at, motion) in motions.into_iter().enumerate() {
            let (rates, forces) = samples(motion);
            for stamp in [0, 1000, 5000] {
                let Some(up) = up_at(&ImuModel::default(), &rates, &forces, stamp * MS, ImuReach::Around)
                else {
                    continue;
                };
                let error = error_rad(&up, stamp * MS);
                assert!(error <= 3.0 * up.sigma_rad, "{at} {stamp}: {error} rad, {up:?}");
            }
        }
    }

    #[test]
    fn nothing_is_told_where_nothing_was_measured() {
        let (rates, forces) = samples(|_| Vector3::zeros());
        let up = |rates: &[GyroSample], forces: &[ForceSample], stamp, reach| {
            up_at(&ImuModel::default(), rates, forces, stamp, reach)
        };
        assert_eq!(up(&rates, &[], 0, ImuReach::Around), None);
        assert_eq!(up(&[], &forces, 0, ImuReach::Around), None);
        assert_eq!(up(&rates, &forces, 0, ImuReach::Before), None);
        assert_eq!(up(&rates, &forces[..5], 0, ImuReach::Around), None);
        // No rates around the frame: what turned meanwhile is unknown.
        assert_eq!(up(&rates[1000..], &forces[..500], 0, ImuReach::Around), None);
        // A minute behind the last measurement.
        assert_eq!(up(&rates, &forces, 70_000 * MS, ImuReach::Before), None);
    }
}
