//! What inertial instruments measured of a frame, as plain data.

use crate::message::Refusal;
use bytemuck::{Pod, Zeroable};
use tessera_geometry::{InertialRotation, UpDirection};

/// An [`InertialRotation`]; all zero where the source has no gyroscope.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct RotationBits {
    /// Unit quaternion `x y z w`, from the camera now to the camera at the start.
    pub start_from_camera_xyzw: [f64; 4],
    /// Variance added about each axis since the start, radians².
    pub variance_rad2: f64,
    /// Standard deviation of the constant error of the rate, radians per second.
    pub bias_sigma_rad_per_s: f64,
}

impl From<Option<InertialRotation>> for RotationBits {
    fn from(rotation: Option<InertialRotation>) -> Self {
        rotation.map_or(Self::default(), |r| Self {
            start_from_camera_xyzw: r.start_from_camera_xyzw,
            variance_rad2: r.variance_rad2,
            bias_sigma_rad_per_s: r.bias_sigma_rad_per_s,
        })
    }
}

impl RotationBits {
    /// The rotation; `None` where there is none.
    ///
    /// # Errors
    /// A [`Refusal`] where the numbers are no rotation.
    pub fn read(&self, index: u64) -> Result<Option<InertialRotation>, Refusal> {
        if *self == Self::default() {
            return Ok(None);
        }
        let rotation = InertialRotation {
            start_from_camera_xyzw: self.start_from_camera_xyzw,
            variance_rad2: self.variance_rad2,
            bias_sigma_rad_per_s: self.bias_sigma_rad_per_s,
        };
        if rotation.is_valid() {
            return Ok(Some(rotation));
        }
        Err(Refusal::Value {
            index,
            what: "the rotation",
            found: format!("{self:?}"),
            rule: "a unit quaternion and finite variances, or all zero",
        })
    }
}

/// An [`UpDirection`]; all zero where the source has no accelerometer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct UpBits {
    /// Unit vector against gravity, in the camera's axes.
    pub in_camera: [f64; 3],
    /// Standard deviation of its tilt about each horizontal axis, radians.
    pub sigma_rad: f64,
}

impl From<Option<UpDirection>> for UpBits {
    fn from(up: Option<UpDirection>) -> Self {
        up.map_or(Self::default(), |up| Self { in_camera: up.in_camera, sigma_rad: up.sigma_rad })
    }
}

impl UpBits {
    /// The direction; `None` where there is none.
    ///
    /// # Errors
    /// A [`Refusal`] where the numbers are no direction.
    pub fn read(&self, index: u64) -> Result<Option<UpDirection>, Refusal> {
        if *self == Self::default() {
            return Ok(None);
        }
        let up = UpDirection { in_camera: self.in_camera, sigma_rad: self.sigma_rad };
        if up.is_valid() {
            return Ok(Some(up));
        }
        Err(Refusal::Value {
            index,
            what: "up",
            found: format!("{self:?}"),
            rule: "a unit vector and a positive deviation, or all zero",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rotation_survives_the_way_and_nonsense_is_refused() {
        let rotation = InertialRotation {
            start_from_camera_xyzw: [0.6, 0.0, 0.0, 0.8],
            variance_rad2: 1e-6,
            bias_sigma_rad_per_s: 0.01,
        };
        let bits = RotationBits::from(Some(rotation));
        assert_eq!(bits.read(3), Ok(Some(rotation)));
        assert_eq!(RotationBits::from(None).read(3), Ok(None));
        let refused = |bits: RotationBits| bits.read(3).unwrap_err().to_string();
        assert!(refused(RotationBits { variance_rad2: f64::NAN, ..bits }).contains("frame 3: the rotation"));
        assert!(
            refused(RotationBits { start_from_camera_xyzw: [9.0; 4], ..bits }).contains("unit quaternion")
        );
    }

    #[test]
    fn up_survives_the_way_and_nonsense_is_refused() {
        let up = UpDirection { in_camera: [0.6, -0.8, 0.0], sigma_rad: 0.02 };
        let bits = UpBits::from(Some(up));
        assert_eq!(bits.read(3), Ok(Some(up)));
        assert_eq!(UpBits::from(None).read(3), Ok(None));
        for nonsense in [UpBits { sigma_rad: f64::NAN, ..bits }, UpBits { in_camera: [1.0; 3], ..bits }] {
            assert!(nonsense.read(3).unwrap_err().to_string().contains("frame 3: up is"));
        }
    }
}
