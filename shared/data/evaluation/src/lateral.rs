//! Motions across the view against the ground truth: they scale with the focal length, those along the
//! view do not.
//!
//! A point at depth `z` and pixel `u` is taken to be at `z u / f`: with a focal length that is stated too
//! short everything is too far to the side, and so is the motion sideways. Turns move what is estimated as
//! well, by the arm between the ground truth's point and the camera's centre, and by the depth of what is
//! seen: that arm is solved for too.

use crate::{Trajectory, associate_tum};
use nalgebra::{Matrix3, SMatrix, SVector};
use tessera_geometry::{Pose, log};

/// Time over which motions are compared, nanoseconds: long enough to be beyond the noise of both.
const OVER_NANOS: i64 = 500_000_000;
/// Poses of one time, seconds.
const SAME_TIME_S: f64 = 0.02;
/// Groups of motions, each of the time over which one goes at least: groups share nothing but the solution.
const LEAST_GROUPS: usize = 5;
const MOST_GROUPS: usize = 16;
/// Root mean square motion across and along the view at least, metres.
const MIN_MOTION_M: f64 = 0.02;
/// Factor of the motion along the view at most, either way, and its deviation: beyond, all lengths are wrong,
/// or the trajectories do not go together.
const MOST_ALONG: f64 = 1.2;
const MOST_ALONG_SIGMA: f64 = 0.1;
/// The same factor across: beyond, it is not the lens.
const MOST_ACROSS: f64 = 1.5;
/// Standard deviation of the arm, metres: markers are on the camera's body.
const ARM_SIGMA_M: f64 = 0.05;

/// Unknowns: factors across and along the view, and the arm.
const N: usize = 5;
type MotionNormal = SMatrix<f64, N, N>;
type Unknowns = SVector<f64, N>;

/// Estimated motions across the view over the true ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LateralScale {
    /// The factor.
    pub scale: f64,
    /// Its standard error by the spread between groups of time (cluster-robust, Liang and Zeger 1986).
    pub sigma: f64,
    /// Groups of time.
    pub n_groups: usize,
    /// Turn about the axes across the view over the motion, radians a metre, root mean square each.
    pub turn_per_metre: f64,
}

/// Compares the motions across the view of an estimate with those of the truth, both of the camera's
/// optical frame (z along the view); `None` where they are too short, too small or do not go together.
pub fn lateral_scale(estimate: &Trajectory, truth: &Trajectory) -> Option<LateralScale> {
    let motions = motions(estimate, truth);
    let [first, last] = [motions.first()?.from_nanos, motions.last()?.from_nanos];
    let n_groups = usize::try_from(last.saturating_sub(first) / OVER_NANOS).ok()?.min(MOST_GROUPS);
    if n_groups < LEAST_GROUPS {
        return None;
    }
    let group = |m: &TwoMotions| {
        let span = last.saturating_sub(first) as f64 + 1.0;
        let place = m.from_nanos.saturating_sub(first) as f64 / span * n_groups as f64;
        (place as usize).min(n_groups - 1)
    };
    let mut groups = vec![MotionSums::default(); n_groups];
    motions.iter().for_each(|motion| groups[group(motion)].add(motion));
    let n = motions.len() as f64;
    let mean_square = |of: fn(&TwoMotions) -> f64| motions.iter().map(of).sum::<f64>() / n;
    let across = mean_square(|m| m.truth.translation.vector.xy().norm_squared());
    let along = mean_square(|m| m.truth.translation.vector.z.powi(2));
    let turn = mean_square(|m| log(&m.truth).phi.xy().norm_squared());
    if across.min(along) < MIN_MOTION_M * MIN_MOTION_M {
        return None;
    }
    let (found, covariance) = solve(&groups, n)?;
    let sigma = |place: usize| covariance[(place, place)].sqrt();
    let is_within = |factor: f64, most: f64| (1.0 / most..=most).contains(&factor);
    let is_telling = is_within(found[0], MOST_ACROSS)
        && is_within(found[1], MOST_ALONG)
        && sigma(1) < MOST_ALONG_SIGMA
        && sigma(0).is_finite();
    is_telling.then(|| LateralScale {
        scale: found[0],
        sigma: sigma(0),
        n_groups,
        turn_per_metre: (turn / across).sqrt(),
    })
}

/// The unknowns and their covariance by the spread between groups.
fn solve(groups: &[MotionSums], n: f64) -> Option<(Unknowns, MotionNormal)> {
    let total = groups.iter().fold(MotionSums::default(), |sum, group| sum.plus(group));
    let mut prior = MotionNormal::zeros();
    let mut solution = None;
    // The second time with the residuals that the first one left.
    for _ in 0..2 {
        let inverse = (total.normal + prior).try_inverse()?;
        let found = inverse * total.right;
        let squares = total.squares - 2.0 * found.dot(&total.right) + found.dot(&(total.normal * found));
        let variance = (squares / (3.0 * n)).max(1e-12);
        prior
            .fixed_view_mut::<3, 3>(2, 2)
            .copy_from(&(Matrix3::identity() * (variance / ARM_SIGMA_M.powi(2))));
        solution = Some((found, inverse));
    }
    let (found, inverse) = solution?;
    let spread: MotionNormal = groups
        .iter()
        .map(|group| group.right - group.normal * found)
        .map(|score| score * score.transpose())
        .sum();
    let of_few = groups.len() as f64 / (groups.len() as f64 - 1.0);
    Some((found, inverse * spread * inverse * of_few))
}

