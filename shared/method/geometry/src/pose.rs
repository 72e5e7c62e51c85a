//! Rigid motions: exponential, logarithm, adjoint, and poses stored as bits.

use nalgebra::{Isometry3, Matrix3, Quaternion, SMatrix, SVector, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// A rigid transform, named by the chain it maps: `target_from_source`.
pub type Pose = Isometry3<f64>;
/// A 6x6 matrix over tangent vectors, translation block first.
pub type Matrix6 = SMatrix<f64, 6, 6>;
/// A 6-vector, translation block first.
pub type Vector6 = SVector<f64, 6>;

/// A tangent vector of SE(3): `rho` in metres, `phi` in radians.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Translational part, metres.
    pub rho: Vector3<f64>,
    /// Rotational part, radians times axis.
    pub phi: Vector3<f64>,
}

impl Twist {
    /// Splits a 6-vector, translation first.
    pub fn from_vector(v: &Vector6) -> Self {
        Self { rho: Vector3::new(v[0], v[1], v[2]), phi: Vector3::new(v[3], v[4], v[5]) }
    }

    /// The 6-vector, translation first.
    pub fn to_vector(self) -> Vector6 {
        Vector6::new(self.rho.x, self.rho.y, self.rho.z, self.phi.x, self.phi.y, self.phi.z)
    }

    /// Both parts times `factor`, for instance a velocity times a time.
    pub fn scaled(self, factor: f64) -> Self {
        Self { rho: self.rho * factor, phi: self.phi * factor }
    }
}

/// The skew matrix with `hat(a) * b == a x b`.
pub fn hat(a: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
}

/// Rotation by `|phi|` radians about `phi`.
pub fn rotation_exp(phi: &Vector3<f64>) -> UnitQuaternion<f64> {
    let angle_sq = phi.norm_squared();
    // Half-angle series below 1e-8 rad^2: the next term is under f64 resolution.
    let (w, scale) = if angle_sq < 1e-8 {
        (1.0 - angle_sq / 8.0, 0.5 - angle_sq / 48.0)
    } else {
        let angle = libm::sqrt(angle_sq);
        (libm::cos(0.5 * angle), libm::sin(0.5 * angle) / angle)
    };
    UnitQuaternion::new_normalize(Quaternion::new(w, phi.x * scale, phi.y * scale, phi.z * scale))
}

/// The inverse of [`rotation_exp`], with an angle in `[0, pi]`.
pub fn rotation_log(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    let q = rotation.quaternion();
    let (w, v) = if q.w < 0.0 { (-q.w, -q.imag()) } else { (q.w, q.imag()) };
    let sine = v.norm();
    if sine < 1e-9 {
        // angle = 2 asin(sine), to first order.
        return v * (2.0 / w);
    }
    v * (2.0 * libm::atan2(sine, w) / sine)
}

/// The exponential of SE(3).
pub fn exp(twist: &Twist) -> Pose {
    let phi_hat = hat(&twist.phi);
    let angle_sq = twist.phi.norm_squared();
    let (b, c) = if angle_sq < 1e-6 {
        (0.5 - angle_sq / 24.0, 1.0 / 6.0 - angle_sq / 120.0)
    } else {
        let angle = libm::sqrt(angle_sq);
        ((1.0 - libm::cos(angle)) / angle_sq, (angle - libm::sin(angle)) / (angle_sq * angle))
    };
    let v = Matrix3::identity() + phi_hat * b + phi_hat * phi_hat * c;
    Pose::from_parts(Translation3::from(v * twist.rho), rotation_exp(&twist.phi))
}

/// The logarithm of SE(3); rotation angles up to pi.
pub fn log(pose: &Pose) -> Twist {
    let phi = rotation_log(&pose.rotation);
    let phi_hat = hat(&phi);
    let angle_sq = phi.norm_squared();
    let d = if angle_sq < 1e-6 {
        1.0 / 12.0 + angle_sq / 720.0
    } else {
        let angle = libm::sqrt(angle_sq);
        let half = 0.5 * angle;
        (1.0 - half * libm::cos(half) / libm::sin(half)) / angle_sq
    };
    let v_inverse = Matrix3::identity() - phi_hat * 0.5 + phi_hat * phi_hat * d;
    Twist { rho: v_inverse * pose.translation.vector, phi }
}

/// `Ad(R,t) = [R  [t]x R; 0  R]`, so that `pose * exp(d) == exp(Ad d) * pose` (method 4.1).
pub fn adjoint(pose: &Pose) -> Matrix6 {
    let r = pose.rotation.to_rotation_matrix().into_inner();
    let mut ad = Matrix6::zeros();
    ad.fixed_view_mut::<3, 3>(0, 0).copy_from(&r);
    ad.fixed_view_mut::<3, 3>(3, 3).copy_from(&r);
    ad.fixed_view_mut::<3, 3>(0, 3).copy_from(&(hat(&pose.translation.vector) * r));
    ad
}

