//! The constant shift of stamps under which an estimate fits the ground truth best.

use crate::Trajectory;
use crate::align::align_rigid;
use nalgebra::Vector3;

/// Offsets searched, seconds to either side of zero: clocks of two computers that were never set by
/// each other are further apart, and are told by their dates.
pub const SEARCH_S: f64 = 60.0;
/// Step of the search and of its refinement, seconds.
const COARSE_S: f64 = 0.02;
const STEP_S: f64 = 0.005;
/// Offsets around the best of the search among which the same poses are compared, seconds.
const AROUND_S: f64 = 0.15;
/// Poses that the search compares at most.
const MOST_POSES: usize = 300;
/// Share of the poses that must have ground truth under an offset.
const COVERED: f64 = 0.75;
const LEAST_POSES: usize = 10;
/// Share of the best cost by which the ends of the search must be worse.
const WORSE_AT_ENDS: f64 = 1.05;

/// The offset to add to the estimate's times that gives the least ATE, seconds, to 0.1 ms.
///
/// Ground truth is interpolated linearly, unlike in the ATE itself: with the nearest pose of a
/// 100 Hz track the cost would be a staircase. `None` where too little overlaps in time, or where the
/// best of all offsets is at an end of those that can be compared.
pub fn best_time_offset_s(estimate: &Trajectory, groundtruth: &Trajectory) -> Option<f64> {
    let middle_s = searched(estimate, groundtruth)?;
    refined(estimate, groundtruth, middle_s)
}

/// The best offset in coarse steps.
fn searched(estimate: &Trajectory, groundtruth: &Trajectory) -> Option<f64> {
    let n = estimate.len().min(MOST_POSES);
    let some: Vec<usize> = (0..n).map(|k| k * estimate.len() / n).collect();
    let cost = |offset_s: f64| -> Option<f64> {
        let offset_nanos = libm::round(offset_s * 1e9) as i64;
        let covered = some.iter().copied().filter(|&at| {
            let stamp = estimate.stamps_nanos[at].saturating_add(offset_nanos);
            is_covered(groundtruth, stamp, stamp)
        });
        let usable: Vec<usize> = covered.collect();
        let is_enough = usable.len() >= LEAST_POSES && usable.len() as f64 >= COVERED * n as f64;
        is_enough.then(|| cost(estimate, groundtruth, &usable, offset_nanos) / usable.len() as f64)
    };
    let n_steps = (SEARCH_S / COARSE_S).round() as i32;
    let costs: Vec<(f64, f64)> = (-n_steps..=n_steps)
        .map(|k| f64::from(k) * COARSE_S)
        .filter_map(|offset_s| Some((offset_s, cost(offset_s)?)))
        .collect();
    let (at, best) = costs.iter().enumerate().min_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
    let is_inside = |side: &[(f64, f64)]| side.iter().any(|(_, cost)| *cost > WORSE_AT_ENDS * best.1);
    (is_inside(&costs[..at]) && is_inside(&costs[at + 1..])).then_some(best.0)
}

/// The best offset around one, in fine steps.
fn refined(estimate: &Trajectory, groundtruth: &Trajectory, middle_s: f64) -> Option<f64> {
    let around_nanos = (AROUND_S * 1e9) as i64;
    let middle_nanos = libm::round(middle_s * 1e9) as i64;
    let usable: Vec<usize> = (0..estimate.len())
        .filter(|&at| {
            // The same poses count for every offset, or dropping bad ones would look like a gain.
            let stamp = estimate.stamps_nanos[at].saturating_add(middle_nanos);
            is_covered(groundtruth, stamp.saturating_sub(around_nanos), stamp.saturating_add(around_nanos))
        })
        .collect();
    if usable.len() < LEAST_POSES {
        return None;
    }
    let cost = |offset_s: f64| cost(estimate, groundtruth, &usable, libm::round(offset_s * 1e9) as i64);
    let n_steps = (AROUND_S / STEP_S).round() as i32;
    let offsets = (-n_steps..=n_steps).map(|k| middle_s + f64::from(k) * STEP_S);
    let best = offsets.min_by(|a, b| cost(*a).total_cmp(&cost(*b)))?;
    if (best - middle_s).abs() > AROUND_S - 0.5 * STEP_S {
        return None;
    }
    Some(libm::round(golden_section(cost, best - STEP_S, best + STEP_S) * 1e4) / 1e4)
}

/// Sum of the squared distances of some poses from the ground truth under an offset, once aligned.
fn cost(estimate: &Trajectory, groundtruth: &Trajectory, usable: &[usize], offset_nanos: i64) -> f64 {
    let position = |&at: &usize| estimate.poses[at].translation.vector;
    let source: Vec<Vector3<f64>> = usable.iter().map(position).collect();
    let target: Vec<Vector3<f64>> = usable
        .iter()
        .map(|&at| interpolated(groundtruth, estimate.stamps_nanos[at].saturating_add(offset_nanos)))
        .collect();
    let pose = align_rigid(&source, &target);
    let moved = |a: &Vector3<f64>| pose.rotation * a + pose.translation.vector;
    source.iter().zip(&target).map(|(a, b)| (moved(a) - b).norm_squared()).sum()
}