/// MotionNormal equations of some motions.
#[derive(Clone, Default)]
struct MotionSums {
    normal: MotionNormal,
    right: Unknowns,
    squares: f64,
}

impl MotionSums {
    fn add(&mut self, motion: &TwoMotions) {
        let (e, t) = (motion.estimate.translation.vector, motion.truth.translation.vector);
        let turn: Matrix3<f64> = motion.truth.rotation.to_rotation_matrix().matrix() - Matrix3::identity();
        for axis in 0..3 {
            let across = if axis < 2 { t[axis] } else { 0.0 };
            let along = if axis == 2 { t[axis] } else { 0.0 };
            let row = Unknowns::from([across, along, turn[(axis, 0)], turn[(axis, 1)], turn[(axis, 2)]]);
            self.normal += row * row.transpose();
            self.right += row * e[axis];
            self.squares += e[axis] * e[axis];
        }
    }

    fn plus(mut self, other: &Self) -> Self {
        self.normal += other.normal;
        self.right += other.right;
        self.squares += other.squares;
        self
    }
}

/// A motion of the estimate and of the truth, each in its own camera frame.
struct TwoMotions {
    from_nanos: i64,
    estimate: Pose,
    truth: Pose,
}

fn motions(estimate: &Trajectory, truth: &Trajectory) -> Vec<TwoMotions> {
    let pairs = associate_tum(&truth.seconds(), &estimate.seconds(), SAME_TIME_S, 0.0);
    let nanos = |place: usize| estimate.stamps_nanos[pairs[place].1];
    let (mut motions, mut later) = (Vec::new(), 0);
    for first in 0..pairs.len() {
        let since_first = |place: usize| nanos(place).saturating_sub(nanos(first));
        while later < pairs.len() && since_first(later) < OVER_NANOS {
            later += 1;
        }
        if later == pairs.len() {
            break;
        }
        // Across a gap the motion is not one of that time.
        if since_first(later) > 2 * OVER_NANOS {
            continue;
        }
        let motion = |trajectory: &Trajectory, from: usize, to: usize| {
            trajectory.poses[from].inv_mul(&trajectory.poses[to])
        };
        motions.push(TwoMotions {
            from_nanos: nanos(first),
            estimate: motion(estimate, pairs[first].1, pairs[later].1),
            truth: motion(truth, pairs[first].0, pairs[later].0),
        });
    }
    motions
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Vector3, Vector6};
    use tessera_geometry::{Twist, exp};

    /// A hand-held camera at 30 Hz whose motions are this many times too long, across and along, seen from a
    /// point at `arm` of the camera.
    fn trajectory(across: f64, along: f64, arm: Vector3<f64>) -> Trajectory {
        let mut trajectory = Trajectory::default();
        for k in 0..300_i64 {
            let t = k as f64 / 30.0;
            let turn = Vector6::new(0.0, 0.0, 0.0, 0.1 * t.sin(), 0.2 * (0.7 * t).cos(), 0.05 * t.cos());
            let moved = Pose::translation(
                across * 0.2 * t.sin(),
                across * 0.1 * (1.3 * t).cos(),
                along * (0.1 * t + 0.1 * (0.9 * t).sin()),
            );
            let seen = Pose::translation(arm.x, arm.y, arm.z);
            trajectory.push(k * 33_333_333, moved * exp(&Twist::from_vector(&turn)) * seen).unwrap();
        }
        trajectory
    }

    #[test]
    fn motions_across_the_view_tell_a_wrong_focal_length() {
        let truth = trajectory(1.0, 1.0, Vector3::zeros());
        for factor in [0.9, 1.0, 1.12] {
            let found = lateral_scale(&trajectory(factor, 1.0, Vector3::zeros()), &truth).unwrap();
            assert!((found.scale - factor).abs() < 0.02 && found.sigma < 0.02, "{factor}: {found:?}");
            assert!(found.n_groups >= 8, "{found:?}");
        }
    }

    #[test]
    fn a_point_beside_the_camera_is_not_taken_for_another_lens() {
        let truth = trajectory(1.0, 1.0, Vector3::zeros());
        let found = lateral_scale(&trajectory(1.0, 1.0, Vector3::new(0.0, 0.03, 0.08)), &truth).unwrap();
        assert!((found.scale - 1.0).abs() < 0.01, "{found:?}");
    }

    #[test]
    fn wrong_units_short_or_unlike_motions_tell_nothing_of_it() {
        let (none, same) = (Vector3::zeros(), |scale| trajectory(scale, scale, Vector3::zeros()));
        let truth = same(1.0);
        assert_eq!(lateral_scale(&same(2.0), &truth), None);
        assert_eq!(lateral_scale(&same(0.01), &same(0.01)), None);
        assert_eq!(lateral_scale(&trajectory(-1.0, 1.0, none), &truth), None);
        let mut short = truth.clone();
        short.stamps_nanos.truncate(70);
        short.poses.truncate(70);
        assert_eq!(lateral_scale(&short, &truth), None);
    }
}
