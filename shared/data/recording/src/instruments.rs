//! The IMU of a recording, in the axes of its depth camera.

use crate::chunks::{Chunks, FoundMessage};
use crate::topics::Topics;
use crate::transforms::{FrameTree, static_frames};
use nalgebra::{UnitQuaternion, Vector3};
use std::collections::BTreeMap;
use tessera_frames::imu::{ForceSample, GyroSample, ImuRecording};

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
