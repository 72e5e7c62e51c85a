//! The motion that brings one set of points onto another with the least squared error.

use nalgebra::{Matrix3, Matrix4, Quaternion, Translation3, UnitQuaternion, Vector3};
use tessera_geometry::Pose;

/// A rigid motion with a scale: `scale * rotation * point + translation`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity {
    /// Factor on the source's lengths.
    pub scale: f64,
    /// Rotation and translation, applied after the factor.
    pub rigid: Pose,
}

impl Similarity {
    /// Maps a point.
    pub fn apply(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.rigid.rotation * (point * self.scale) + self.rigid.translation.vector
    }
}

/// `target_from_source` without scale: Horn 1987, the same optimum as Umeyama's without scale,
/// never a reflection. Pairs are matched by order; both slices have the same length.
pub fn align_rigid(source: &[Vector3<f64>], target: &[Vector3<f64>]) -> Pose {
    let sums = AlignmentSums::new(source, target);
    let rotation = sums.rotation();
    let translation = sums.target_mean - rotation * sums.source_mean;
    Pose::from_parts(Translation3::from(translation), rotation)
}

/// `target_from_source` with scale (Umeyama 1991). The scale is 1 where the source is one point.
pub fn align_similarity(source: &[Vector3<f64>], target: &[Vector3<f64>]) -> Similarity {
    let sums = AlignmentSums::new(source, target);
    let rotation = sums.rotation();
    let along = (rotation.to_rotation_matrix().matrix() * sums.cross).trace();
    let scale = if sums.source_spread > 0.0 { along / sums.source_spread } else { 1.0 };
    let translation = sums.target_mean - rotation * (sums.source_mean * scale);
    Similarity { scale, rigid: Pose::from_parts(Translation3::from(translation), rotation) }
}

struct AlignmentSums {
    source_mean: Vector3<f64>,
    target_mean: Vector3<f64>,
    /// Sum of `source * target^T` about the means.
    cross: Matrix3<f64>,
    /// Sum of squared distances of the source from its mean.
    source_spread: f64,
}

impl AlignmentSums {
    fn new(source: &[Vector3<f64>], target: &[Vector3<f64>]) -> Self {
        let n = source.len().min(target.len()).max(1) as f64;
        let source_mean = source.iter().sum::<Vector3<f64>>() / n;
        let target_mean = target.iter().sum::<Vector3<f64>>() / n;
        let mut cross = Matrix3::zeros();
        let mut source_spread = 0.0;
        for (a, b) in source.iter().zip(target) {
            let (a, b) = (a - source_mean, b - target_mean);
            cross += a * b.transpose();
            source_spread += a.norm_squared();
        }
        Self { source_mean, target_mean, cross, source_spread }
    }

    /// The unit quaternion that maximises `q^T N q` (Horn 1987, section 4A).
    ///
    /// Chosen over the SVD of `cross` because it needs no special case against reflections and
    /// stays well defined when all points lie in a plane.
    fn rotation(&self) -> UnitQuaternion<f64> {
        let s = &self.cross;
        let skew = [s[(1, 2)] - s[(2, 1)], s[(2, 0)] - s[(0, 2)], s[(0, 1)] - s[(1, 0)]];
        let trace = s.trace();
        let mut n = Matrix4::zeros();
        n[(0, 0)] = trace;
        for i in 0..3 {
            n[(0, i + 1)] = skew[i];
            n[(i + 1, 0)] = skew[i];
            for j in 0..3 {
                n[(i + 1, j + 1)] = s[(i, j)] + s[(j, i)] - if i == j { trace } else { 0.0 };
            }
        }
        if !(n.norm() > 0.0) {
            return UnitQuaternion::identity();
        }
        let eigen = n.symmetric_eigen();
        let q = eigen.eigenvectors.column(eigen.eigenvalues.imax());
        UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moved(points: &[Vector3<f64>], similarity: &Similarity) -> Vec<Vector3<f64>> {
        points.iter().map(|p| similarity.apply(p)).collect()
    }

    #[test]
    fn a_planted_motion_is_found_also_in_a_plane_and_near_half_a_turn() {
        let clouds: [Vec<Vector3<f64>>; 2] = [
            (0..20).map(f64::from).map(|k| Vector3::new(k.sin(), k.cos() * 3.0, 0.1 * k)).collect(),
            (0..20).map(f64::from).map(|k| Vector3::new(k.sin(), k.cos() * 3.0, 1.0)).collect(),
        ];
        for cloud in &clouds {
            for angle in [0.0, 1e-9, 0.7, std::f64::consts::PI - 1e-6] {
                for scale in [1.0, 0.2, 7.0] {
                    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.6, 0.0, 0.8) * angle);
                    let rigid = Pose::from_parts(Translation3::new(4.0, -5.0, 6.0), rotation);
                    let planted = Similarity { scale, rigid };
                    let found = align_similarity(cloud, &moved(cloud, &planted));
                    assert!((found.scale - scale).abs() < 1e-12 * scale, "{found:?}");
                    let apart =
                        (found.rigid.inverse() * planted.rigid).to_homogeneous() - Matrix4::identity();
                    assert!(apart.norm() < 1e-11, "{found:?} for {planted:?}");
                    if scale == 1.0 {
                        let rigid = align_rigid(cloud, &moved(cloud, &planted));
                        assert!((rigid.to_homogeneous() - planted.rigid.to_homogeneous()).norm() < 1e-11);
                    }
                }
            }
        }
    }

    #[test]
    fn one_point_is_moved_without_turning_it() {
        let pose = align_rigid(&[Vector3::x()], &[Vector3::y()]);
        assert_eq!(pose.rotation, UnitQuaternion::identity());
        assert!(
            (pose * nalgebra::Point3::from(Vector3::x()) - nalgebra::Point3::from(Vector3::y())).norm()
                < 1e-15
        );
    }
}
