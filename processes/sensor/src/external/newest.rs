//! Images at the camera's own rate: the newest wins, what is left out is counted.

use super::camera::{ExternalCamera, ExternalImage};
use super::session::Session;
use super::stamps::Stamps;
use super::{copy, most_frames};
use crate::sending::{Supplied, Supply, Turn};
use tessera_messages::{CameraFlow, CameraFrame, Kind, MOST_LEFT_OUT, WaitingOn};
use tessera_stage::{StageContext, StageError, monotonic_nanos};

/// The camera's newest image.
pub(super) struct Newest {
    camera: ExternalCamera,
    /// `None` before the first epoch.
    position: Option<Position>,
}

/// How far the run is.
struct Position {
    /// First frame that was not sent.
    next: u64,
    session: Option<Session>,
    stamps: Stamps,
    /// Number of frames, once the camera has ended.
    n_frames: Option<u64>,
}

impl Newest {
    pub(super) fn new(camera: ExternalCamera) -> Self {
        Self { camera, position: None }
    }
}

impl Supply for Newest {
    fn begin_epoch(&mut self, context: &StageContext, first_missing: u64) -> Result<(), StageError> {
        self.position.get_or_insert_with(|| Position {
            next: first_missing,
            session: Session::read(context),
            stamps: Stamps::default(),
            n_frames: None,
        });
        Ok(())
    }

    fn next(&mut self, turn: &mut Turn<'_>) -> Result<Supplied, StageError> {
        let Some(at) = &mut self.position else { return Ok(Supplied::Again) };
        let epoch = turn.flow.epoch;
        self.camera.publish_flow(CameraFlow { epoch, send_from: 0, send_below: u64::MAX, finished: 0 })?;
        if let Some(n_frames) = at.n_frames.or(most_frames(turn.context).filter(|n| *n <= at.next)) {
            return Ok(Supplied::End(n_frames));
        }
        let Some((image, index)) = newest(turn, &mut self.camera, at)? else {
            self.camera.check_silence(at.next, at.n_frames.is_none())?;
            return Ok(Supplied::Wait(WaitingOn::Camera));
        };
        turn.drop_frames(index.saturating_sub(at.next));
        at.next = index.saturating_add(1);
        if turn.loses_poison(index) {
            return Ok(Supplied::Again);
        }
        turn.ports.pulse.working(index);
        let mut frame = copy(&image, index, turn.ports, turn.context)?;
        // In each frame from there on: any of them may be left out on the way.
        frame.loan.header_mut().relocalise_from = at.session.map_or(0, |session| session.asked_by(index));
        Ok(Supplied::Frame { frame, due_nanos: 0 })
    }

    fn finish(&mut self) -> Result<(), StageError> {
        self.camera.publish_finished()
    }
}

/// Images that a camera may leave out at once whatever its stamps are.
const FEW_LEFT_OUT: u64 = 1000;
/// Images a second of no depth camera: one for each millisecond.
const NANOS_BETWEEN: u64 = 1_000_000;

/// Refusal of an index that leaves out more images than there can be in the time between two stamps: a
/// counter of another kind, or one that was misread.
fn jump(image: u64, n_left_out: u64, nanos_between: Option<i64>) -> Option<String> {
    let in_between =
        |nanos: i64| (u64::try_from(nanos).unwrap_or(0) / NANOS_BETWEEN).saturating_add(FEW_LEFT_OUT);
    let most = nanos_between.map_or(MOST_LEFT_OUT, |nanos| in_between(nanos).min(MOST_LEFT_OUT));
    (n_left_out > most).then(|| {
        format!(
            "frame {image}: its index leaves out {n_left_out} images, expected at most {most}: \
             indices count images one by one"
        )
    })
}

/// What becomes of an image.
#[derive(Debug)]
enum Fate {
    /// It is that frame.
    Frame(u64),
    /// It is the next frame, and a session begins with it.
    Begins,
    /// It came before.
    Seen,
    Refused(String),
}

