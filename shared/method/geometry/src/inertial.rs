//! Rotation of the camera, integrated from a gyroscope.

use crate::pose::rotation_log;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// A camera's rotation since the start of its source, integrated from angular rates.
///
/// Two of them give the rotation between any two frames, also where frames between were left
/// out, and a restarted sensor gives the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct InertialRotation {
    /// Unit quaternion `x y z w`, from the camera now to the camera at the start.
    pub start_from_camera_xyzw: [f64; 4],
    /// Variance that white noise and gaps have added about each axis since the start, radians².
    pub variance_rad2: f64,
    /// Standard deviation of the constant error of the rate, radians per second.
    pub bias_sigma_rad_per_s: f64,
}

/// The rotation between two frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeRotation {
    /// From the later camera to the earlier one.
    pub earlier_from_later: UnitQuaternion<f64>,
    /// Standard deviation about each axis, radians.
    pub sigma_rad: f64,
}

impl InertialRotation {
    /// Whether all numbers are finite, the quaternion has unit length within 1e-6, and nothing
    /// that must not be is negative.
    pub fn is_valid(&self) -> bool {
        let norm_sq: f64 = self.start_from_camera_xyzw.iter().map(|v| v * v).sum();
        (norm_sq - 1.0).abs() < 2e-6
            && self.variance_rad2.is_finite()
            && self.variance_rad2 >= 0.0
            && self.bias_sigma_rad_per_s.is_finite()
            && self.bias_sigma_rad_per_s >= 0.0
    }

    /// The rotation from this frame to one `seconds` later.
    pub fn until(&self, later: &Self, seconds: f64) -> RelativeRotation {
        let earlier_from_later = self.rotation().inverse() * later.rotation();
        let drift = later.bias_sigma_rad_per_s * seconds;
        let variance = (later.variance_rad2 - self.variance_rad2).max(0.0) + drift * drift;
        RelativeRotation {
            earlier_from_later: UnitQuaternion::new_normalize(*earlier_from_later.quaternion()),
            sigma_rad: variance.sqrt(),
        }
    }

    fn rotation(&self) -> UnitQuaternion<f64> {
        let [x, y, z, w] = self.start_from_camera_xyzw;
        UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z))
    }
}

impl RelativeRotation {
    /// Mean angular rate of the camera over `seconds`, radians per second, in its own frame.
    pub fn rate_rad_per_s(&self, seconds: f64) -> Vector3<f64> {
        rotation_log(&self.earlier_from_later) / seconds
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::rotation_exp;

    fn at(phi: Vector3<f64>, variance_rad2: f64) -> InertialRotation {
        let q = rotation_exp(&phi);
        let start_from_camera_xyzw = [q.i, q.j, q.k, q.w];
        InertialRotation { start_from_camera_xyzw, variance_rad2, bias_sigma_rad_per_s: 0.01 }
    }

    #[test]
    fn what_lies_between_two_frames_follows_whatever_was_left_out() {
        let rate = Vector3::new(0.3, -0.8, 0.5);
        let relative = at(rate * 0.1, 1e-6).until(&at(rate * 0.4, 4e-6), 0.3);
        assert!((relative.rate_rad_per_s(0.3) - rate).norm() < 1e-12);
        assert!((relative.sigma_rad - (3e-6f64 + 9e-6).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn nonsense_is_not_valid() {
        let good = at(Vector3::x(), 1e-6);
        assert!(good.is_valid());
        assert!(!InertialRotation { variance_rad2: f64::NAN, ..good }.is_valid());
        assert!(!InertialRotation { variance_rad2: -1.0, ..good }.is_valid());
        assert!(!InertialRotation { bias_sigma_rad_per_s: f64::INFINITY, ..good }.is_valid());
        assert!(!InertialRotation { start_from_camera_xyzw: [0.0; 4], ..good }.is_valid());
    }
}
