//! Angular rates beside the images, and what a camera has turned by them.

mod file;
mod integrate;

pub use file::load;
pub use integrate::rotations;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// One measurement of a gyroscope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GyroSample {
    /// Time of the measurement, nanoseconds.
    pub stamp_nanos: i64,
    /// About the camera's axes, radians per second.
    pub rate_rad_per_s: Vector3<f64>,
}

/// `imu.toml`: how the instrument sits on the camera and how good it is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Gyroscope {
    /// Unit quaternion `x y z w` from the instrument's axes to the camera's.
    pub camera_from_imu_xyzw: [f64; 4],
    /// White noise of the rate, radians per second per root hertz.
    pub noise_rad_per_s_sqrt_hz: f64,
    /// Standard deviation of the constant error of the rate, radians per second.
    pub bias_sigma_rad_per_s: f64,
}

impl Default for Gyroscope {
    /// A cheap instrument whose axes are the camera's: 0.01 degrees per second per root hertz, and
    /// half a degree per second of constant error.
    fn default() -> Self {
        Self {
            camera_from_imu_xyzw: [0.0, 0.0, 0.0, 1.0],
            noise_rad_per_s_sqrt_hz: 1.75e-4,
            bias_sigma_rad_per_s: 0.009,
        }
    }
}
