//! The residual of a correspondence with its covariance, linearised at a pose.
//!
//! With `target_from_query * exp(delta)`, a point `p` of the query's frame moves by
//! `[I | -hat(p)] delta` before the pose turns it. Every kind of residual becomes an error `e` of
//! the lever `p` in the query's frame with a 3x3 information `M` (of rank 2 for bearings), so that
//! all share the normal equations `H += J^T M J`, `b += J^T M e` with `J = [I | -hat(p)]`.

use super::correspondence::Correspondence;
use nalgebra::{Matrix2, Matrix2x3, Matrix3, Vector2, Vector3};
use tessera_geometry::{Matrix6, Pose, Vector6};

/// Nearest depth of a point in front of a camera, metres.
const MIN_DEPTH_M: f64 = 0.01;

/// A residual at a pose.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReprojectionResidual {
    /// Squared error in standard deviations.
    pub(crate) squared: f64,
    /// 3 for two points, 2 for a point and a bearing.
    pub(crate) n_dimensions: f64,
    lever: Vector3<f64>,
    information: Matrix3<f64>,
    /// `M e`.
    gradient: Vector3<f64>,
}

/// A pose as a matrix, for many points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RelativeMotion {
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
}

impl From<&Pose> for RelativeMotion {
    fn from(pose: &Pose) -> Self {
        Self {
            rotation: pose.rotation.to_rotation_matrix().into_inner(),
            translation: pose.translation.vector,
        }
    }
}

/// `None` without any point, behind a camera, or where a covariance has no inverse.
#[inline(always)]
pub(crate) fn linearise(
    c: &Correspondence,
    target_from_query: &RelativeMotion,
) -> Option<ReprojectionResidual> {
    let RelativeMotion { rotation, translation } = target_from_query;
    match (&c.query.point, &c.target.point) {
        (Some(q), Some(t)) => {
            let lever = q.position_m;
            let error = rotation.tr_mul(&(t.position_m - translation)) - lever;
            let covariance = rotation.tr_mul(&(t.covariance_m2 * rotation)) + q.covariance_m2;
            let information = inverse_symmetric(&covariance)?;
            let gradient = information * error;
            Some(ReprojectionResidual {
                squared: error.dot(&gradient),
                n_dimensions: 3.0,
                lever,
                information,
                gradient,
            })
        }
        (Some(q), None) => {
            let seen = rotation * q.position_m + translation;
            let along = projection(&seen)? * rotation;
            let bearing = Bearing { ray: c.target.ray(), sigma: c.target.ray_sigma, seen };
            bearing.residual(q.position_m, along, &q.covariance_m2)
        }
        (None, Some(t)) => {
            let seen = rotation.tr_mul(&(t.position_m - translation));
            let along = -projection(&seen)?;
            let covariance = rotation.tr_mul(&(t.covariance_m2 * rotation));
            let bearing = Bearing { ray: c.query.ray(), sigma: c.query.ray_sigma, seen };
            bearing.residual(seen, along, &covariance)
        }
        (None, None) => None,
    }
}

/// A ray, and the point that should lie on it, in the frame of the ray's camera.
struct Bearing {
    ray: Vector2<f64>,
    sigma: f64,
    seen: Vector3<f64>,
}

impl Bearing {
    /// `along`: derivative of the projection by the lever; `covariance` of the point, in the frame
    /// of the lever.
    #[inline(always)]
    fn residual(
        &self,
        lever: Vector3<f64>,
        along: Matrix2x3<f64>,
        covariance: &Matrix3<f64>,
    ) -> Option<ReprojectionResidual> {
        let error = self.ray - Vector2::new(self.seen.x, self.seen.y) / self.seen.z;
        let of_ray = Matrix2::identity() * (self.sigma * self.sigma);
        let inverse = (of_ray + along * covariance * along.transpose()).try_inverse()?;
        let weighted = inverse * error;
        Some(ReprojectionResidual {
            squared: error.dot(&weighted),
            n_dimensions: 2.0,
            lever,
            information: along.tr_mul(&(inverse * along)),
            gradient: along.tr_mul(&weighted),
        })
    }
}

