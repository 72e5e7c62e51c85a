//! Settings of a simulated scene.

use crate::sensor::DepthSensor;
use serde::{Deserialize, Serialize};
use tessera_frames::SourceError;
use tessera_frames::imu::ImuModel;
use tessera_geometry::Camera;

/// Options of a simulated scene; everything follows from them and the frame's index.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SimulationOptions {
    /// Seed of the noise, of the hand's tremor and of the textures.
    pub seed: u64,
    /// How depth is measured.
    pub sensor: DepthSensor,
    /// Lens distortion `k1 k2 p1 p2 k3` of depth and colour; absent: the camera's own.
    #[serde(skip)]
    pub distortion: Option<[f64; 5]>,
    /// Rolling shutter, seconds from the first row to the last; absent: the camera's own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub readout_s: Option<f64>,
    /// How much older the colour image is than the depth image, seconds.
    #[serde(skip)]
    pub colour_lag_s: f64,
    /// Whether a person walks about in front of the camera.
    pub person: bool,
    /// Speed of the camera along its path, times the default.
    pub speed: f64,
    /// Seed of the building's proportions: its corridor's width, and the times of its lift. 0: its own.
    pub proportions: u64,
    /// Whether the camera carries a gyroscope and an accelerometer.
    pub imu: bool,
    /// White noise of the gyroscope, radians per second per root hertz.
    #[serde(skip)]
    pub imu_noise_rad_per_s_sqrt_hz: f64,
    /// Standard deviation of the gyroscope's constant error, radians per second.
    #[serde(skip)]
    pub imu_bias_sigma_rad_per_s: f64,
    /// Standard deviation of the accelerometer's constant error, metres per second squared.
    #[serde(skip)]
    pub imu_bias_sigma_m_per_s2: f64,
}

impl Default for SimulationOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            sensor: DepthSensor::default(),
            distortion: None,
            readout_s: None,
            colour_lag_s: 0.0,
            person: false,
            speed: 1.0,
            proportions: 0,
            imu: false,
            imu_noise_rad_per_s_sqrt_hz: ImuModel::default().noise_rad_per_s_sqrt_hz,
            imu_bias_sigma_rad_per_s: ImuModel::default().bias_sigma_rad_per_s,
            imu_bias_sigma_m_per_s2: ImuModel::default().bias_sigma_m_per_s2,
        }
    }
}

impl SimulationOptions {
    /// Checks every number, NaN included.
    ///
    /// # Errors
    /// Names the option, what it is and what it must be.
    pub fn check(&self) -> Result<(), SourceError> {
        let rules = [
            ("speed", self.speed, 0.01..=20.0, "0.01 to 20"),
            ("imu_noise_rad_per_s_sqrt_hz", self.imu_noise_rad_per_s_sqrt_hz, 0.0..=1.0, "0 to 1"),
            ("imu_bias_sigma_rad_per_s", self.imu_bias_sigma_rad_per_s, 0.0..=10.0, "0 to 10 rad/s"),
            ("imu_bias_sigma_m_per_s2", self.imu_bias_sigma_m_per_s2, 0.0..=10.0, "0 to 10 m/s^2"),
            ("colour_lag_s", self.colour_lag_s, -0.2..=0.2, "-0.2 to 0.2 s"),
        ];
        for (name, value, range, rule) in rules {
            if !range.contains(&value) {
                return Err(SourceError::Option { name, value: value.to_string(), rule });
            }
        }
        Ok(())
    }

    /// The instruments, if there are any.
    pub(super) fn imu_model(&self) -> Option<ImuModel> {
        self.imu.then(|| ImuModel {
            noise_rad_per_s_sqrt_hz: self.imu_noise_rad_per_s_sqrt_hz,
            bias_sigma_rad_per_s: self.imu_bias_sigma_rad_per_s,
            bias_sigma_m_per_s2: self.imu_bias_sigma_m_per_s2,
            ..ImuModel::default()
        })
    }

    /// Puts lens and shutter into the camera and checks it.
    pub(super) fn apply_to(&self, camera: &mut Camera) -> Result<(), SourceError> {
        if let Some(distortion) = self.distortion {
            camera.distortion = distortion;
        }
        if let Some(readout_s) = self.readout_s {
            camera.readout_s = readout_s;
        }
        camera.check().map_err(|source| SourceError::CameraValue { file: "simulation".to_owned(), source })
    }
}

/// A Kinect without distortion and with a global shutter.
pub(super) fn default_camera() -> Camera {
    Camera::pinhole((640, 480), [525.0, 525.0, 319.5, 239.5], 5000.0)
}
