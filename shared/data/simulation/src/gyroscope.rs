//! A gyroscope on the simulated camera: true rates with seeded noise and a constant error.

use crate::path::Walk;
use crate::random;
use nalgebra::Vector3;
use std::f64::consts::TAU;
use tessera_frames::imu::{GyroSample, Gyroscope};
use tessera_geometry::rotation_log;

/// Measurements per second.
const RATE_HZ: f64 = 200.0;
/// Half of the time over which one measurement is the mean, seconds.
const HALF_S: f64 = 0.5 / RATE_HZ;

/// Measurements from before the first frame to after the last one.
pub(super) fn measure(
    walk: &Walk,
    gyroscope: &Gyroscope,
    seed: u64,
    last_stamp_nanos: i64,
) -> Vec<GyroSample> {
    let key = random::word(seed, 0x6790);
    let bias = gaussian(key, 0) * gyroscope.bias_sigma_rad_per_s;
    let sigma = gyroscope.noise_rad_per_s_sqrt_hz * RATE_HZ.sqrt();
    let interval_nanos = (1e9 / RATE_HZ) as i64;
    (0..=last_stamp_nanos / interval_nanos + 1)
        .map(|k| {
            let stamp_nanos = k * interval_nanos;
            let at = |shift_s: f64| walk.world_from_camera(stamp_nanos as f64 * 1e-9 + shift_s).rotation;
            let turned = rotation_log(&(at(-HALF_S).inverse() * at(HALF_S)));
            let noise = gaussian(key, 6 * (k as u64 + 1)) * sigma;
            GyroSample { stamp_nanos, rate_rad_per_s: turned / (2.0 * HALF_S) + bias + noise }
        })
        .collect()
}

/// Three independent draws with variance 1 (Box and Muller).
fn gaussian(key: u64, at: u64) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| {
        let u = random::unit(key, at + 2 * axis as u64).max(1e-300);
        let v = random::unit(key, at + 2 * axis as u64 + 1);
        libm::sqrt(-2.0 * libm::log(u)) * libm::cos(TAU * v)
    })
}