/// `pose * exp(delta)` with the quaternion brought back to unit length, so that
/// thousands of updates do not let it drift.
pub fn compose_normalised(pose: &Pose, delta: &Twist) -> Pose {
    let mut updated = pose * exp(delta);
    updated.rotation = UnitQuaternion::new_normalize(*updated.rotation.quaternion());
    updated
}

/// Length of the translation in metres and angle of the rotation in radians.
pub fn translation_rotation_norms(pose: &Pose) -> (f64, f64) {
    (pose.translation.vector.norm(), rotation_log(&pose.rotation).norm())
}

/// A pose as it is stored and sent: loading does no arithmetic, so the bits survive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[repr(C)]
pub struct PoseBits {
    /// Translation in metres.
    pub translation_m: [f64; 3],
    /// Unit quaternion, `x y z w`.
    pub rotation_xyzw: [f64; 4],
}

impl PoseBits {
    /// The pose that maps every point to itself.
    pub const IDENTITY: Self = Self { translation_m: [0.0; 3], rotation_xyzw: [0.0, 0.0, 0.0, 1.0] };

    /// The same in numbers of single precision: off by some 1e-7 of each.
    pub fn to_single(self) -> Self {
        let single = |v: f64| f64::from(v as f32);
        Self { translation_m: self.translation_m.map(single), rotation_xyzw: self.rotation_xyzw.map(single) }
    }

    /// Whether all numbers are finite and the quaternion has unit length within 1e-6.
    pub fn is_valid(&self) -> bool {
        let norm_sq: f64 = self.rotation_xyzw.iter().map(|v| v * v).sum();
        self.translation_m.iter().all(|v| v.is_finite()) && (norm_sq - 1.0).abs() < 2e-6
    }
}

impl From<&Pose> for PoseBits {
    fn from(pose: &Pose) -> Self {
        let q = pose.rotation.quaternion();
        let t = &pose.translation.vector;
        Self { translation_m: [t.x, t.y, t.z], rotation_xyzw: [q.i, q.j, q.k, q.w] }
    }
}

impl From<&PoseBits> for Pose {
    fn from(bits: &PoseBits) -> Self {
        let [x, y, z, w] = bits.rotation_xyzw;
        Pose::from_parts(
            Translation3::from(Vector3::from(bits.translation_m)),
            UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z)),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn hard_twists() -> Vec<Twist> {
        let axes = [Vector3::x(), Vector3::y(), Vector3::z(), Vector3::new(0.6, -0.48, 0.64)];
        let angles = [0.0, 1e-12, 1e-8, 1e-5, 9.9e-4, 1.1e-3, 0.3, 2.0, PI - 1e-6];
        let lengths = [0.0, 1e-9, 1.0, 1e4];
        let mut twists = Vec::new();
        for axis in axes {
            for angle in angles {
                for length in lengths {
                    twists.push(Twist { rho: Vector3::new(0.3, -0.8, 0.52) * length, phi: axis * angle });
                }
            }
        }
        twists
    }

    #[test]
    fn log_inverts_exp_on_hard_twists() {
        for twist in hard_twists() {
            let back = log(&exp(&twist));
            let scale = 1.0 + twist.to_vector().norm();
            let error = (back.to_vector() - twist.to_vector()).norm();
            assert!(error < 1e-8 * scale, "{twist:?} came back as {back:?}");
        }
    }

    #[test]
    fn the_adjoint_moves_an_update_from_right_to_left() {
        for twist in hard_twists().into_iter().step_by(7) {
            let pose = exp(&Twist { rho: Vector3::new(1.0, 2.0, -0.5), phi: Vector3::new(0.4, -1.0, 0.2) });
            let small = Twist { rho: twist.rho / (1.0 + twist.rho.norm()), phi: twist.phi * 0.1 };
            let left = exp(&Twist::from_vector(&(adjoint(&pose) * small.to_vector()))) * pose;
            let right = pose * exp(&small);
            assert!((left.to_homogeneous() - right.to_homogeneous()).norm() < 1e-12);
        }
    }

    #[test]
    fn bits_survive_a_round_trip() {
        let pose = exp(&Twist { rho: Vector3::new(0.1, 0.2, 0.3), phi: Vector3::new(1.0, -2.0, 0.7) });
        let bits = PoseBits::from(&pose);
        assert_eq!(PoseBits::from(&Pose::from(&bits)), bits);
        assert!(bits.is_valid());
        assert!(!PoseBits { translation_m: [f64::NAN; 3], ..bits }.is_valid());
    }
}
