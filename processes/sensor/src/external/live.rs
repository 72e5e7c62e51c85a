//! Images at the camera's own rate: the newest wins, what is left out is counted.

use super::camera::{Camera, Image};
use super::session::Session;
use super::{copy, end, most_frames};
use crate::Ports;
use crate::hear::hear;
use crate::send::send;
use tessera_messages::{CameraFlow, Flow, Kind, WaitingOn};
use tessera_stage::{Context, IDLE, Outcome, StageError, monotonic_nanos};

/// Time between two sendings of the end, which nobody asks for again in live mode.
const END_INTERVAL_NANOS: u64 = 50_000_000;

/// How far the run is.
struct Position {
    /// First frame that was not sent.
    next: u64,
    session: Option<Session>,
    last_stamp_nanos: Option<i64>,
    /// Number of frames, once the camera has ended.
    n_frames: Option<u64>,
    dropped_before: u64,
}

/// Sends each image when it comes.
pub(super) fn work(context: &Context, camera: &mut Camera, ports: &mut Ports) -> Result<Outcome, StageError> {
    let mut flow: Option<Flow> = None;
    let mut position: Option<Position> = None;
    let mut end_sent_at = 0;
    loop {
        if context.lifeline.is_cut() {
            return Ok(Outcome::Stopped);
        }
        flow = hear(ports)?.or(flow);
        let Some(flow) = flow else {
            ports.pulse.waiting(WaitingOn::Flow);
            ports.ear.wait(IDLE)?;
            continue;
        };
        if flow.finished == 1 {
            camera.finish()?;
            return Ok(Outcome::Finished);
        }
        let at = position.get_or_insert_with(|| Position {
            next: flow.acknowledged,
            session: Session::read(context),
            last_stamp_nanos: None,
            n_frames: None,
            dropped_before: 0,
        });
        camera.tell(CameraFlow { epoch: flow.epoch, send_from: 0, send_below: u64::MAX, finished: 0 })?;
        if let Some(n_frames) = at.n_frames.or(most_frames(context).filter(|n| *n <= at.next)) {
            let now = monotonic_nanos();
            if now.saturating_sub(end_sent_at) >= END_INTERVAL_NANOS {
                end_sent_at = now;
                let mut end = end(n_frames, ports, context)?;
                end.loan.header_mut().epoch = flow.epoch;
                end.loan.header_mut().dropped_before = at.dropped_before;
                end.loan.send()?;
                ports.reconstruct.ring();
            }
            ports.pulse.waiting(WaitingOn::Flow);
            ports.ear.wait(IDLE)?;
            continue;
        }
        let Some((image, index)) = newest(context, camera, ports, at)? else {
            camera.check_silence(at.next, at.n_frames.is_none())?;
            ports.pulse.waiting(WaitingOn::Camera);
            ports.ear.wait(IDLE)?;
            continue;
        };
        let gap = index - at.next;
        at.dropped_before += gap;
        ports.pulse.beat.dropped += gap;
        at.next = index + 1;
        if context.poison.contains(&index) {
            tracing::warn!(frame = index, "lost: it ended the sensor again and again");
            ports.pulse.beat.lost += 1;
            at.dropped_before += 1;
            continue;
        }
        ports.pulse.working(index);
        let mut frame = copy(&image, index, ports, context)?;
        drop(image);
        frame.loan.header_mut().dropped_before = std::mem::take(&mut at.dropped_before);
        send(context, frame, &flow, 0, ports)?;
    }
}

/// The newest usable image and the frame that it is. An end is noted and ends the search.
fn newest(
    context: &Context,
    camera: &mut Camera,
    ports: &mut Ports,
    at: &mut Position,
) -> Result<Option<(Image, u64)>, StageError> {
    let mut newest: Option<(Image, u64)> = None;
    while let Some(image) = camera.receive(&mut ports.pulse)? {
        let header = image.header;
        let next = newest.as_ref().map_or(at.next, |(_, index)| index + 1);
        if image.kind == Kind::End {
            let index = at.session.and_then(|session| session.frame(&header)).unwrap_or(next).max(next);
            at.n_frames = Some(most_frames(context).map_or(index, |n| n.min(index)));
            tracing::info!(frame = index, "the camera has ended");
            camera.used();
            break;
        }
        if let Some(last) = at.last_stamp_nanos.filter(|last| *last >= header.stamp_nanos) {
            let reason = format!(
                "frame {}: stamp_nanos is {}, expected more than {last} as the image before it has",
                header.index, header.stamp_nanos
            );
            camera.refuse(reason, &mut ports.pulse);
            continue;
        }
        let known = at.session.and_then(|session| session.frame(&header));
        let index = match known {
            Some(index) if index < next => {
                ports.pulse.beat.duplicates += 1;
                continue;
            }
            Some(index) => index,
            None => {
                tracing::info!(frame = next, "the camera counts from {} in a new session", header.index);
                at.session = Some(Session::begin(context, &header, next)?);
                next
            }
        };
        if most_frames(context).is_some_and(|n| index >= n) {
            at.n_frames = most_frames(context);
            break;
        }
        camera.used();
        at.last_stamp_nanos = Some(header.stamp_nanos);
        newest = Some((image, index));
    }
    Ok(newest)
}