/// What becomes of an image that comes at `now_nanos` where frame `next` is awaited.
fn fate(at: &mut Position, header: &CameraFrame, next: u64, now_nanos: u64) -> Fate {
    let session = at.session.filter(|session| session.is_of(header));
    let index = match session.map(|session| session.frame(header)) {
        None => next,
        Some(None) => {
            return Fate::Refused(format!(
                "frame {}: expected none before the first of its session, which had a higher index",
                header.index
            ));
        }
        Some(Some(index)) if index < next => return Fate::Seen,
        Some(Some(index)) => index,
    };
    let n_left_out = index.saturating_sub(next);
    if let Err(reason) = at.stamps.check(header.index, header.stamp_nanos, n_left_out, now_nanos) {
        return Fate::Refused(reason);
    }
    if session.is_none() {
        return Fate::Begins;
    }
    let nanos = at.stamps.since_last(header.stamp_nanos);
    jump(header.index, n_left_out, nanos).map_or(Fate::Frame(index), Fate::Refused)
}

/// The newest usable image and the frame that it is. An end is noted and ends the search.
fn newest(
    turn: &mut Turn<'_>,
    camera: &mut ExternalCamera,
    at: &mut Position,
) -> Result<Option<(ExternalImage, u64)>, StageError> {
    let mut newest: Option<(ExternalImage, u64)> = None;
    while let Some(image) = camera.receive(&mut turn.ports.pulse)? {
        let header = image.header;
        let next = newest.as_ref().map_or(at.next, |(_, index)| index.saturating_add(1));
        if image.kind == Kind::End {
            let index = at.session.and_then(|session| session.frame(&header)).unwrap_or(next).max(next);
            if let Some(reason) = jump(header.index, index.saturating_sub(next), None) {
                camera.refuse(reason, &mut turn.ports.pulse);
                continue;
            }
            at.n_frames = Some(most_frames(turn.context).map_or(index, |n| n.min(index)));
            tracing::info!(frame = index, "the camera has ended");
            camera.note_usable();
            break;
        }
        let now = monotonic_nanos();
        let index = match fate(at, &header, next, now) {
            Fate::Frame(index) => index,
            Fate::Begins => {
                tracing::info!(frame = next, "the camera counts from {} in a new session", header.index);
                at.session = Some(Session::begin(turn.context, at.session, &header, next)?);
                next
            }
            Fate::Seen => {
                turn.note_duplicate();
                continue;
            }
            Fate::Refused(reason) => {
                camera.refuse(reason, &mut turn.ports.pulse);
                continue;
            }
        };
        if most_frames(turn.context).is_some_and(|n| index >= n) {
            at.n_frames = most_frames(turn.context);
            break;
        }
        if let Some(session) = at.session.as_mut().filter(|_| header.asks_relocalisation()) {
            // The image may be left out, what is asked for may not.
            session.ask_relocalisation(turn.context, index)?;
        }
        camera.note_usable();
        at.stamps.take(header.stamp_nanos, now);
        newest = Some((image, index));
    }
    Ok(newest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_index_that_jumps_is_refused_by_name() {
        let (ms, hour) = (1_000_000, 3_600_000_000_000);
        // A pause of the camera, by its own stamps.
        assert_eq!(jump(9, 1800, Some(60_000 * ms)), None);
        assert_eq!(jump(9, 900, Some(33 * ms)), None);
        assert_eq!(jump(9, MOST_LEFT_OUT, None), None);
        // Microseconds in the place of a count; a bit that was misread.
        let words = jump(33_333, 33_332, Some(33 * ms)).unwrap();
        assert!(
            words.starts_with("frame 33333: its index leaves out 33332 images, expected at most 1033"),
            "{words}"
        );
        for nanos in [None, Some(1000 * hour), Some(i64::MAX)] {
            let words = jump(1 << 40, 1 << 40, nanos).unwrap();
            assert!(words.contains("expected at most 108000"), "{words}");
        }
        assert!(jump(5, 2000, Some(-1)).is_some());
    }
}
