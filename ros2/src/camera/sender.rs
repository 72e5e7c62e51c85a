//! Images into the run, through its public frame service.

use std::collections::VecDeque;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use tessera_geometry::{Camera, InertialRotation, UpDirection};
use tessera_messages::{CameraFlow, CameraFrame, FrameShape, Kind};
use tessera_transport::{Guest, Notifier, SlicePublisher, Subscriber, TransportError};

/// Images whose pose is awaited.
const MOST_AWAITED: usize = 256;
/// Time in which the pose of an image is expected.
const SOON: Duration = Duration::from_millis(30);
/// Time after which the newest image is answered without a pose: a camera that waits for an answer to each image
/// would wait in vain where the run left this one out. Cameras that wait for none send another one long before.
const LATE: Duration = Duration::from_secs(2);

/// Writes images of one camera.
pub(crate) struct Sender {
    header: CameraFrame,
    shape: FrameShape,
    publisher: Option<SlicePublisher<CameraFrame, u16>>,
    flow: Option<Subscriber<CameraFlow>>,
    notifier: Option<Notifier>,
    is_finished: bool,
    /// The next image that is sent asks for relocalisation, and then it is `false` again.
    pub(crate) asks_relocalisation: bool,
    n_sent: u64,
    /// Index behind that of the last image.
    next: u64,
    awaited: VecDeque<(i64, Instant)>,
}

/// What became of an image.
pub(crate) enum SendOutcome {
    /// It was sent.
    Sent,
    /// The run has not made its service yet, or needs nothing more.
    NotWanted,
    /// It cannot be used: why.
    Refused(String),
}

