//! Angular rates and specific forces beside the images: what a camera has turned, and where up is.

mod file;
mod integrate;
mod up;

pub use file::load;
pub use integrate::rotations;
pub use up::{ImuReach, up_at};

use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use tessera_geometry::{InertialRotation, UpDirection};

/// One measurement of a gyroscope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GyroSample {
    /// Time of the measurement, nanoseconds.
    pub stamp_nanos: i64,
    /// About the camera's axes, radians per second.
    pub rate_rad_per_s: Vector3<f64>,
}

/// One measurement of an accelerometer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceSample {
    /// Time of the measurement, nanoseconds.
    pub stamp_nanos: i64,
    /// Specific force along the camera's axes, metres per second squared: at rest it points up.
    pub force_m_per_s2: Vector3<f64>,
}

/// `imu.toml`: how the instruments sit on the camera and how good they are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ImuModel {
    /// Unit quaternion `x y z w` from the instruments' axes to the camera's.
    pub camera_from_imu_xyzw: [f64; 4],
    /// White noise of the rate, radians per second per root hertz.
    pub noise_rad_per_s_sqrt_hz: f64,
    /// Standard deviation of the constant error of the rate, radians per second.
    pub bias_sigma_rad_per_s: f64,
    /// Standard deviation of the constant error of the specific force, metres per second squared.
    pub bias_sigma_m_per_s2: f64,
}

impl Default for ImuModel {
    /// Cheap instruments whose axes are the camera's: 0.01 degrees per second per root hertz, half a degree per
    /// second of constant error, and 20 milli-g of it: up is known to 1.2 degrees.
    fn default() -> Self {
        Self {
            camera_from_imu_xyzw: [0.0, 0.0, 0.0, 1.0],
            noise_rad_per_s_sqrt_hz: 1.75e-4,
            bias_sigma_rad_per_s: 0.009,
            bias_sigma_m_per_s2: 0.2,
        }
    }
}

/// All that the instruments of a recording measured, in the camera's axes and in the order of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImuRecording {
    /// The instruments.
    pub model: ImuModel,
    /// Angular rates.
    pub rates: Vec<GyroSample>,
    /// Specific forces; none without an accelerometer.
    pub forces: Vec<ForceSample>,
}

impl ImuRecording {
    /// The same about other axes.
    #[must_use]
    pub fn turned(mut self, camera_from_imu: &UnitQuaternion<f64>) -> Self {
        for sample in &mut self.rates {
            sample.rate_rad_per_s = camera_from_imu.transform_vector(&sample.rate_rad_per_s);
        }
        for sample in &mut self.forces {
            sample.force_m_per_s2 = camera_from_imu.transform_vector(&sample.force_m_per_s2);
        }
        self
    }

    /// The rotation at each stamp since the first one; the stamps increase.
    pub fn rotations(&self, stamps_nanos: &[i64]) -> Vec<InertialRotation> {
        rotations(&self.model, &self.rates, stamps_nanos)
    }

    /// Up at a time.
    pub fn up_at(&self, stamp_nanos: i64) -> Option<UpDirection> {
        up_at(&self.model, &self.rates, &self.forces, stamp_nanos, ImuReach::Around)
    }

    /// Which instruments there are, for people; `None` where nothing was measured.
    pub fn words(&self) -> Option<&'static str> {
        match (self.rates.is_empty(), self.forces.is_empty()) {
            (true, _) => None,
            (false, true) => Some("gyroscope"),
            (false, false) => Some("gyroscope and accelerometer"),
        }
    }
}
