//! The normal equations of one pair of keyframes, in its relative pose and in the camera.

use crate::derivative::point_derivative;
use crate::parameters::N_PARAMETERS;
use nalgebra::{SMatrix, SVector, Vector3};
use tessera_geometry::{Camera, DepthNoise, Pose, Twist};
use tessera_registration::Match;

/// Unknowns of one pair: the query's pose (the target's follows by the adjoint), then the camera.
pub(crate) const N_PAIR: usize = 6 + N_PARAMETERS;

/// Sums of a pair around its present relative pose and camera.
#[derive(Clone, Debug)]
pub(crate) struct PairSums {
    pub(crate) query: usize,
    pub(crate) target: usize,
    pub(crate) target_from_query: Pose,
    /// `sum w J^T J`.
    pub(crate) h: SMatrix<f64, N_PAIR, N_PAIR>,
    /// `sum w J^T r`.
    pub(crate) g: SVector<f64, N_PAIR>,
    /// `sum s^2` over residuals in standard deviations of depth.
    pub(crate) sigmas_sq: f64,
    pub(crate) n_matches: usize,
}

/// The two frames of a pair as they move during their readout.
pub(crate) struct Sides {
    pub(crate) query: (usize, Twist),
    pub(crate) target: (usize, Twist),
}

/// Weight of a residual.
pub(crate) struct Rule {
    pub(crate) noise: DepthNoise,
    /// Variance along the normal over the variance across it (eq. 9).
    pub(crate) epsilon: f64,
}

/// Surfaces seen at a smaller cosine between normal and line of sight take no part: there pixels
/// are lost by the sign of their noise.
const MIN_VIEW_COSINE: f64 = 0.3;

/// Sums point-to-plane residuals along the mean of both normals: with either normal alone the
/// curvature between a point and its nearest vertex would pull on the camera.
///
/// Both points of a match move with the camera. The weights, robust ones included, are the match's,
/// less where the normals differ, as in the method's own metric along the normals (eq. 13; method 4.2): near
/// a crease a normal is a mean of two planes, more so from afar, and that looks like a wrong camera.
pub(crate) fn sum(
    camera: &Camera,
    rule: &Rule,
    matches: &[Match],
    target_from_query: &Pose,
    sides: &Sides,
) -> PairSums {
    let mut sums = PairSums {
        query: sides.query.0,
        target: sides.target.0,
        target_from_query: *target_from_query,
        h: SMatrix::zeros(),
        g: SVector::zeros(),
        sigmas_sq: 0.0,
        n_matches: matches.len(),
    };
    let vector = |v: [f32; 3]| Vector3::from(v.map(f64::from));
    for m in matches {
        let (a, e) = (vector(m.a), vector(m.e));
        let (na, nb) = (vector(m.na), vector(m.nb));
        let Some(normal) = (na + nb).try_normalize(1e-6) else { continue };
        let b = target_from_query.rotation * a + target_from_query.translation.vector + e;
        let normal_in_query = target_from_query.rotation.inverse() * normal;
        let (towards_a, towards_b) = (normal_in_query.dot(&a), normal.dot(&b));
        if !(towards_a < -MIN_VIEW_COSINE * a.norm() && towards_b < -MIN_VIEW_COSINE * b.norm()) {
            continue;
        }
        let residual = normal.dot(&e);
        let [variance_a, variance_b] = [a.z, b.z].map(|z| f64::from(rule.noise.sigma_m(z as f32)).powi(2));
        let share = variance_a / (variance_a + variance_b);
        // Noise in a point is in its residual too; in its derivative as well, both would agree on a
        // camera that makes them small. So derivatives are taken where both measurements agree.
        let a = a * (1.0 + share * residual / towards_a);
        let b = b * (1.0 - (1.0 - share) * residual / towards_b);
        let by_query = point_derivative(camera, &sides.query.1, &a);
        let by_target = point_derivative(camera, &sides.target.1, &b);
        // r = n (b - T a), the query's pose perturbed on the right (method 4.1).
        let by_phi = normal_in_query.cross(&a);
        let by_camera = by_target.transpose() * normal - by_query.transpose() * normal_in_query;
        let mut j = SVector::<f64, N_PAIR>::zeros();
        j.fixed_rows_mut::<3>(0).copy_from(&-normal_in_query);
        j.fixed_rows_mut::<3>(3).copy_from(&by_phi);
        j.fixed_rows_mut::<N_PARAMETERS>(6).copy_from(&by_camera);
        let weight = f64::from(m.weight) / (1.0 + (na - nb).norm_squared() / (4.0 * rule.epsilon));
        sums.h.ger(weight, &j, &j, 1.0);
        sums.g += j * (weight * residual);
        sums.sigmas_sq += f64::from(m.sigmas * m.sigmas);
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;
    use tessera_geometry::{Vector6, compose_normalised, exp};

    #[test]
    fn the_pose_s_derivative_is_that_of_the_residual() {
        let camera = Camera::pinhole((640, 480), [525.0, 525.0, 320.0, 240.0], 5000.0);
        let pose = exp(&Twist { rho: Vector3::new(0.1, -0.2, 0.05), phi: Vector3::new(0.02, 0.3, -0.1) });
        let a = Vector3::new(0.3, -0.2, 1.7);
        let b = (pose * Point3::from(a)).coords + Vector3::new(1e-4, 2e-4, -3e-4);
        let n = Vector3::new(0.36, -0.48, -0.8);
        let residual = |pose: &Pose| n.dot(&(b - (pose * Point3::from(a)).coords));
        let flat = |v: Vector3<f64>| [v.x as f32, v.y as f32, v.z as f32];
        let e = b - (pose * Point3::from(a)).coords;
        let matched = Match { a: flat(a), e: flat(e), na: flat(n), nb: flat(n), sigmas: 0.0, weight: 1.0 };
        let still = Twist::default();
        let sums = sum(
            &camera,
            &Rule { noise: DepthNoise::default(), epsilon: 1e-4 },
            &[matched],
            &pose,
            &Sides { query: (1, still), target: (0, still) },
        );
        for k in 0..6 {
            let mut d = Vector6::zeros();
            d[k] = 1e-6;
            let moved = |d: Vector6| residual(&compose_normalised(&pose, &Twist::from_vector(&d)));
            let numeric = (moved(d) - moved(-d)) / 2e-6;
            // With one match of weight one g is its Jacobian times its residual.
            assert!((sums.g[k] / residual(&pose) - numeric).abs() < 1e-3, "direction {k}");
        }
    }
}
