//! Rotation of the camera by a gyroscope, as images come: from image to image, added up; and up, by an
//! accelerometer.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::collections::VecDeque;
use tessera_frames::ImuModel;
use tessera_frames::imu::{ForceSample, GyroSample, ImuReach, rotations, up_at};
use tessera_geometry::{InertialRotation, UpDirection};

/// Samples that are kept at most.
const MOST_SAMPLES: usize = 4096;
/// Time for which samples are kept for the direction of gravity, nanoseconds.
const KEPT_NANOS: i64 = 4_200_000_000;
/// Variance that is added where nothing is known of the rotation, radians².
const UNKNOWN_RAD2: f64 = 10.0;
/// Variance by which a second more of age sets sessions apart, radians²: more than a session adds.
const AGE_RAD2: f64 = 20.0;
/// The beginning of 2026, before any session: seconds since 1970.
const LONG_AGO_S: u64 = 1_767_225_600;

/// Rates since the last image, and the rotation up to it.
pub(crate) struct Gyro {
    model: ImuModel,
    samples: VecDeque<GyroSample>,
    /// The same for longer, with the forces.
    recent: (VecDeque<GyroSample>, VecDeque<ForceSample>),
    start_from_camera: UnitQuaternion<f64>,
    variance_rad2: f64,
    /// Time of the last image.
    at_nanos: Option<i64>,
}

impl Gyro {
    /// Begins a session that started at that time. The variance begins with its age: between images of
    /// different sessions nothing is known of the rotation, and the difference of their variances says so.
    pub(crate) fn new(session_nanos: u64) -> Self {
        let age_s = (session_nanos / 1_000_000_000).saturating_sub(LONG_AGO_S);
        Self {
            model: ImuModel::default(),
            samples: VecDeque::new(),
            recent: (VecDeque::new(), VecDeque::new()),
            start_from_camera: UnitQuaternion::identity(),
            variance_rad2: AGE_RAD2 * age_s as f64,
            at_nanos: None,
        }
    }

    /// Takes a rate and a specific force along the camera's axes, radians per second and metres per second squared;
    /// what is not later than the one before is left out.
    pub(crate) fn add(
        &mut self,
        stamp_nanos: i64,
        rate_rad_per_s: Option<Vector3<f64>>,
        force_m_per_s2: Option<Vector3<f64>>,
    ) {
        if let Some(rate_rad_per_s) = rate_rad_per_s {
            let sample = GyroSample { stamp_nanos, rate_rad_per_s };
            push(&mut self.samples, sample, |sample| sample.stamp_nanos);
            push(&mut self.recent.0, sample, |sample| sample.stamp_nanos);
        }
        if let Some(force_m_per_s2) = force_m_per_s2 {
            push(&mut self.recent.1, ForceSample { stamp_nanos, force_m_per_s2 }, |sample| {
                sample.stamp_nanos
            });
        }
    }

    /// Whether there are rates and no forces: a gyroscope alone.
    pub(crate) fn is_without_force(&self) -> bool {
        !self.recent.0.is_empty() && self.recent.1.is_empty()
    }

    /// Up at the time of the next image; `None` where too little was measured before it.
    pub(crate) fn up(&mut self, stamp_nanos: i64) -> Option<UpDirection> {
        let (rates, forces) = &mut self.recent;
        let from = stamp_nanos.saturating_sub(KEPT_NANOS);
        let n_old = rates.partition_point(|sample| sample.stamp_nanos < from);
        rates.drain(..n_old);
        let n_old = forces.partition_point(|sample| sample.stamp_nanos < from);
        forces.drain(..n_old);
        let (rates, forces) = (rates.make_contiguous(), forces.make_contiguous());
        up_at(&self.model, rates, forces, stamp_nanos, ImuReach::Before)
    }

    /// The clock jumped: what was measured before says nothing any more.
    pub(crate) fn forget(&mut self) {
        self.samples.clear();
        self.recent = (VecDeque::new(), VecDeque::new());
        self.at_nanos = None;
        self.variance_rad2 += UNKNOWN_RAD2;
    }

    /// The rotation at the time of the next image; `None` while there is no rate.
    pub(crate) fn rotation(&mut self, stamp_nanos: i64) -> Option<InertialRotation> {
        if self.samples.is_empty() {
            self.at_nanos = None;
            return None;
        }
        match self.at_nanos.filter(|at| *at < stamp_nanos) {
            Some(at) => self.turn(at, stamp_nanos),
            None => self.variance_rad2 += UNKNOWN_RAD2,
        }
        self.at_nanos = Some(stamp_nanos);
        // The last one before the image says how the next interval begins.
        let n_past = self.samples.partition_point(|sample| sample.stamp_nanos <= stamp_nanos);
        self.samples.drain(..n_past.saturating_sub(1));
        let q = self.start_from_camera;
        Some(InertialRotation {
            start_from_camera_xyzw: [q.i, q.j, q.k, q.w],
            variance_rad2: self.variance_rad2,
            bias_sigma_rad_per_s: self.model.bias_sigma_rad_per_s,
        })
    }

