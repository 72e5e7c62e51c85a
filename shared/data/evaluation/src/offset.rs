//! The constant shift of stamps under which an estimate fits the ground truth best.

use crate::Trajectory;
use crate::align::align_rigid;
use nalgebra::Vector3;

/// Offsets searched, seconds: to either side of zero.
const SEARCH_S: f64 = 0.15;
const STEP_S: f64 = 0.005;

/// The offset to add to the estimate's times that gives the least ATE, seconds, to 0.1 ms.
///
/// Ground truth is interpolated linearly, unlike in the ATE itself: with the nearest pose of a
/// 100 Hz track the cost would be a staircase. `None` where too little overlaps in time.
pub fn best_time_offset_s(estimate: &Trajectory, groundtruth: &Trajectory) -> Option<f64> {
    let search_nanos = (SEARCH_S * 1e9) as i64;
    let usable: Vec<usize> = (0..estimate.len())
        .filter(|&at| {
            // The same poses count for every offset, or dropping bad ones would look like a gain.
            let stamp = estimate.stamps_nanos[at];
            is_covered(groundtruth, stamp - search_nanos, stamp + search_nanos)
        })
        .collect();
    if usable.len() < 10 {
        return None;
    }
    let source: Vec<Vector3<f64>> = usable.iter().map(|&at| estimate.poses[at].translation.vector).collect();
    let cost = |offset_s: f64| {
        let offset_nanos = libm::round(offset_s * 1e9) as i64;
        let target: Vec<Vector3<f64>> = usable
            .iter()
            .map(|&at| interpolated(groundtruth, estimate.stamps_nanos[at] + offset_nanos))
            .collect();
        let pose = align_rigid(&source, &target);
        let moved = |a: &Vector3<f64>| pose.rotation * a + pose.translation.vector;
        source.iter().zip(&target).map(|(a, b)| (moved(a) - b).norm_squared()).sum::<f64>()
    };
    let n_steps = (SEARCH_S / STEP_S).round() as i32;
    let coarse =
        (-n_steps..=n_steps).map(|k| f64::from(k) * STEP_S).min_by(|a, b| cost(*a).total_cmp(&cost(*b)))?;
    Some(libm::round(golden_section(cost, coarse - STEP_S, coarse + STEP_S) * 1e4) / 1e4)
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
    stamps[first - 1..=last].windows(2).all(|pair| pair[1] - pair[0] <= 100_000_000)
}

/// Position at a time inside the ground truth.
fn interpolated(groundtruth: &Trajectory, at_nanos: i64) -> Vector3<f64> {
    let stamps = &groundtruth.stamps_nanos;
    let after = stamps.partition_point(|&t| t <= at_nanos).clamp(1, stamps.len() - 1);
    let (t0, t1) = (stamps[after - 1], stamps[after]);
    let share = (at_nanos - t0) as f64 / (t1 - t0) as f64;
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
    fn no_overlap_has_no_offset() {
        let mut late = waving(33_333_000, 50, 0.0);
        late.stamps_nanos.iter_mut().for_each(|t| *t += 1_000_000_000_000);
        assert_eq!(best_time_offset_s(&late, &waving(10_000_000, 100, 0.0)), None);
    }
}
