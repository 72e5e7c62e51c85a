//! `sensor_msgs/msg/Imu`: angular rates and specific forces of a recording, in the axes of the depth camera.

use crate::chunks::{Chunks, FoundMessage};
use crate::error::MessageError;
use crate::messages::{MessageWire, of_wire};
use crate::topics::Topics;
use crate::transforms::{FrameTree, static_frames};
use crate::{ros, ros1};
use nalgebra::{UnitQuaternion, Vector3};
use std::collections::BTreeMap;
use tessera_frames::imu::{ForceSample, GyroSample, ImuRecording};

/// No gyroscope turns faster, radians per second.
const MOST_RAD_PER_S: f64 = 100.0;
/// No accelerometer measures more, metres per second squared.
const MOST_M_PER_S2: f64 = 500.0;

/// What is used of an Imu message.
#[derive(Clone, Debug, PartialEq)]
pub struct ImuMessage {
    /// Time of the measurement, nanoseconds.
    pub stamp_nanos: i64,
    /// Frame of its vectors.
    pub frame: String,
    /// Angular rate, radians per second; `None` where the message has none.
    pub rate_rad_per_s: Option<[f64; 3]>,
    /// Specific force, metres per second squared; `None` where the message has none: zero, or marked so.
    pub force_m_per_s2: Option<[f64; 3]>,
}

impl ImuMessage {
    /// Reads a `sensor_msgs/msg/Imu` in CDR.
    ///
    /// # Errors
    /// Where the bytes are no such message, or the numbers no measurement.
    pub fn read(message: &[u8]) -> Result<Self, MessageError> {
        ros::imu(message)?.checked()
    }

    pub(crate) fn of(wire: MessageWire, message: &[u8]) -> Result<Self, MessageError> {
        of_wire(wire, message, ros::imu, ros1::imu)?.checked()
    }
}

/// The numbers of a message. In a field without a measurement the first variance is -1.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ImuFields {
    pub(crate) stamp_nanos: i64,
    pub(crate) frame: String,
    pub(crate) rate: ([f64; 3], f64),
    pub(crate) force: ([f64; 3], f64),
}

impl ImuFields {
    fn checked(self) -> Result<ImuMessage, MessageError> {
        let of = |what: &str, (values, variance): ([f64; 3], f64), most: f64| {
            let is_measured = values.iter().all(|value| value.abs() <= most);
            match variance >= 0.0 {
                false => Ok(None),
                true if is_measured => Ok(Some(values)),
                true => Err(MessageError::Kind {
                    kind: "sensor_msgs/msg/Imu",
                    reason: format!("its {what} is {values:?}, expected at most {most}"),
                }),
            }
        };
        let rate_rad_per_s = of("angular_velocity in rad/s", self.rate, MOST_RAD_PER_S)?;
        let force = of("linear_acceleration in m/s^2", self.force, MOST_M_PER_S2)?;
        // Where a driver has no accelerometer, or leaves it to another topic.
        let force_m_per_s2 = force.filter(|force| *force != [0.0; 3]);
        let frame = self.frame.trim_start_matches('/').to_owned();
        Ok(ImuMessage { stamp_nanos: self.stamp_nanos, frame, rate_rad_per_s, force_m_per_s2 })
    }
}

/// The instruments of a recording, and where they stand.
#[derive(Clone, Debug, Default)]
pub(super) struct Instruments {
    /// For each frame of a message how it stands to the depth camera; `None`: that is not known.
    camera_from_frame: BTreeMap<String, Option<UnitQuaternion<f64>>>,
    /// Of the depth camera, by its CameraInfo.
    camera_frame: String,
}

impl Instruments {
    /// Where they stand by the recording's transforms.
    pub(super) fn find(chunks: &Chunks, found: &FoundMessage, camera_frame: &str) -> Self {
        let tree = match found.imu.is_empty() {
            true => FrameTree::default(),
            false => static_frames(chunks, found),
        };
        let camera_frame = camera_frame.trim_start_matches('/');
        let stands = |frame: &str| match frame == camera_frame {
            true => Some(UnitQuaternion::identity()),
            false => tree.between(frame, camera_frame).map(|pose| pose.rotation),
        };
        let mut camera_from_frame = BTreeMap::new();
        for (_, message) in &found.imu {
            if !camera_from_frame.contains_key(&message.frame) {
                camera_from_frame.insert(message.frame.clone(), stands(&message.frame));
            }
        }
        Self { camera_from_frame, camera_frame: camera_frame.to_owned() }
    }

    /// What was measured; nothing where the images are not by the same clock any more.
    pub(super) fn recording(
        &self,
        topics: &Topics,
        found: &FoundMessage,
        is_on_one_clock: bool,
    ) -> ImuRecording {
        let mut recording = ImuRecording::default();
        if !is_on_one_clock {
            return recording;
        }
        // Of a topic of forces alone all rates are zero.
        let has_rates: Vec<bool> = (0..topics.imu.len())
            .map(|topic| {
                let mut rates = found.imu.iter().filter(|(of, _)| *of == topic);
                rates.any(|(_, message)| message.rate_rad_per_s.is_some_and(|rate| rate != [0.0; 3]))
            })
            .collect();
        for (topic, message) in &found.imu {
            let Some(Some(camera_from_imu)) = self.camera_from_frame.get(&message.frame) else { continue };
            let turned = |values: [f64; 3]| camera_from_imu.transform_vector(&Vector3::from(values));
            let stamp_nanos = message.stamp_nanos;
            let rate = message.rate_rad_per_s.filter(|_| has_rates.get(*topic) == Some(&true));
            recording.rates.extend(rate.map(|rate| GyroSample { stamp_nanos, rate_rad_per_s: turned(rate) }));
            let force = message.force_m_per_s2.map(turned);
            recording.forces.extend(force.map(|force_m_per_s2| ForceSample { stamp_nanos, force_m_per_s2 }));
        }
        recording.rates.sort_by_key(|sample| sample.stamp_nanos);
        recording.rates.dedup_by_key(|sample| sample.stamp_nanos);
        recording.forces.sort_by_key(|sample| sample.stamp_nanos);
        recording.forces.dedup_by_key(|sample| sample.stamp_nanos);
        recording
    }

    /// Sentences on what could not be used.
    pub(super) fn left_out(&self, found: &FoundMessage) -> Vec<String> {
        let unplaced = self.camera_from_frame.iter().filter(|(_, known)| known.is_none());
        let unplaced = unplaced.map(|(frame, _)| {
            let camera = &self.camera_frame;
            format!("/tf_static has no way from {frame:?} to {camera:?}: the IMU is left out")
        });
        let malformed = found.malformed_imu.first().map(|words| {
            format!("{} messages of the IMU are left out, the first: {words}", found.malformed_imu.len())
        });
        unplaced.chain(malformed).collect()
    }
}