fn golden_section(cost: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    let (mut a, mut b) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
    let (mut cost_a, mut cost_b) = (cost(a), cost(b));
    while high - low > 2e-5 {
        if cost_a < cost_b {
            (high, b, cost_b) = (b, a, cost_a);
            a = high - GOLDEN * (high - low);
            cost_a = cost(a);
        } else {
            (low, a, cost_a) = (a, b, cost_b);
            b = low + GOLDEN * (high - low);
            cost_b = cost(b);
        }
    }
    0.5 * (low + high)
}

/// Whether the ground truth spans the interval without a gap longer than 0.1 s.
fn is_covered(groundtruth: &Trajectory, from_nanos: i64, to_nanos: i64) -> bool {
    let stamps = &groundtruth.stamps_nanos;
    let first = stamps.partition_point(|&t| t <= from_nanos);
    let last = stamps.partition_point(|&t| t < to_nanos);
    if first == 0 || last >= stamps.len() {
        return false;
    }
    stamps[first - 1..=last].windows(2).all(|pair| pair[1].saturating_sub(pair[0]) <= 100_000_000)
}

/// Position at a time inside the ground truth.
fn interpolated(groundtruth: &Trajectory, at_nanos: i64) -> Vector3<f64> {
    let stamps = &groundtruth.stamps_nanos;
    let after = stamps.partition_point(|&t| t <= at_nanos).clamp(1, stamps.len() - 1);
    let (t0, t1) = (stamps[after - 1], stamps[after]);
    let share = at_nanos.saturating_sub(t0) as f64 / t1.saturating_sub(t0) as f64;
    let (a, b) = (&groundtruth.poses[after - 1], &groundtruth.poses[after]);
    a.translation.vector.lerp(&b.translation.vector, share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_geometry::Pose;

    fn waving(step_nanos: i64, n: i64, late_s: f64) -> Trajectory {
        let mut trajectory = Trajectory::default();
        for k in 0..n {
            let t = (k * step_nanos) as f64 * 1e-9 + late_s;
            trajectory
                .push(k * step_nanos, Pose::translation((2.0 * t).sin(), (1.3 * t).cos(), 0.1 * t))
                .unwrap();
        }
        trajectory
    }

    #[test]
    fn a_planted_offset_is_found() {
        let truth = waving(10_000_000, 1000, 0.0);
        for planted in [0.0, 0.0213, -0.0437] {
            let found = best_time_offset_s(&waving(33_333_000, 280, planted), &truth).unwrap();
            assert!((found - planted).abs() < 3e-4, "{found} for {planted}");
        }
    }

    #[test]
    fn clocks_of_two_computers_are_seconds_apart() {
        let truth = waving(10_000_000, 4000, 0.0);
        let estimate = |planted: f64| {
            let mut estimate = waving(33_333_000, 280, 12.0);
            let shift = ((12.0 - planted) * 1e9) as i64;
            estimate.stamps_nanos.iter_mut().for_each(|stamp| *stamp += shift);
            estimate
        };
        for planted in [0.3, -1.0, 5.25, -7.5] {
            let found = best_time_offset_s(&estimate(planted), &truth).unwrap();
            assert!((found - planted).abs() < 1e-3, "{found} for {planted}");
        }
    }

    #[test]
    fn truth_at_both_ends_of_time_covers_nothing_between() {
        let mut truth = Trajectory::default();
        for stamp in [i64::MIN + 1, i64::MAX] {
            truth.push(stamp, Pose::identity()).unwrap();
        }
        assert!(!is_covered(&truth, -1_000_000_000, 1_000_000_000));
        assert_eq!(interpolated(&truth, 0), Vector3::zeros());
        assert_eq!(best_time_offset_s(&waving(33_333_000, 280, 0.0), &truth), None);
    }

    #[test]
    fn a_best_offset_at_the_end_of_what_can_be_compared_is_none() {
        // The truth ends where the estimate's motion would begin to fit.
        let truth = waving(10_000_000, 300, 0.0);
        assert_eq!(best_time_offset_s(&waving(33_333_000, 85, 2.5), &truth), None);
        // A camera that stands still fits everywhere.
        let mut still = Trajectory::default();
        for k in 0..200 {
            still.push(k * 33_000_000, Pose::identity()).unwrap();
        }
        assert_eq!(best_time_offset_s(&still, &still), None);
    }

    #[test]
    fn no_overlap_has_no_offset() {
        let mut late = waving(33_333_000, 50, 0.0);
        late.stamps_nanos.iter_mut().for_each(|t| *t += 1_000_000_000_000);
        assert_eq!(best_time_offset_s(&late, &waving(10_000_000, 100, 0.0)), None);
    }
}
