//! The gyroscope of a recording: angular rates of an IMU topic in the axes of the depth camera.

use crate::chunks::{Chunks, FoundMessage};
use crate::librealsense;
use crate::transforms;
use nalgebra::Vector3;
use tessera_frames::imu::{GyroSample, Gyroscope, rotations};
use tessera_geometry::InertialRotation;

/// No instrument on a hand-held camera measures more, radians per second.
const MOST_RAD_PER_S: f64 = 100.0;
/// Share of the samples that may be left out: beyond, the topic is something else.
const MOST_WRONG: f64 = 0.01;

/// An IMU message as far as it is used.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ImuMessage {
    pub(super) stamp_nanos: i64,
    pub(super) frame: String,
    /// About the instrument's axes, radians per second.
    pub(super) rate_rad_per_s: [f64; 3],
}

/// Angular rates about the camera's axes, in the order of time.
#[derive(Clone, Debug, Default)]
pub(super) struct RecordedGyroscope {
    pub(super) samples: Vec<GyroSample>,
    /// What was found, for people.
    pub(super) words: String,
}

impl RecordedGyroscope {
    /// The samples of a topic.
    ///
    /// # Errors
    /// Why they are not used, as a sentence.
    pub(super) fn of(
        chunks: &Chunks,
        found: &FoundMessage,
        topic: &str,
        camera_frame: &str,
    ) -> Result<Self, String> {
        let left_out = |why: String| format!("{topic} is left out: {why}");
        let Some(first) = found.imu.first() else { return Err(left_out("it has no messages".to_owned())) };
        let named = first.frame.trim_start_matches('/').to_owned();
        let named = if named.is_empty() { librealsense::stream_of(topic).unwrap_or_default() } else { named };
        let frame = named.as_str();
        let Some(camera_from_imu) = transforms::between_frames(chunks, found, frame, camera_frame) else {
            return Err(left_out(format!("nothing says how '{frame}' is turned from '{camera_frame}'")));
        };
        let is_rate = |message: &&ImuMessage| {
            message.frame == first.frame
                && message.rate_rad_per_s.iter().all(|rate| rate.abs() < MOST_RAD_PER_S)
        };
        let mut samples: Vec<GyroSample> = found
            .imu
            .iter()
            .filter(is_rate)
            .map(|message| GyroSample {
                stamp_nanos: message.stamp_nanos,
                rate_rad_per_s: camera_from_imu
                    .rotation
                    .transform_vector(&Vector3::from(message.rate_rad_per_s)),
            })
            .collect();
        let n_wrong = found.imu.len().saturating_sub(samples.len());
        if n_wrong as f64 > MOST_WRONG * found.imu.len() as f64 {
            let n = found.imu.len();
            return Err(left_out(format!("{n_wrong} of {n} messages have no angular rate of '{frame}'")));
        }
        if samples.iter().all(|sample| sample.rate_rad_per_s == Vector3::zeros()) {
            return Err(left_out("all its angular rates are 0".to_owned()));
        }
        samples.sort_by_key(|sample| sample.stamp_nanos);
        samples.dedup_by_key(|sample| sample.stamp_nanos);
        let words = format!("{topic}, {} samples", samples.len());
        Ok(Self { samples, words })
    }

    /// The rotation at each frame since the first one.
    ///
    /// # Errors
    /// Most frames have no sample near them: another clock.
    pub(super) fn rotations(&self, topic: &str, stamps: &[i64]) -> Result<Vec<InertialRotation>, String> {
        let range = self.samples.first().zip(self.samples.last());
        let covers = |stamp: &&i64| {
            range.is_some_and(|(first, last)| (first.stamp_nanos..=last.stamp_nanos).contains(*stamp))
        };
        let n = stamps.iter().filter(covers).count();
        if n.saturating_mul(2) < stamps.len() {
            return Err(format!(
                "{topic} is left out: it covers the times of {n} of {} depth images",
                stamps.len()
            ));
        }
        Ok(rotations(&Gyroscope::default(), &self.samples, stamps))
    }
}
