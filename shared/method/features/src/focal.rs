//! The focal length that matches between views ask for.
//!
//! Where a camera turns, pixels near the border of the image move faster than those in the middle, by
//! `1 + tan^2` of the angle to the optical axis: a focal length that is stated wrong leaves residuals
//! that no pose takes away (Hartley 1997, self-calibration of stationary cameras). Each pair of views has
//! a pose of its own; all share one factor of the stated focal length.

use crate::pose::Correspondence;
use nalgebra::{Matrix2x3, Matrix3, Vector2, Vector3};
use tessera_geometry::{Matrix6, Pose, Twist, Vector6, compose_normalised, hat};
use tessera_numerics::jackknife_sigma;

/// Matches of two views, and about where they stand.
#[derive(Clone, Debug)]
pub struct ViewPair {
    /// Pose from which the estimate starts.
    pub target_from_query: Pose,
    /// Matches; those without depth on either side are not used.
    pub matches: Vec<Correspondence>,
}

/// The focal length over the stated one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FocalRatio {
    /// The factor.
    pub ratio: f64,
    /// Its standard deviation, from groups of pairs left out in turn.
    pub sigma: f64,
    /// Pairs that took part.
    pub n_pairs: usize,
}

/// Scale of the robust kernel (Cauchy), pixels, one for each iteration: wrong matches lose their weight
/// once the right ones fit.
const SCALES_PX: [f64; 12] = [40.0, 28.0, 20.0, 14.0, 10.0, 7.0, 5.0, 3.0, 2.0, 2.0, 2.0, 2.0];
/// Matches that a pair needs, by their weights.
const MIN_MATCHES: f64 = 12.0;
/// Pairs that an estimate needs.
const MIN_PAIRS: usize = 8;
/// Groups of the jackknife.
const GROUPS: usize = 8;
/// Points nearer to a camera, or behind it, are not seen by it, metres.
const MIN_DEPTH_M: f64 = 0.1;
/// Change of the logarithm of the ratio in one iteration at most.
const MOST_STEP: f64 = 0.05;

/// The factor of the stated focal length (pixels) that the matches of all pairs fit best; `None` where
/// too few pairs have enough matches, or where they do not determine it.
pub fn focal_ratio(pairs: &[ViewPair], focal_px: f64) -> Option<FocalRatio> {
    let mut poses: Vec<Pose> = pairs.iter().map(|pair| pair.target_from_query).collect();
    let mut log_ratio = 0.0_f64;
    let mut sums: Vec<Option<ReducedSums>> = Vec::new();
    for scale_px in SCALES_PX {
        let linearised = pairs.iter().zip(&poses);
        let linearised: Vec<Option<PairSystem>> = linearised
            .map(|(pair, pose)| {
                PairSystem::new(&pair.matches, pose, libm::exp(log_ratio), [focal_px, scale_px])
            })
            .map(|system| (system.weight >= MIN_MATCHES).then_some(system))
            .collect();
        let solved = linearised.iter().map(|system| system.as_ref().and_then(PairSystem::solve));
        let solved: Vec<Option<SolvedPair>> = solved.collect();
        sums = solved.iter().map(|solved| solved.as_ref().map(|solved| solved.reduced)).collect();
        let step = ReducedSums::total(sums.iter().flatten()).step()?.clamp(-MOST_STEP, MOST_STEP);
        for (pose, solved) in poses.iter_mut().zip(&solved) {
            if let Some(solved) = solved {
                *pose =
                    compose_normalised(pose, &Twist::from_vector(&(solved.by_pose - solved.by_ratio * step)));
            }
        }
        log_ratio += step;
    }
    let used: Vec<ReducedSums> = sums.into_iter().flatten().collect();
    let ratio = libm::exp(log_ratio);
    (used.len() >= MIN_PAIRS).then(|| jackknife(&used)).flatten().map(|sigma| FocalRatio {
        ratio,
        sigma: ratio * sigma,
        n_pairs: used.len(),
    })
}

/// Standard deviation of the logarithm from the steps that the sums without one group would take.
fn jackknife(sums: &[ReducedSums]) -> Option<f64> {
    let groups = GROUPS.min(sums.len());
    let without = |group: usize| {
        let kept = sums.iter().enumerate().filter(|(k, _)| k * groups / sums.len() != group);
        ReducedSums::total(kept.map(|(_, sums)| sums)).step()
    };
    let steps: Vec<f64> = (0..groups).map(without).collect::<Option<_>>()?;
    Some(jackknife_sigma(&steps))
}

