//! Every image, in order: the camera's program keeps a ring of them and sends again what is asked for.

use super::camera::{ExternalCamera, ExternalImage};
use super::{copy, most_frames};
use crate::sending::{Supplied, Supply, Turn};
use tessera_messages::{CameraFlow, Kind, WaitingOn};
use tessera_stage::{StageContext, StageError, monotonic_nanos};

/// How long a hole in the indices may last before what is missing is asked for again.
const GRACE_NANOS: u64 = 100_000_000;
/// How long nothing may come before it is asked for again.
const PATIENCE_NANOS: u64 = 1_000_000_000;
/// Requests for a frame that were answered with later ones, until the ring is called too short.
const MOST_REQUESTS: u32 = 10;

/// What was asked for last.
struct AwaitedFrame {
    /// First frame that is missing.
    next: u64,
    epoch: u64,
    /// When the camera last did what was asked, or was asked.
    at: u64,
    /// A later frame has come since.
    later: Option<u64>,
    /// Requests for the same frame.
    n: u32,
    /// The camera has sent all its images.
    has_ended: bool,
}

impl AwaitedFrame {
    fn new(next: u64) -> Self {
        let now = monotonic_nanos();
        Self { next, epoch: now, at: now, later: None, n: 1, has_ended: false }
    }

    fn repeat(&mut self) {
        let now = monotonic_nanos();
        (self.epoch, self.at, self.later) = (now, now, None);
        self.n = self.n.saturating_add(1);
    }

    fn is_due(&self) -> bool {
        let patience = if self.later.is_some() { GRACE_NANOS } else { PATIENCE_NANOS };
        monotonic_nanos().saturating_sub(self.at) > patience
    }
}

/// The camera's images by their indices.
pub(super) struct InOrder {
    camera: ExternalCamera,
    request: AwaitedFrame,
    window: u64,
}

impl InOrder {
    pub(super) fn new(camera: ExternalCamera, window: u64) -> Self {
        Self { camera, request: AwaitedFrame::new(0), window }
    }

    /// Uses an image if it is the next one, else notes it.
    fn take(&mut self, image: &ExternalImage, turn: &mut Turn<'_>) -> Result<Supplied, StageError> {
        let (index, request) = (image.header.index, &mut self.request);
        if index < request.next {
            turn.note_duplicate();
            return Ok(Supplied::Again);
        }
        if index > request.next {
            request.later.get_or_insert(index);
            return Ok(Supplied::Again);
        }
        self.camera.note_usable();
        if image.kind == Kind::End {
            request.has_ended = true;
            return Ok(Supplied::Again);
        }
        turn.ports.pulse.working(index);
        let mut frame = copy(image, index, turn.ports, turn.context)?;
        if image.header.asks_relocalisation() {
            frame.loan.header_mut().relocalise_from = index;
        }
        (request.next, request.at, request.later, request.n) =
            (index.saturating_add(1), monotonic_nanos(), None, 1);
        Ok(Supplied::Frame { frame, due_nanos: 0 })
    }

    /// Asks again for the frame that does not come.
    fn repeat_request(&mut self) -> Result<(), StageError> {
        let AwaitedFrame { next, n, later, .. } = self.request;
        if let Some(later) = later.filter(|_| n >= MOST_REQUESTS) {
            return Err(StageError::Input(format!(
                "frame {next} was asked for {n} times, and the camera sends frame {later}: it must keep its \
                 last {} frames and send again from the index that camera_flow names",
                self.window.saturating_mul(2)
            )));
        }
        self.request.repeat();
        Ok(())
    }
}

impl Supply for InOrder {
    fn begin_epoch(&mut self, _: &StageContext, first_missing: u64) -> Result<(), StageError> {
        self.request = AwaitedFrame::new(first_missing);
        Ok(())
    }

    fn next(&mut self, turn: &mut Turn<'_>) -> Result<Supplied, StageError> {
        let next = self.request.next;
        self.camera.publish_flow(CameraFlow {
            epoch: self.request.epoch,
            send_from: next,
            send_below: turn.limit,
            finished: 0,
        })?;
        let has_room = next < turn.limit;
        self.request.has_ended |= has_room && most_frames(turn.context) == Some(next);
        let is_wanted = has_room && !self.request.has_ended;
        if is_wanted && let Some(image) = self.camera.receive(&mut turn.ports.pulse)? {
            return self.take(&image, turn);
        }
        if is_wanted && self.request.is_due() {
            self.repeat_request()?;
        }
        self.camera.check_silence(next, is_wanted)?;
        if self.request.has_ended {
            return Ok(Supplied::End(next));
        }
        Ok(Supplied::Wait(if is_wanted { WaitingOn::Camera } else { WaitingOn::Credit }))
    }

    fn finish(&mut self) -> Result<(), StageError> {
        self.camera.publish_finished()
    }
}