    #[expect(clippy::arithmetic_side_effects, reason = "a product of rotations")]
    fn turn(&mut self, from_nanos: i64, to_nanos: i64) {
        let samples = self.samples.make_contiguous();
        let turned = rotations(&self.model, samples, &[from_nanos, to_nanos]);
        let Some(InertialRotation { start_from_camera_xyzw: [x, y, z, w], variance_rad2, .. }) =
            turned.last()
        else {
            return;
        };
        let before_from_now = Quaternion::new(*w, *x, *y, *z);
        let sum = self.start_from_camera.quaternion() * before_from_now;
        self.start_from_camera = UnitQuaternion::new_normalize(sum);
        self.variance_rad2 += variance_rad2.min(UNKNOWN_RAD2);
    }
}

/// Adds a sample that is later than the last one, and drops the first where there are too many.
fn push<T>(samples: &mut VecDeque<T>, sample: T, stamp_nanos: impl Fn(&T) -> i64) {
    if samples.back().is_some_and(|last| stamp_nanos(&sample) <= stamp_nanos(last)) {
        return;
    }
    if samples.len() == MOST_SAMPLES {
        samples.pop_front();
    }
    samples.push_back(sample);
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;
    const NOW: u64 = 1_790_000_000_000_000_000;

    /// Rates that change with time, at 200 Hz.
    fn feed(gyro: &mut Gyro, from_ms: i64, to_ms: i64) {
        for ms in (from_ms..to_ms).step_by(5) {
            gyro.add(ms * MS, Some(Vector3::new(1e-3 * ms as f64, 0.5, -0.2)), None);
        }
    }

    #[test]
    fn image_by_image_it_is_what_all_samples_at_once_say() {
        let (mut gyro, mut all) = (Gyro::new(NOW), Vec::new());
        let mut found = Vec::new();
        for image in 0..20 {
            feed(&mut gyro, 35 * image, 35 * (image + 1));
            found.push(gyro.rotation((30 + 35 * image) * MS).unwrap());
        }
        for ms in (0..700).step_by(5) {
            let rate_rad_per_s = Vector3::new(1e-3 * ms as f64, 0.5, -0.2);
            all.push(GyroSample { stamp_nanos: ms * MS, rate_rad_per_s });
        }
        let stamps: Vec<i64> = (0..20).map(|image| (30 + 35 * image) * MS).collect();
        let expected = rotations(&ImuModel::default(), &all, &stamps);
        for k in 1..20 {
            let seconds = 0.035 * k as f64;
            let (ours, theirs) =
                (found[0].until(&found[k], seconds), expected[0].until(&expected[k], seconds));
            assert!(ours.earlier_from_later.angle_to(&theirs.earlier_from_later) < 1e-9);
            assert!(
                (ours.sigma_rad - theirs.sigma_rad).abs() < 1e-3,
                "{} {}",
                ours.sigma_rad,
                theirs.sigma_rad
            );
        }
        assert!(gyro.samples.len() < 10);
    }

    #[test]
    fn up_is_known_a_second_after_the_first_force() {
        let mut gyro = Gyro::new(NOW);
        for ms in (0..6000).step_by(5) {
            gyro.add(ms * MS, Some(Vector3::zeros()), Some(Vector3::new(0.0, -9.8, 0.1)));
            if ms == 500 {
                assert_eq!(gyro.up(ms * MS), None);
            }
        }
        let up = gyro.up(6000 * MS).unwrap();
        assert!(up.in_camera[1] < -0.999 && up.sigma_rad < 0.03, "{up:?}");
        assert!(gyro.recent.1.len() < 900, "{}", gyro.recent.1.len());
        gyro.forget();
        assert_eq!(gyro.up(6000 * MS), None);
    }

    #[test]
    fn nothing_is_known_between_sessions_and_over_jumps_and_gaps() {
        let mut gyro = Gyro::new(NOW);
        assert_eq!(gyro.rotation(0), None);
        feed(&mut gyro, 0, 100);
        let first = gyro.rotation(50 * MS).unwrap();
        let second = gyro.rotation(90 * MS).unwrap();
        assert!(first.until(&second, 0.04).sigma_rad < 0.01 && first.is_valid());
        // No rate for a second.
        let third = gyro.rotation(1090 * MS).unwrap();
        assert!(second.until(&third, 1.0).sigma_rad > 1.0);
        gyro.forget();
        feed(&mut gyro, 0, 100);
        let fourth = gyro.rotation(50 * MS).unwrap();
        assert!(third.until(&fourth, 0.03).sigma_rad > 3.0);
        let mut next = Gyro::new(NOW + 2_000_000_000);
        feed(&mut next, 0, 100);
        assert!(fourth.until(&next.rotation(90 * MS).unwrap(), 0.03).sigma_rad > 1.0);
    }
}
