//! Each image, once the camera is known: paired, decoded in place and sent. What cannot be used is told,
//! counted and left out.

use crate::camera::first::{large_change, small_change};
use crate::camera::gyro::Gyro;
use crate::camera::pairing::{LivePairing, Stamped};
use crate::camera::sender::{SendOutcome, Sender, SentImage};
use crate::camera::topics::{CameraTopics, ImageTopics};
use crate::error::Ros2Error;
use crate::poses::base::Base;
use crate::report::take;
use crate::report::{Report, ReportEvent};
use crate::run::clock::{ImageClock, Tick};
use nalgebra::{UnitQuaternion, Vector3};
use std::time::{Duration, Instant};
use tessera_geometry::{InertialRotation, UpDirection};
use tessera_recording::{Change, FrameTree, ImuMessage, LiveCamera, LiveImage};
use tessera_transport::Guest;

/// Bytes of a message up to the end of its time.
const STAMP_BYTES: usize = 12;
/// The first image waits at most so long for an IMU: gravity is known a second after its first message.
const MOST_TO_LEVEL: Duration = Duration::from_secs(3);

/// What is needed for each image, once the camera is known.
pub(crate) struct Going {
    camera: LiveCamera,
    pub(crate) base: Base,
    pub(crate) sender: Sender,
    pairing: LivePairing,
    /// Of the newest CameraInfo, what follows its time.
    info: Vec<u8>,
    is_other_camera: bool,
    n_colour: u64,
    gyro: Gyro,
    /// Frame of the IMU's vectors, and how it stands to the camera, once both are known.
    camera_from_imu: Option<(String, UnitQuaternion<f64>)>,
    /// With an IMU: the first image waits so long for the direction of gravity.
    awaits_up_until: Option<Instant>,
}

/// What is told of an image beside its pixels.
#[derive(Clone, Copy)]
struct Told {
    /// Time in the run.
    stamp_nanos: i64,
    rotation: Option<InertialRotation>,
    up: Option<UpDirection>,
}

impl Going {
    /// For that camera; `has_imu`: an IMU is listened to.
    pub(crate) fn new(camera: LiveCamera, base: Base, has_imu: bool) -> Self {
        let sender = Sender::new(camera.camera());
        Self {
            gyro: Gyro::new(sender.session()),
            camera_from_imu: None,
            awaits_up_until: has_imu.then(|| Instant::now().checked_add(MOST_TO_LEVEL)).flatten(),
            sender,
            base,
            pairing: LivePairing::default(),
            info: Vec::new(),
            is_other_camera: false,
            n_colour: 0,
            camera,
        }
    }

    /// Takes a message of the IMU.
    pub(crate) fn take_imu(&mut self, message: &[u8], frames: &FrameTree, report: &mut Report) {
        let imu = match ImuMessage::read(message) {
            Ok(imu) => imu,
            Err(error) => return report.note(ReportEvent::Malformed, || error.to_string()),
        };
        if self.camera_from_imu.as_ref().is_none_or(|(frame, _)| *frame != imu.frame) {
            let camera = self.camera.frame();
            let known = match camera == imu.frame {
                true => Some(UnitQuaternion::identity()),
                false => frames.between(&imu.frame, camera).map(|pose| pose.rotation),
            };
            let Some(camera_from_imu) = known else {
                return report.note(ReportEvent::Imu, || {
                    format!("/tf_static has no way from {:?} to {camera:?}: the IMU is left out", imu.frame)
                });
            };
            self.camera_from_imu = Some((imu.frame.clone(), camera_from_imu));
        }
        if let Some((_, camera_from_imu)) = &self.camera_from_imu {
            let turned = |vector| camera_from_imu.transform_vector(&Vector3::from(vector));
            let (rate, force) = (imu.rate_rad_per_s.map(turned), imu.force_m_per_s2.map(turned));
            self.gyro.add(imu.stamp_nanos, rate, force);
        }
    }

    /// Compares each CameraInfo with the first one.
    pub(crate) fn take_infos(&mut self, topics: &mut CameraTopics, report: &mut Report) {
        if let Some(infos) = &mut topics.colour_info {
            // Only the first one counts.
            while take(&mut **infos, report).is_some() {}
        }
        let Some(infos) = &mut topics.info else { return };
        while let Some(message) = take(&mut **infos, report) {
            let rest = message.get(STAMP_BYTES..).unwrap_or_default();
            if rest == self.info {
                continue;
            }
            self.info = rest.to_owned();
            let (topic, first) = (&topics.depth.topic, self.camera.camera());
            match self.camera.compare(&message) {
                Ok(Change::None) => self.is_other_camera = false,
                Ok(Change::Small(found)) => {
                    self.is_other_camera = false;
                    report.note(ReportEvent::CameraChanged, || small_change(topic, first, &found));
                }
                Ok(Change::Large(found)) => {
                    self.is_other_camera = true;
                    report.note(ReportEvent::CameraChanged, || large_change(topic, first, &found));
                }
                Err(error) => {
                    report.note(ReportEvent::Malformed, || format!("CameraInfo of {topic}: {error}"))
                }
            }
        }
    }

