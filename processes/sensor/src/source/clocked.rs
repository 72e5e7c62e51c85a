//! Frames of a source at their own times: what comes too late is dropped and counted.

use super::frames::Frames;
use super::live_clock::LiveClock;
use crate::frame::PreparedFrame;
use crate::sending::{Supplied, Supply, Turn};
use std::collections::VecDeque;
use tessera_stage::{StageContext, StageError, monotonic_nanos};

/// Lead of a frame's reading over its due time, in units of the slowest recent reading.
const READ_AHEAD: u64 = 2;
/// Least lead, nanoseconds.
const LEAST_AHEAD_NANOS: u64 = 5_000_000;
/// Recent readings.
const N_RECENT: usize = 8;

/// A source played at the rate of its camera.
pub(super) struct Clocked<'a> {
    frames: Frames<'a>,
    /// The clock, and the next frame; `None` before the first epoch.
    position: Option<(LiveClock, u64)>,
    /// A frame in shared memory, and when it is due.
    ready: Option<(PreparedFrame, u64)>,
    readings: Readings,
}

impl<'a> Clocked<'a> {
    pub(super) fn new(frames: Frames<'a>) -> Self {
        Self { frames, position: None, ready: None, readings: Readings::default() }
    }
}

impl Supply for Clocked<'_> {
    fn begin_epoch(&mut self, context: &StageContext, first_missing: u64) -> Result<(), StageError> {
        if self.position.is_none() {
            self.position = Some((LiveClock::read_or_begin(context, first_missing)?, first_missing));
        }
        Ok(())
    }

    fn next(&mut self, turn: &mut Turn<'_>) -> Result<Supplied, StageError> {
        let now = monotonic_nanos();
        if let Some((_, due)) = &self.ready
            && now < *due
        {
            return Ok(Supplied::NotBefore(*due));
        }
        if let Some((frame, due_nanos)) = self.ready.take() {
            return Ok(Supplied::Frame { frame, due_nanos });
        }
        let Some((clock, next)) = &mut self.position else { return Ok(Supplied::Again) };
        let is_due = |index| clock.due_nanos(&self.frames, index).is_some_and(|due| due <= now);
        let first = *next;
        while *next + 1 < self.frames.n_frames && is_due(*next + 1) {
            *next += 1;
        }
        turn.drop_frames(*next - first);
        let index = *next;
        if index >= self.frames.n_frames {
            return Ok(Supplied::End(self.frames.n_frames));
        }
        if turn.loses_poison(index) {
            *next += 1;
            return Ok(Supplied::Again);
        }
        // Read ahead, so that the frame is in shared memory when it is due, but no sooner than has
        // to be: the frame before it is being worked on.
        let due = clock.due_nanos(&self.frames, index).unwrap_or(now);
        let begin = due.saturating_sub(self.readings.ahead_nanos());
        if now < begin {
            return Ok(Supplied::NotBefore(begin));
        }
        turn.ports.pulse.working(index);
        self.frames.go_to(index, &mut turn.ports.pulse);
        let (prepared, problem) = self.frames.prepare(index..index + 1, &turn.ports.frames)?;
        self.readings.note(monotonic_nanos().saturating_sub(now));
        *next += 1;
        self.ready = prepared.into_iter().next().map(|frame| (frame, due));
        if self.ready.is_none() {
            // A camera's bad frame is lost, the run goes on.
            if let Some(problem) = problem {
                tracing::warn!(frame = index, "lost: {problem}");
            }
            turn.lose_frame();
        }
        Ok(Supplied::Again)
    }
}

/// How long the last frames took to read.
#[derive(Default)]
struct Readings(VecDeque<u64>);

impl Readings {
    fn note(&mut self, nanos: u64) {
        self.0.truncate(N_RECENT - 1);
        self.0.push_front(nanos);
    }

    /// How long before a frame is due its reading begins; as early as can be where nothing is known.
    fn ahead_nanos(&self) -> u64 {
        let slowest = self.0.iter().max();
        slowest.map_or(u64::MAX, |nanos| nanos.saturating_mul(READ_AHEAD).max(LEAST_AHEAD_NANOS))
    }
}
