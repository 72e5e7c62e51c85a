//! A gyroscope and an accelerometer on the simulated camera: true rates and forces with seeded noise and constant
//! errors.

use crate::path::Walk;
use crate::random;
use nalgebra::Vector3;
use std::f64::consts::TAU;
use tessera_frames::imu::{ForceSample, GyroSample, ImuModel, ImuRecording};
use tessera_geometry::rotation_log;

/// Measurements per second.
const RATE_HZ: f64 = 200.0;
/// Half of the time over which one measurement is the mean, seconds.
const HALF_S: f64 = 0.5 / RATE_HZ;
/// White noise of the specific force, metres per second squared per root hertz: of a cheap accelerometer.
const FORCE_NOISE: f64 = 0.002;
/// Against gravity, metres per second squared. World axes: z up.
const AGAINST_GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, 9.81);

/// Measurements from before the first frame to after the last one.
pub(super) fn measure(walk: &Walk, model: &ImuModel, seed: u64, last_stamp_nanos: i64) -> ImuRecording {
    let (rate_key, force_key) = (random::word(seed, 0x6790), random::word(seed, 0xacce));
    let rate_bias = gaussian(rate_key, 0) * model.bias_sigma_rad_per_s;
    let force_bias = gaussian(force_key, 0) * model.bias_sigma_m_per_s2;
    let rate_sigma = model.noise_rad_per_s_sqrt_hz * RATE_HZ.sqrt();
    let force_sigma = FORCE_NOISE * RATE_HZ.sqrt();
    let interval_nanos = (1e9 / RATE_HZ) as i64;
    let mut recording = ImuRecording { model: *model, ..ImuRecording::default() };
    for k in 0..=(last_stamp_nanos / interval_nanos).saturating_add(1) {
        let stamp_nanos = k * interval_nanos;
        let at = |shift_s: f64| walk.world_from_camera(stamp_nanos as f64 * 1e-9 + shift_s);
        let (before, now, after) = (at(-HALF_S), at(0.0), at(HALF_S));
        let noise = |key| gaussian(key, 6 * (k as u64 + 1));
        let turned = rotation_log(&(before.rotation.inverse() * after.rotation));
        let rate_rad_per_s = turned / (2.0 * HALF_S) + rate_bias + noise(rate_key) * rate_sigma;
        recording.rates.push(GyroSample { stamp_nanos, rate_rad_per_s });
        let [before, middle, after] = [before, now, after].map(|pose| pose.translation.vector);
        let acceleration = (before - 2.0 * middle + after) / (HALF_S * HALF_S);
        let force = now.rotation.inverse() * (acceleration + AGAINST_GRAVITY);
        let force_m_per_s2 = force + force_bias + noise(force_key) * force_sigma;
        recording.forces.push(ForceSample { stamp_nanos, force_m_per_s2 });
    }
    recording
}

/// Three independent draws with variance 1 (Box and Muller).
fn gaussian(key: u64, at: u64) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| {
        let u = random::unit(key, at + 2 * axis as u64).max(1e-300);
        let v = random::unit(key, at + 2 * axis as u64 + 1);
        libm::sqrt(-2.0 * libm::log(u)) * libm::cos(TAU * v)
    })
}

#[cfg(test)]
mod tests {
    use crate::{SceneName, SimulatedSource, SimulationOptions};
    use nalgebra::Vector3;
    use tessera_frames::Source;

    #[test]
    fn up_is_right_within_its_deviation_from_the_first_frame_on() {
        let (mut n, mut ratios) = (0, 0.0);
        for seed in 1..=30 {
            for name in [SceneName::Room, SceneName::House, SceneName::Corridor] {
                let options = SimulationOptions { imu: true, seed, ..SimulationOptions::default() };
                let source = SimulatedSource::open(name, None, None, &options).unwrap();
                let truth = &source.ground_truth().unwrap().poses;
                for index in [0, 1, 100, 299] {
                    let up = source.up(index).unwrap();
                    let world_from_camera = truth[index as usize].rotation;
                    let error = (world_from_camera * Vector3::from(up.in_camera)).angle(&Vector3::z());
                    // Two axes.
                    assert!(error < 4.0 * up.sigma_rad, "{name:?} {seed} {index}: {error} rad, {up:?}");
                    assert!(up.sigma_rad < 0.04, "{name:?} {seed} {index}: {up:?}");
                    n += 1;
                    ratios += 0.5 * (error / up.sigma_rad) * (error / up.sigma_rad);
                }
            }
        }
        let ratio = ratios / f64::from(n);
        println!("mean square of error over deviation: {ratio:.2} of {n} frames");
        assert!((0.3..1.5).contains(&ratio), "mean square of error over deviation: {ratio}");
    }
}