    pub(crate) fn take_colours(&mut self, topics: &mut CameraTopics, report: &mut Report) {
        let Some(colour) = &mut topics.colour else { return };
        while let Some(message) = take(&mut *colour.messages, report) {
            self.n_colour = self.n_colour.saturating_add(1);
            let read = LiveImage::read(colour.kind, &message).map(|image| image.stamp_nanos());
            match read {
                Ok(stamp_nanos) if self.camera.uses_colour() => {
                    self.pairing.add_colour(Stamped { stamp_nanos, index: self.n_colour, message });
                }
                Ok(_) => {}
                Err(error) => report.note(ReportEvent::Malformed, || format!("{}: {error}", colour.topic)),
            }
        }
    }

    pub(crate) fn take_depth(
        &mut self,
        images: &ImageTopics,
        mut depth: Stamped,
        now_nanos: i64,
        report: &mut Report,
    ) {
        if self.is_other_camera {
            return report.count(ReportEvent::OtherCamera);
        }
        let read = LiveImage::read(images.kind, &depth.message).map(|image| image.stamp_nanos());
        match read {
            Ok(stamp_nanos) => {
                depth.stamp_nanos = stamp_nanos;
                self.pairing.add_depth(depth, now_nanos);
            }
            Err(error) => report.note(ReportEvent::Malformed, || format!("{}: {error}", images.topic)),
        }
    }

    /// Sends all images whose colour is known.
    pub(crate) fn send(
        &mut self,
        topics: &CameraTopics,
        guest: &Guest,
        (clock, now_nanos): (&mut ImageClock, i64),
        report: &mut Report,
    ) -> Result<(), Ros2Error> {
        let (name, has_colour) = (&topics.depth.topic, self.camera.uses_colour());
        while let Some((depth, colour)) = self.pairing.next(has_colour, now_nanos) {
            let stamp_nanos = match clock.tick(depth.stamp_nanos) {
                Tick::At(stamp_nanos) => stamp_nanos,
                Tick::Jumped(back, stamp_nanos) => {
                    report.note(ReportEvent::ClockJump, || {
                        format!(
                            "{name}: the clock jumped back by {:.3} s; the run's time goes on",
                            back as f64 * 1e-9
                        )
                    });
                    self.gyro.forget();
                    stamp_nanos
                }
                Tick::Late => {
                    let at = depth.stamp_nanos;
                    report.note(ReportEvent::OutOfOrder, || {
                        format!("{name}: time {at} ns is not after that of the image before it: left out")
                    });
                    continue;
                }
            };
            if has_colour && colour.is_none() {
                report.count(ReportEvent::WithoutColour);
            }
            // By a robot that is taken to stand level, where nothing measures it.
            let measured = self.gyro.up(depth.stamp_nanos);
            if self.awaits_up(measured.is_some()) {
                report.count(ReportEvent::Before);
                continue;
            }
            let up = measured.or_else(|| self.base.up());
            let rotation = self.gyro.rotation(depth.stamp_nanos);
            let told = Told { stamp_nanos, rotation, up };
            self.send_one(topics, guest, (&depth, colour.as_ref()), told, report)?;
        }
        Ok(())
    }

    /// Whether the first image is to wait for an IMU that has not yet told where up is.
    fn awaits_up(&mut self, is_known: bool) -> bool {
        let tells_nothing = self.gyro.is_without_force();
        let until =
            self.awaits_up_until.filter(|until| !is_known && !tells_nothing && Instant::now() < *until);
        self.awaits_up_until = until;
        until.is_some()
    }

    fn send_one(
        &mut self,
        topics: &CameraTopics,
        guest: &Guest,
        (depth, colour): (&Stamped, Option<&Stamped>),
        Told { stamp_nanos, rotation, up }: Told,
        report: &mut Report,
    ) -> Result<(), Ros2Error> {
        let camera = &self.camera;
        let colour = topics.colour.as_ref().zip(colour);
        let mut wrong_colour = None;
        let decode = |raw: &mut [u16], rgb: Option<&mut [u8]>| {
            let image = LiveImage::read(topics.depth.kind, &depth.message).map_err(|e| e.to_string())?;
            camera.read_depth(&image, raw).map_err(|e| e.to_string())?;
            if let (Some(rgb), Some((images, colour))) = (rgb, colour) {
                let read = LiveImage::read(images.kind, &colour.message)
                    .and_then(|image| camera.read_colour(&image, raw, rgb));
                if let Err(error) = read {
                    rgb.fill(0);
                    wrong_colour = Some(format!("{}: {error}", images.topic));
                }
            }
            Ok(())
        };
        let image = SentImage {
            index: depth.index,
            stamp_nanos,
            rotation,
            up,
            has_colour: colour.is_some(),
            received_at: Instant::now(),
        };
        let sent = self.sender.send(guest, &image, decode)?;
        if let Some(words) = wrong_colour {
            report.note(ReportEvent::Unusable, || words);
        }
        match sent {
            SendOutcome::Sent => {}
            SendOutcome::NotWanted => report.count(ReportEvent::NotSent),
            SendOutcome::Refused(why) => {
                report.note(ReportEvent::Unusable, || format!("{}: {why}", topics.depth.topic));
            }
        }
        Ok(())
    }
}