impl Sender {
    pub(crate) fn new(camera: &Camera) -> Self {
        let session = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |d| u64::try_from(d.as_nanos()).unwrap_or(0));
        let header = CameraFrame { session, ..CameraFrame::of_camera(camera) };
        let shape = FrameShape { width: camera.width, height: camera.height };
        Self {
            header,
            shape,
            publisher: None,
            flow: None,
            notifier: None,
            is_finished: false,
            asks_relocalisation: false,
            n_sent: 0,
            next: 0,
            awaited: VecDeque::new(),
        }
    }

    /// Number of this start of the program: its time, nanoseconds since 1970.
    pub(crate) fn session(&self) -> u64 {
        self.header.session
    }

    /// Images sent so far.
    pub(crate) fn n_sent(&self) -> u64 {
        self.n_sent
    }

    /// Whether the run needs no more.
    pub(crate) fn is_finished(&mut self) -> Result<bool, TransportError> {
        if let Some(flow) = &self.flow
            && let Some(flow) = flow.newest()?
        {
            self.is_finished = flow.finished == 1;
        }
        Ok(self.is_finished)
    }

    /// Whether the pose of an image that was sent not long ago has not come.
    pub(crate) fn awaits_pose(&self) -> bool {
        self.awaited.back().is_some_and(|(_, at)| at.elapsed() < SOON)
    }

    /// Time in the run of the newest image where its pose has not come in time, nor another image; told once.
    pub(crate) fn take_late(&mut self) -> Option<i64> {
        let (stamp_nanos, _) = self.awaited.back().copied().filter(|(_, at)| at.elapsed() >= LATE)?;
        self.awaited.clear();
        Some(stamp_nanos)
    }

    /// When the image of that time was received; earlier ones are forgotten.
    pub(crate) fn received_at(&mut self, stamp_nanos: i64) -> Option<Instant> {
        while let Some((stamp, at)) = self.awaited.front().copied() {
            if stamp > stamp_nanos {
                return None;
            }
            self.awaited.pop_front();
            if stamp == stamp_nanos {
                return Some(at);
            }
        }
        None
    }

    /// Tells the run that no image follows: it then ends by itself, with its last optimisation. `false` where
    /// it had no image yet.
    ///
    /// # Errors
    /// As [`Self::send`].
    pub(crate) fn end(&mut self) -> Result<bool, TransportError> {
        let Some(publisher) = self.publisher.as_ref().filter(|_| self.n_sent > 0) else { return Ok(false) };
        let mut loan = publisher.loan(1)?;
        *loan.header_mut() = CameraFrame { index: self.next, kind: Kind::End.to_wire(), ..self.header };
        loan.send()?;
        if let Some(notifier) = &self.notifier {
            notifier.notify();
        }
        Ok(true)
    }

    /// Sends an image that `decode` writes in place: depth, and colour where `has_colour`.
    ///
    /// # Errors
    /// Where the run's shared memory is broken.
    pub(crate) fn send(
        &mut self,
        guest: &Guest,
        image: &SentImage,
        decode: impl FnOnce(&mut [u16], Option<&mut [u8]>) -> Result<(), String>,
    ) -> Result<SendOutcome, TransportError> {
        if self.publisher.is_none() {
            self.publisher = guest.camera_publisher(self.shape)?;
            self.flow = guest.camera_flow_subscriber()?;
            self.notifier = guest.sensor_notifier()?;
        }
        if self.is_finished()? {
            return Ok(SendOutcome::NotWanted);
        }
        let Some(publisher) = &self.publisher else { return Ok(SendOutcome::NotWanted) };
        let n_pixels = self.shape.n_pixels();
        let len = if image.has_colour { self.shape.payload_len() } else { n_pixels };
        let mut loan = publisher.loan(len)?;
        let decoded = match self.shape.split_mut(loan.payload_mut()) {
            Some((depth, colour)) => decode(depth, Some(colour)),
            None => decode(loan.payload_mut(), None),
        };
        if let Err(why) = decoded {
            return Ok(SendOutcome::Refused(why));
        }
        *loan.header_mut() = CameraFrame {
            index: image.index,
            stamp_nanos: image.stamp_nanos,
            rotation: image.rotation.into(),
            up: image.up.into(),
            has_colour: u32::from(image.has_colour),
            kind: if self.asks_relocalisation { CameraFrame::RELOCALISE } else { Kind::Frame.to_wire() },
            ..self.header
        };
        loan.send()?;
        self.asks_relocalisation = false;
        if let Some(notifier) = &self.notifier {
            notifier.notify();
        }
        self.n_sent = self.n_sent.saturating_add(1);
        self.next = image.index.saturating_add(1);
        if self.awaited.len() == MOST_AWAITED {
            self.awaited.pop_front();
        }
        self.awaited.push_back((image.stamp_nanos, image.received_at));
        Ok(SendOutcome::Sent)
    }
}

/// What is said of an image beside its pixels.
pub(crate) struct SentImage {
    /// Counts the depth images of the topic, those left out too.
    pub(crate) index: u64,
    /// Time in the run.
    pub(crate) stamp_nanos: i64,
    /// By a gyroscope.
    pub(crate) rotation: Option<InertialRotation>,
    /// By an accelerometer, or by where the camera is on a robot that stands level.
    pub(crate) up: Option<UpDirection>,
    pub(crate) has_colour: bool,
    pub(crate) received_at: Instant,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_image_is_late_once_and_no_other() {
        let mut sender = Sender::new(&Camera::pinhole((4, 4), [3.0, 3.0, 1.5, 1.5], 1000.0));
        let long_ago = Instant::now().checked_sub(2 * LATE).unwrap();
        sender.awaited.extend([(1, long_ago), (2, Instant::now())]);
        assert_eq!(sender.take_late(), None, "another image came");
        sender.awaited.extend([(3, long_ago)]);
        assert_eq!((sender.take_late(), sender.take_late()), (Some(3), None));
        sender.awaited.extend([(4, long_ago)]);
        assert_eq!(sender.received_at(4), Some(long_ago));
        assert_eq!(sender.take_late(), None, "its pose came");
    }
}
