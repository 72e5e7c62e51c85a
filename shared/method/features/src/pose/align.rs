//! The rigid motion between two triangles in closed form.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use tessera_geometry::Pose;

/// Sine of the angle at which a triangle counts as a line.
const MIN_SINE: f64 = 0.03;

/// `to_from_from` of two triangles: planes agree exactly, and the rotation inside the plane is that
/// of least squares about the centroids. `None` where either triangle is nearly a line.
pub(crate) fn align_triangles(from: &[Vector3<f64>; 3], to: &[Vector3<f64>; 3]) -> Option<Pose> {
    let (source, target) = (axes(from)?, axes(to)?);
    let [centre, centre_to] = [from, to].map(|p| (p[0] + p[1] + p[2]) / 3.0);
    let (mut cosine, mut sine) = (0.0, 0.0);
    for k in 0..3 {
        let a = source.tr_mul(&(from[k] - centre));
        let b = target.tr_mul(&(to[k] - centre_to));
        cosine += a.x * b.x + a.y * b.y;
        sine += a.x * b.y - a.y * b.x;
    }
    let norm = (cosine * cosine + sine * sine).sqrt();
    if !(norm > 0.0) {
        return None;
    }
    let (c, s) = (cosine / norm, sine / norm);
    let turn = Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0);
    let rotation = target * turn * source.transpose();
    let translation = centre_to - rotation * centre;
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Some(Isometry3::from_parts(Translation3::from(translation), rotation))
}

/// Columns: along the first edge, across it inside the plane, normal.
fn axes(p: &[Vector3<f64>; 3]) -> Option<Matrix3<f64>> {
    let (first, second) = (p[1] - p[0], p[2] - p[0]);
    let normal = first.cross(&second);
    let longest_sq = first.norm_squared().max(second.norm_squared()).max((second - first).norm_squared());
    if !(normal.norm() > MIN_SINE * longest_sq) {
        return None;
    }
    let (along, normal) = (first.normalize(), normal.normalize());
    Some(Matrix3::from_columns(&[along, normal.cross(&along), normal]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_geometry::{Twist, exp, log};

    #[test]
    fn a_known_motion_is_found_and_a_line_is_refused() {
        let motion = exp(&Twist { rho: Vector3::new(0.3, -0.2, 0.5), phi: Vector3::new(0.4, -1.9, 0.7) });
        let from = [Vector3::new(0.1, 0.2, 1.0), Vector3::new(-0.4, 0.1, 1.5), Vector3::new(0.3, 0.9, 2.0)];
        let to = from.map(|p| motion.transform_vector(&p) + motion.translation.vector);
        let found = align_triangles(&from, &to).unwrap();
        assert!(log(&(found.inverse() * motion)).to_vector().norm() < 1e-12);
        let line = [1.0, 2.0, 3.5].map(|t| Vector3::new(0.1, -0.3, 1.0) * t);
        assert!(align_triangles(&line, &to).is_none() && align_triangles(&from, &line).is_none());
        assert!(align_triangles(&[from[0]; 3], &to).is_none());
    }
}
