//! Residuals of matched features in a pair's exact sums (method 14.2).
//!
//! Two points give `e = b - (R a + t)` with `Omega = (C_b + R C_a R^T)^-1`. A point and a bearing
//! give the point's distance from the bearing's line: the other end is the foot of the point on it,
//! and `Omega = (I - r r^T) / s^2` has rank two, with `s` the deviation across the line. All
//! information is metric: `1 / m^2`.

use nalgebra::{Matrix3, Vector3};
use tessera_features::{Correspondence, Observation};
use tessera_geometry::Pose;
use tessera_graph::BlockSums;

/// A residual frozen at a transform: `a` in the query's frame, `b` and `omega` in the target's.
struct Residual {
    a: Vector3<f64>,
    b: Vector3<f64>,
    omega: Matrix3<f64>,
}

/// Squared normalised error at which a residual has half its weight.
const ROBUST_SQ: f64 = 9.0;

/// Prior of a pair's median squared error: 0.95, as usual in recordings, by 60 matches; the mean's two parts. With
/// another value pairs of few matches would weigh otherwise than the rest.
const PRIOR: [f64; 2] = [57.0, 60.0];

/// A pair's matches at the pose that they agree on: how their variance compares, and their sums.
pub(crate) fn variance_and_sums(correspondences: &[Correspondence], at: &Pose) -> (f64, BlockSums) {
    let at = PairMotion::from(at);
    let residuals: Vec<Option<Residual>> = correspondences.iter().map(|c| residual(c, &at)).collect();
    let squared = residuals.iter().map(|r| r.as_ref().map_or(f64::INFINITY, |r| r.squared(&at)));
    let factor = variance_factor(squared.collect());
    (factor, weighted_sums(residuals.into_iter().flatten(), &at, factor))
}

/// Sums of all correspondences about `target_from_query`, metric, with robust weights there; `factor`: of their
/// variances.
#[cfg(test)]
pub(crate) fn sums(correspondences: &[Correspondence], target_from_query: &Pose, factor: f64) -> BlockSums {
    let at = PairMotion::from(target_from_query);
    weighted_sums(correspondences.iter().filter_map(|c| residual(c, &at)), &at, factor)
}

fn weighted_sums(residuals: impl Iterator<Item = Residual>, at: &PairMotion, factor: f64) -> BlockSums {
    let mut sums = BlockSums::default();
    for RobustResidual { a, e, omega, .. } in residuals.map(|r| RobustResidual::weighted(r, at, factor)) {
        sums.add(&a, &e, &omega);
        sums.n += 1;
    }
    sums
}

/// Variance of a pair's matches over the usual one, by the median of their squared errors: a blurred image has a larger
/// one. The prior's part is what matches err by together.
fn variance_factor(mut squared: Vec<f64>) -> f64 {
    let n = squared.len();
    if n == 0 {
        return 1.0;
    }
    let (_, median, _) = squared.select_nth_unstable_by(n / 2, f64::total_cmp);
    let [squared, matches] = PRIOR;
    (squared + n as f64 * *median) / (matches + n as f64) * (matches / squared)
}

/// A residual at a transform, with its robust weight in its information.
pub(crate) struct RobustResidual {
    pub(crate) a: Vector3<f64>,
    pub(crate) b: Vector3<f64>,
    pub(crate) e: Vector3<f64>,
    pub(crate) omega: Matrix3<f64>,
}

impl RobustResidual {
    /// `factor`: of the correspondence's variance.
    pub(crate) fn of(
        correspondence: &Correspondence,
        target_from_query: &PairMotion,
        factor: f64,
    ) -> Option<Self> {
        residual(correspondence, target_from_query).map(|r| Self::weighted(r, target_from_query, factor))
    }

    fn weighted(Residual { a, b, omega }: Residual, target_from_query: &PairMotion, factor: f64) -> Self {
        let omega = omega / factor;
        let e = target_from_query.error(&a, &b);
        let weight = 1.0 / (1.0 + e.dot(&(omega * e)) / ROBUST_SQ);
        Self { a, b, e, omega: omega * weight }
    }
}

/// Squared normalised error of a correspondence; infinite where it has none.
pub(crate) fn squared_error(correspondence: &Correspondence, target_from_query: &Pose) -> f64 {
    error_at(correspondence, &PairMotion::from(target_from_query))
}

/// Correspondences with a squared normalised error below `limit_sq`.
pub(crate) fn n_within(correspondences: &[Correspondence], target_from_query: &Pose, limit_sq: f64) -> usize {
    let at = PairMotion::from(target_from_query);
    correspondences.iter().filter(|c| error_at(c, &at) < limit_sq).count()
}