/// Normal equation of the logarithm of the ratio, the pair's pose eliminated.
#[derive(Clone, Copy, Debug, Default)]
struct ReducedSums {
    information: f64,
    gradient: f64,
}

impl ReducedSums {
    fn total<'a>(sums: impl Iterator<Item = &'a Self>) -> Self {
        sums.fold(Self::default(), |total, one| Self {
            information: total.information + one.information,
            gradient: total.gradient + one.gradient,
        })
    }

    fn step(&self) -> Option<f64> {
        let step = -self.gradient / self.information;
        (self.information > 0.0 && step.is_finite()).then_some(step)
    }
}

/// Weighted normal equations of one pair in its pose and in the logarithm of the ratio.
#[derive(Clone, Debug)]
struct PairSystem {
    pose: Matrix6,
    mixed: Vector6,
    ratio: f64,
    pose_gradient: Vector6,
    ratio_gradient: f64,
    weight: f64,
}

/// A pair's own step, and what it takes of the ratio's.
struct SolvedPair {
    by_pose: Vector6,
    by_ratio: Vector6,
    reduced: ReducedSums,
}

impl PairSystem {
    fn new(matches: &[Correspondence], pose: &Pose, ratio: f64, [focal_px, scale_px]: [f64; 2]) -> Self {
        let mut system = Self {
            pose: Matrix6::zeros(),
            mixed: Vector6::zeros(),
            ratio: 0.0,
            pose_gradient: Vector6::zeros(),
            ratio_gradient: 0.0,
            weight: 0.0,
        };
        let linearised = matches.iter().filter_map(|m| linearise(m, pose, ratio));
        for (residual, by_pose, by_ratio) in linearised {
            let relative = residual.norm() * focal_px / scale_px;
            let weight = 1.0 / (1.0 + relative * relative);
            system.pose += by_pose.tr_mul(&by_pose) * weight;
            system.mixed += by_pose.tr_mul(&by_ratio) * weight;
            system.ratio += weight * by_ratio.norm_squared();
            system.pose_gradient += by_pose.tr_mul(&residual) * weight;
            system.ratio_gradient += weight * by_ratio.dot(&residual);
            system.weight += weight;
        }
        system
    }

    fn solve(&self) -> Option<SolvedPair> {
        let factor = self.pose.cholesky()?;
        let by_pose = -factor.solve(&self.pose_gradient);
        let by_ratio = factor.solve(&self.mixed);
        let reduced = ReducedSums {
            information: self.ratio - self.mixed.dot(&by_ratio),
            gradient: self.ratio_gradient + self.mixed.dot(&by_pose),
        };
        Some(SolvedPair { by_pose, by_ratio, reduced })
    }
}

type Jacobian = nalgebra::SMatrix<f64, 2, 6>;