/// Derivative of `(x/z, y/z)`.
#[inline(always)]
fn projection(p: &Vector3<f64>) -> Option<Matrix2x3<f64>> {
    if !(p.z > MIN_DEPTH_M) {
        return None;
    }
    let inverse = 1.0 / p.z;
    let (u, v) = (p.x * inverse, p.y * inverse);
    Some(Matrix2x3::new(inverse, 0.0, -u * inverse, 0.0, inverse, -v * inverse))
}

#[inline(always)]
fn inverse_symmetric(m: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let (a, b, c) = (m[(0, 0)], m[(0, 1)], m[(0, 2)]);
    let (d, e, f) = (m[(1, 1)], m[(1, 2)], m[(2, 2)]);
    let (p, q, r) = (d * f - e * e, c * e - b * f, b * e - c * d);
    let determinant = a * p + b * q + c * r;
    if !(determinant > 0.0) {
        return None;
    }
    let s = 1.0 / determinant;
    let (t, u, v) = ((a * f - c * c) * s, (b * c - a * e) * s, (a * d - b * b) * s);
    Some(Matrix3::new(p * s, q * s, r * s, q * s, t, u, r * s, u, v))
}

/// Normal equations of a pose.
#[derive(Clone, Debug)]
pub(crate) struct NormalEquations {
    /// Sums of `M`, `M P` and `P M P` with `P = hat(p)`: all that `J^T M J` has.
    m: Matrix3<f64>,
    mp: Matrix3<f64>,
    pmp: Matrix3<f64>,
    /// `J^T M e`.
    pub(crate) gradient: Vector6,
}

impl NormalEquations {
    pub(crate) fn zero() -> Self {
        Self { m: Matrix3::zeros(), mp: Matrix3::zeros(), pmp: Matrix3::zeros(), gradient: Vector6::zeros() }
    }

    #[inline(always)]
    pub(crate) fn add(&mut self, residual: &ReprojectionResidual, weight: f64) {
        let m = residual.information * weight;
        let g = residual.gradient * weight;
        let p = &residual.lever;
        // The zeros of `P` left out.
        let mut mp = Matrix3::zeros();
        let mut pmp = Matrix3::zeros();
        for r in 0..3 {
            mp[(r, 0)] = m[(r, 1)] * p.z - m[(r, 2)] * p.y;
            mp[(r, 1)] = m[(r, 2)] * p.x - m[(r, 0)] * p.z;
            mp[(r, 2)] = m[(r, 0)] * p.y - m[(r, 1)] * p.x;
        }
        for c in 0..3 {
            pmp[(0, c)] = p.y * mp[(2, c)] - p.z * mp[(1, c)];
            pmp[(1, c)] = p.z * mp[(0, c)] - p.x * mp[(2, c)];
            pmp[(2, c)] = p.x * mp[(1, c)] - p.y * mp[(0, c)];
        }
        self.m += m;
        self.mp += mp;
        self.pmp += pmp;
        let turn = p.cross(&g);
        for k in 0..3 {
            self.gradient[k] += g[k];
            self.gradient[k + 3] += turn[k];
        }
    }

    /// `J^T M J`.
    pub(crate) fn information(&self) -> Matrix6 {
        let mut information = Matrix6::zeros();
        information.fixed_view_mut::<3, 3>(0, 0).copy_from(&self.m);
        information.fixed_view_mut::<3, 3>(0, 3).copy_from(&-self.mp);
        information.fixed_view_mut::<3, 3>(3, 0).copy_from(&-self.mp.transpose());
        information.fixed_view_mut::<3, 3>(3, 3).copy_from(&-self.pmp);
        information
    }

    /// The update `delta` of `pose * exp(delta)`; `None` where the pose is not determined.
    pub(crate) fn solve(&self) -> Option<Vector6> {
        self.information().cholesky().map(|factor| factor.solve(&self.gradient))
    }
}