fn error_at(correspondence: &Correspondence, target_from_query: &PairMotion) -> f64 {
    residual(correspondence, target_from_query).map_or(f64::INFINITY, |r| r.squared(target_from_query))
}

impl Residual {
    /// Squared normalised error.
    fn squared(&self, target_from_query: &PairMotion) -> f64 {
        let e = target_from_query.error(&self.a, &self.b);
        e.dot(&(self.omega * e))
    }
}

/// A transform as a matrix, for many points.
pub(crate) struct PairMotion {
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
}

impl From<&Pose> for PairMotion {
    fn from(pose: &Pose) -> Self {
        let rotation = pose.rotation.to_rotation_matrix().into_inner();
        Self { rotation, translation: pose.translation.vector }
    }
}

impl PairMotion {
    fn error(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> Vector3<f64> {
        b - self.rotation * a - self.translation
    }
}

fn residual(c: &Correspondence, target_from_query: &PairMotion) -> Option<Residual> {
    let PairMotion { rotation, translation } = target_from_query;
    match (&c.query.point, &c.target.point) {
        (Some(q), Some(t)) => {
            let covariance = t.covariance_m2 + rotation * q.covariance_m2 * rotation.transpose();
            Some(Residual { a: q.position_m, b: t.position_m, omega: covariance.try_inverse()? })
        }
        (Some(q), None) => {
            let seen = rotation * q.position_m + translation;
            let (b, omega) = bearing(&c.target, &seen)?;
            Some(Residual { a: q.position_m, b, omega })
        }
        (None, Some(t)) => {
            let seen = rotation.tr_mul(&(t.position_m - translation));
            let (a, omega) = bearing(&c.query, &seen)?;
            Some(Residual { a, b: t.position_m, omega: rotation * omega * rotation.transpose() })
        }
        (None, None) => None,
    }
}

/// The foot of a point on the line of a bearing, and the information across that line. The point's
/// own position across the line is known as well as a pixel, from its own camera.
fn bearing(observation: &Observation, seen: &Vector3<f64>) -> Option<(Vector3<f64>, Matrix3<f64>)> {
    let [x, y] = observation.ray;
    let direction = Vector3::new(x, y, 1.0).normalize();
    let along = direction.dot(seen);
    let across_m = 2.0_f64.sqrt() * observation.ray_sigma * along;
    (along > 0.05).then(|| {
        let projector = Matrix3::identity() - direction * direction.transpose();
        (direction * along, projector / (across_m * across_m))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_features::PointEstimate;
    use tessera_numerics::SplitMix64;

    /// Points whose errors have `scale` times the deviation that their model states.
    fn matches(n: usize, scale: f64) -> Vec<Correspondence> {
        let mut random = SplitMix64::for_frame(3, 1);
        let mut normal = || (0..12).map(|_| random.next_u64() as f64 / u64::MAX as f64).sum::<f64>() - 6.0;
        let sigma_m = 0.01;
        let mut side = |p: Vector3<f64>| {
            let position_m = p + Vector3::from_fn(|_, _| normal()) * (scale * sigma_m);
            let covariance_m2 = Matrix3::identity() * (sigma_m * sigma_m);
            let point = PointEstimate { position_m, covariance_m2, is_inner: true };
            Observation { ray: [p.x / p.z, p.y / p.z], ray_sigma: 0.002, point: Some(point) }
        };
        let points = (0..n).map(|k| Vector3::new((k % 7) as f64 * 0.2, (k % 5) as f64 * 0.2, 2.0));
        points.map(|p| Correspondence { query: side(p), target: side(p) }).collect()
    }

    #[test]
    fn many_matches_tell_their_variance_and_few_leave_the_prior() {
        let at = Pose::identity();
        for scale in [0.5, 1.0, 2.0] {
            // The median of a chi-square distribution of three degrees of freedom is 2.37, the usual one .95.
            let of_many = variance_and_sums(&matches(6000, scale), &at).0 / (scale * scale) * 0.95 / 2.37;
            assert!((0.9..1.1).contains(&of_many), "{scale}: {of_many}");
        }
        assert!(variance_and_sums(&matches(12, 2.0), &at).0 < 3.0);
        assert_eq!(variance_and_sums(&[], &at).0, 1.0);
    }

    #[test]
    fn sums_under_the_own_variance_are_those_of_the_scaled_model() {
        let at = Pose::identity();
        let plain = sums(&matches(60, 1.0), &at, 1.0);
        let scaled = sums(&matches(60, 2.0), &at, 4.0);
        // Errors of twice the size under four times the variance: a quarter of the information, the same cost.
        assert!((scaled.c - plain.c).abs() < 1e-9 * plain.c, "{} {}", scaled.c, plain.c);
        assert!(scaled.q[0] < 0.3 * plain.q[0]);
    }
}
