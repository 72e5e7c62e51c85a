//! Every image, in order: the camera's program keeps a ring of them and sends again what is asked for.

use super::camera::{Camera, Image};
use super::{copy, end, most_frames};
use crate::Ports;
use crate::hear::hear;
use crate::send::send;
use tessera_messages::{CameraFlow, Flow, Kind, WaitingOn};
use tessera_stage::{Context, IDLE, Outcome, StageError, monotonic_nanos};

/// How long a hole in the indices may last before what is missing is asked for again.
const GRACE_NANOS: u64 = 100_000_000;
/// How long nothing may come before it is asked for again.
const PATIENCE_NANOS: u64 = 1_000_000_000;
/// Requests for a frame that were answered with later ones, until the ring is called too short.
const MOST_REQUESTS: u32 = 10;

/// What was asked for last.
struct Request {
    /// First frame that is missing.
    next: u64,
    epoch: u64,
    /// When the camera last did what was asked, or was asked.
    at: u64,
    /// A later frame has come since.
    later: Option<u64>,
    /// Requests for the same frame.
    n: u32,
    /// The end was sent on: nothing more is wanted.
    has_ended: bool,
}

impl Request {
    fn new(next: u64) -> Self {
        let now = monotonic_nanos();
        Self { next, epoch: now, at: now, later: None, n: 1, has_ended: false }
    }

    fn again(&mut self) {
        let now = monotonic_nanos();
        (self.epoch, self.at, self.later) = (now, now, None);
        self.n += 1;
    }

    fn is_due(&self) -> bool {
        let patience = if self.later.is_some() { GRACE_NANOS } else { PATIENCE_NANOS };
        monotonic_nanos().saturating_sub(self.at) > patience
    }
}

/// Forwards frames while `index - acknowledged < window`; asks again where the aligner asks again.
pub(super) fn work(context: &Context, camera: &mut Camera, ports: &mut Ports) -> Result<Outcome, StageError> {
    let window = u64::from(context.layout.window);
    let mut flow: Option<Flow> = None;
    let mut request = Request::new(0);
    loop {
        if context.lifeline.is_cut() {
            return Ok(Outcome::Stopped);
        }
        if let Some(newest) = hear(ports)? {
            if flow.is_none_or(|known| newest.epoch > known.epoch) {
                // Never below what was asked for, and nothing that is in hand by now.
                request = Request::new(newest.acknowledged);
                flow = Some(newest);
            } else if flow.is_some_and(|known| newest.epoch == known.epoch) {
                flow = Some(newest);
            }
        }
        let Some(flow) = flow else {
            ports.pulse.waiting(WaitingOn::Flow);
            ports.ear.wait(IDLE)?;
            continue;
        };
        if flow.finished == 1 {
            camera.finish()?;
            return Ok(Outcome::Finished);
        }
        let limit = flow.acknowledged.saturating_add(window);
        camera.tell(CameraFlow {
            epoch: request.epoch,
            send_from: request.next,
            send_below: limit,
            finished: 0,
        })?;
        if most_frames(context) == Some(request.next) && request.next < limit && !request.has_ended {
            forward_end(context, &flow, &mut request, ports)?;
            continue;
        }
        let is_wanted = request.next < limit && !request.has_ended;
        if is_wanted && let Some(image) = camera.receive(&mut ports.pulse)? {
            take(context, camera, image, &flow, &mut request, ports)?;
            continue;
        }
        if is_wanted && request.is_due() {
            if let Some(later) = request.later.filter(|_| request.n >= MOST_REQUESTS) {
                return Err(StageError::Input(format!(
                    "frame {} was asked for {} times, and the camera sends frame {later}: it must keep its \
                     last {} frames and send again from the index that camera_flow names",
                    request.next,
                    request.n,
                    2 * window
                )));
            }
            request.again();
        }
        camera.check_silence(request.next, is_wanted)?;
        ports.frames.update();
        ports.pulse.waiting(if is_wanted { WaitingOn::Camera } else { WaitingOn::Credit });
        ports.ear.wait(IDLE)?;
    }
}

/// One image: forwarded if it is the next, else noted.
fn take(
    context: &Context,
    camera: &mut Camera,
    image: Image,
    flow: &Flow,
    request: &mut Request,
    ports: &mut Ports,
) -> Result<(), StageError> {
    let index = image.header.index;
    if index < request.next {
        ports.pulse.beat.duplicates += 1;
        return Ok(());
    }
    if index > request.next {
        request.later.get_or_insert(index);
        return Ok(());
    }
    camera.used();
    if image.kind == Kind::End {
        return forward_end(context, flow, request, ports);
    }
    ports.pulse.working(index);
    let frame = copy(&image, index, ports, context)?;
    drop(image);
    send(context, frame, flow, 0, ports)?;
    (request.next, request.at, request.later, request.n) = (index + 1, monotonic_nanos(), None, 1);
    Ok(())
}

fn forward_end(
    context: &Context,
    flow: &Flow,
    request: &mut Request,
    ports: &mut Ports,
) -> Result<(), StageError> {
    let end = end(request.next, ports, context)?;
    send(context, end, flow, 0, ports)?;
    request.has_ended = true;
    Ok(())
}
