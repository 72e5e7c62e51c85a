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

/// Sums of all correspondences about `target_from_query`, metric, with robust weights there.
pub(crate) fn sums(correspondences: &[Correspondence], target_from_query: &Pose) -> BlockSums {
    let mut sums = BlockSums::default();
    let at = PairMotion::from(target_from_query);
    for RobustResidual { a, e, omega, .. } in
        correspondences.iter().filter_map(|c| RobustResidual::of(c, &at))
    {
        sums.add(&a, &e, &omega);
        sums.n += 1;
    }
    sums
}

/// A residual at a transform, with its robust weight in its information.
pub(crate) struct RobustResidual {
    pub(crate) a: Vector3<f64>,
    pub(crate) b: Vector3<f64>,
    pub(crate) e: Vector3<f64>,
    pub(crate) omega: Matrix3<f64>,
}

impl RobustResidual {
    pub(crate) fn of(correspondence: &Correspondence, target_from_query: &PairMotion) -> Option<Self> {
        let Residual { a, b, omega } = residual(correspondence, target_from_query)?;
        let e = target_from_query.error(&a, &b);
        let weight = 1.0 / (1.0 + e.dot(&(omega * e)) / ROBUST_SQ);
        Some(Self { a, b, e, omega: omega * weight })
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
    residual(correspondence, target_from_query).map_or(f64::INFINITY, |r| {
        let e = target_from_query.error(&r.a, &r.b);
        e.dot(&(r.omega * e))
    })
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