/// Residual of a match in rays of the stated camera, and its derivatives by a motion of the query
/// (`pose exp(twist)`) and by the logarithm of the ratio. The point of the side that has depth is seen by
/// the other; that of the query where both have.
fn linearise(m: &Correspondence, pose: &Pose, ratio: f64) -> Option<(Vector2<f64>, Jacobian, Vector2<f64>)> {
    let true_point = |stated: &Vector3<f64>| Vector3::new(stated.x / ratio, stated.y / ratio, stated.z);
    let (point, seen, rotation, ray, by_motion) = match (&m.query.point, &m.target.point) {
        (Some(known), _) => {
            let point = true_point(&known.position_m);
            let rotation = *pose.rotation.to_rotation_matrix().matrix();
            let seen = rotation * point + pose.translation.vector;
            (point, seen, rotation, m.target.ray, [rotation, -rotation * hat(&point)])
        }
        (None, Some(known)) => {
            let point = true_point(&known.position_m);
            let rotation = pose.rotation.to_rotation_matrix().matrix().transpose();
            let seen = rotation * (point - pose.translation.vector);
            (point, seen, rotation, m.query.ray, [-Matrix3::identity(), hat(&seen)])
        }
        (None, None) => return None,
    };
    if !(seen.z > MIN_DEPTH_M) {
        return None;
    }
    let (x, y) = (seen.x / seen.z, seen.y / seen.z);
    let pixel = Vector2::new(ratio * x, ratio * y);
    let by_seen = Matrix2x3::new(1.0, 0.0, -x, 0.0, 1.0, -y) * (ratio / seen.z);
    let mut by_pose = Jacobian::zeros();
    by_pose.fixed_view_mut::<2, 3>(0, 0).copy_from(&(by_seen * by_motion[0]));
    by_pose.fixed_view_mut::<2, 3>(0, 3).copy_from(&(by_seen * by_motion[1]));
    let by_ratio = pixel - by_seen * (rotation * Vector3::new(point.x, point.y, 0.0));
    Some((pixel - Vector2::from(ray), by_pose, by_ratio))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::{Observation, PointEstimate};
    use tessera_geometry::exp;
    use tessera_numerics::SplitMix64;

    /// Pairs of views of a camera that turns and moves, described by a focal length that is `ratio`
    /// times too short, with `n_wrong` of 60 matches at random places.
    fn pairs(ratio: f64, turn_rad: f64, n_wrong: usize) -> Vec<ViewPair> {
        let mut random = SplitMix64::new(7);
        let mut between = |a: f64, b: f64| a + (b - a) * random.unit();
        let pair = |_| {
            let motion =
                [0.1, -0.05, 0.08, 0.3 * turn_rad, turn_rad, 0.1].map(|most| most * between(0.5, 1.0));
            let pose = exp(&Twist::from_vector(&Vector6::from(motion)));
            let matches = (0..60).map(|k| {
                let depth_m = between(1.0, 4.0);
                let ray = [between(-0.55, 0.55), between(-0.4, 0.4)];
                let seen = pose.rotation * Vector3::new(ray[0] * depth_m, ray[1] * depth_m, depth_m)
                    + pose.translation.vector;
                let mut target = [seen.x / seen.z, seen.y / seen.z].map(|x| x + between(-1e-3, 1e-3));
                if k < n_wrong {
                    target = target.map(|x| x + between(-0.06, 0.06));
                }
                let stated = |ray: [f64; 2]| ray.map(|x| x * ratio);
                let point = PointEstimate::on_ray(stated(ray), 1e-3, depth_m, 0.01);
                let depth_there = PointEstimate::on_ray(stated(target), 1e-3, seen.z, 0.01);
                // Every third match has depth in the target alone.
                let points = if k % 3 == 0 { [None, Some(depth_there)] } else { [Some(point), None] };
                let side = |ray, point| Observation { ray: stated(ray), ray_sigma: 1e-3, point };
                Correspondence { query: side(ray, points[0]), target: side(target, points[1]) }
            });
            // A run has such a pose from its surfaces.
            let nearly = exp(&Twist::from_vector(&Vector6::from(motion)).scaled(0.92));
            ViewPair { target_from_query: nearly, matches: matches.collect() }
        };
        (0..24).map(pair).collect()
    }

    #[test]
    fn a_turning_camera_tells_its_focal_length_among_wrong_matches() {
        for planted in [0.8, 0.9, 1.0, 1.1, 1.25] {
            let found = focal_ratio(&pairs(planted, 0.25, 12), 525.0).unwrap();
            assert!((found.ratio - planted).abs() < 4.0 * found.sigma, "{planted}: {found:?}");
            assert!(found.sigma < 0.01 && found.n_pairs == 24, "{planted}: {found:?}");
        }
    }

    #[test]
    fn a_camera_that_does_not_turn_does_not_tell_it() {
        let turning = focal_ratio(&pairs(1.1, 0.25, 0), 525.0).unwrap();
        let still = focal_ratio(&pairs(1.1, 0.002, 0), 525.0);
        assert!(still.is_none_or(|still| still.sigma > 5.0 * turning.sigma), "{turning:?} {still:?}");
    }

    #[test]
    fn too_few_matches_or_pairs_are_no_estimate() {
        let all = pairs(1.0, 0.25, 0);
        assert_eq!(focal_ratio(&all[..MIN_PAIRS - 1], 525.0), None);
        let few: Vec<ViewPair> = all
            .iter()
            .map(|pair| ViewPair { matches: pair.matches[..11].to_vec(), ..pair.clone() })
            .collect();
        assert_eq!(focal_ratio(&few, 525.0), None);
        assert_eq!(focal_ratio(&[], 525.0), None);
    }
}
