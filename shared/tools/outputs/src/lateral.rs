//! Motions across the view against the ground truth: they scale with the focal length, those along the
//! view do not.
//!
//! A point at depth `z` and pixel `u` is taken to be at `z u / f`: with a focal length that is stated too
//! short everything is too far to the side, and so is the motion sideways.

use nalgebra::Vector3;
use tessera_evaluation::{Trajectory, associate_tum};
use tessera_numerics::jackknife_sigma;

/// Time over which motions are compared, nanoseconds: long enough to be beyond the noise of both.
const OVER_NANOS: i64 = 1_000_000_000;
/// Poses of one time, seconds.
const SAME_TIME_S: f64 = 0.02;
/// Spans of time that are left out in turn for the deviation.
const N_SPANS: usize = 8;
/// Motions that are compared, at least.
const MIN_MOTIONS: usize = 40;
/// Root mean square motion across and along the view at least, metres.
const MIN_MOTION_M: f64 = 0.02;
/// Correlation of both motions at least: less is another frame on the camera, or a wrong trajectory.
const MIN_CORRELATION: f64 = 0.9;
/// Factor of the motion along the view at most, either way: beyond, all lengths are wrong.
const MOST_ALONG: f64 = 1.2;

/// Estimated motions across the view over the true ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LateralScale {
    /// The factor.
    pub scale: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// Sums of products of estimated and true motions.
#[derive(Clone, Copy, Default)]
struct Products {
    both: f64,
    estimate: f64,
    truth: f64,
}

impl Products {
    fn add(&mut self, estimate: &[f64], truth: &[f64]) {
        for (e, t) in estimate.iter().zip(truth) {
            (self.both, self.estimate, self.truth) =
                (self.both + e * t, self.estimate + e * e, self.truth + t * t);
        }
    }

    fn plus(self, other: &Self) -> Self {
        Self {
            both: self.both + other.both,
            estimate: self.estimate + other.estimate,
            truth: self.truth + other.truth,
        }
    }

    fn scale(&self) -> f64 {
        self.both / self.truth
    }

    fn is_telling(&self, n: usize) -> bool {
        self.truth / n as f64 > MIN_MOTION_M * MIN_MOTION_M
            && self.both > MIN_CORRELATION * (self.estimate * self.truth).sqrt()
    }
}

/// Compares the motions across the view of an estimate with those of the truth, both of the camera's
/// optical frame (z along the view); `None` where they are too small or do not go together.
pub(crate) fn lateral_scale(estimate: &Trajectory, truth: &Trajectory) -> Option<LateralScale> {
    let motions = motions(estimate, truth);
    if motions.len() < MIN_MOTIONS {
        return None;
    }
    let (mut across, mut along) = ([Products::default(); N_SPANS], Products::default());
    for (k, [e, t]) in motions.iter().enumerate() {
        across[k * N_SPANS / motions.len()].add(&[e.x, e.y], &[t.x, t.y]);
        along.add(&[e.z], &[t.z]);
    }
    let without = |left_out: usize| {
        let kept = across.iter().enumerate().filter(|(span, _)| *span != left_out);
        kept.fold(Products::default(), |sum, (_, one)| sum.plus(one))
    };
    let all = without(N_SPANS);
    let is_other_length = !(1.0 / MOST_ALONG..=MOST_ALONG).contains(&along.scale());
    if !all.is_telling(motions.len()) || !along.is_telling(motions.len()) || is_other_length {
        return None;
    }
    let scales: Vec<f64> = (0..N_SPANS).map(|span| without(span).scale()).collect();
    Some(LateralScale { scale: all.scale(), sigma: jackknife_sigma(&scales) })
}

/// Motions of the estimate and of the truth over a second, each in its own camera frame, metres.
fn motions(estimate: &Trajectory, truth: &Trajectory) -> Vec<[Vector3<f64>; 2]> {
    let pairs = associate_tum(&truth.seconds(), &estimate.seconds(), SAME_TIME_S, 0.0);
    let nanos = |place: usize| estimate.stamps_nanos[pairs[place].1];
    let (mut motions, mut later) = (Vec::new(), 0);
    for first in 0..pairs.len() {
        while later < pairs.len() && nanos(later) - nanos(first) < OVER_NANOS {
            later += 1;
        }
        if later == pairs.len() {
            break;
        }
        // Across a gap the motion is not one of a second.
        if nanos(later) - nanos(first) > 2 * OVER_NANOS {
            continue;
        }
        let motion = |trajectory: &Trajectory, from: usize, to: usize| {
            trajectory.poses[from].inv_mul(&trajectory.poses[to]).translation.vector
        };
        motions.push([
            motion(estimate, pairs[first].1, pairs[later].1),
            motion(truth, pairs[first].0, pairs[later].0),
        ]);
    }
    motions
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_geometry::{Pose, Twist, Vector6, exp};

    /// A hand-held camera at 30 Hz whose motions are this many times too long, across and along.
    fn trajectory(across: f64, along: f64) -> Trajectory {
        let mut trajectory = Trajectory::default();
        for k in 0..200_i64 {
            let t = k as f64 / 30.0;
            let turn = Vector6::new(0.0, 0.0, 0.0, 0.1 * t.sin(), 0.2 * (0.7 * t).cos(), 0.05 * t.cos());
            let moved =
                Pose::translation(across * 0.2 * t.sin(), across * 0.1 * (1.3 * t).cos(), along * 0.1 * t);
            trajectory.push(k * 33_333_333, moved * exp(&Twist::from_vector(&turn))).unwrap();
        }
        trajectory
    }

    #[test]
    fn motions_across_the_view_tell_a_wrong_focal_length() {
        let truth = trajectory(1.0, 1.0);
        for factor in [0.9, 1.0, 1.12] {
            let found = lateral_scale(&trajectory(factor, 1.0), &truth).unwrap();
            assert!((found.scale - factor).abs() < 0.02 && found.sigma < 0.02, "{factor}: {found:?}");
        }
    }

    #[test]
    fn wrong_units_short_or_unlike_motions_say_nothing_of_it() {
        let truth = trajectory(1.0, 1.0);
        assert_eq!(lateral_scale(&trajectory(2.0, 2.0), &truth), None);
        assert_eq!(lateral_scale(&trajectory(0.01, 0.01), &trajectory(0.01, 0.01)), None);
        assert_eq!(lateral_scale(&trajectory(-1.0, 1.0), &truth), None);
        let mut short = truth.clone();
        short.stamps_nanos.truncate(50);
        short.poses.truncate(50);
        assert_eq!(lateral_scale(&short, &truth), None);
    }
}
