//! Every frame of a source in order, decoded some ahead of the window.

use super::frames::Frames;
use crate::frame::PreparedFrame;
use crate::sending::{Supplied, Supply, Turn};
use std::collections::VecDeque;
use tessera_messages::WaitingOn;
use tessera_stage::{StageContext, StageError};

/// Frames in shared memory that wait for the window.
pub(super) struct ReadAhead<'a> {
    frames: Frames<'a>,
    /// Most frames that may be ready.
    ahead: usize,
    /// Frames decoded at a time.
    batch: usize,
    ready: VecDeque<PreparedFrame>,
    /// The next index to prepare.
    next: u64,
    /// Why the frame `next` cannot be read.
    unreadable: Option<StageError>,
}

impl<'a> ReadAhead<'a> {
    pub(super) fn new(frames: Frames<'a>, ahead: usize) -> Self {
        // Decoding in batches as wide as the machine keeps all cores busy while the window is full.
        let batch = rayon::current_num_threads().clamp(1, ahead);
        Self { frames, ahead, batch, ready: VecDeque::new(), next: 0, unreadable: None }
    }

    /// Decodes the next frames into shared memory.
    fn prepare(&mut self, turn: &mut Turn<'_>) -> Result<(), StageError> {
        turn.ports.pulse.working(self.next);
        // The first of a life is waited for; it comes soonest alone.
        let is_first = turn.ports.pulse.beat.frames == 0 && self.ready.is_empty();
        let n = if is_first { 1 } else { self.batch as u64 };
        self.frames.go_to(self.next, &mut turn.ports.pulse);
        let end = self.frames.n_frames.min(self.next + n);
        let (prepared, problem) = self.frames.prepare(self.next..end, &turn.ports.frames)?;
        self.next += prepared.len() as u64;
        self.ready.extend(prepared);
        self.unreadable = problem;
        Ok(())
    }
}

impl Supply for ReadAhead<'_> {
    fn begin_epoch(&mut self, _: &StageContext, first_missing: u64) -> Result<(), StageError> {
        self.ready.clear();
        self.next = first_missing;
        self.unreadable = None;
        Ok(())
    }

    fn next(&mut self, turn: &mut Turn<'_>) -> Result<Supplied, StageError> {
        if self.ready.front().is_some_and(|frame| frame.index < turn.limit)
            && let Some(frame) = self.ready.pop_front()
        {
            return Ok(Supplied::Frame { frame, due_nanos: 0 });
        }
        let has_room = self.ready.len() + self.batch <= self.ahead.max(self.batch);
        if has_room && self.unreadable.is_none() && self.next < self.frames.n_frames {
            self.prepare(turn)?;
            return Ok(Supplied::Again);
        }
        turn.ports.pulse.beat.queue = self.ready.len() as u64;
        // A frame that cannot be read ends the run after all frames before it are safe.
        if self.ready.is_empty()
            && turn.flow.acknowledged >= self.next
            && let Some(problem) = self.unreadable.take()
        {
            return Err(problem);
        }
        let is_exhausted = self.unreadable.is_none() && self.ready.is_empty();
        if is_exhausted && self.next >= self.frames.n_frames && self.frames.n_frames < turn.limit {
            return Ok(Supplied::End(self.frames.n_frames));
        }
        Ok(Supplied::Wait(WaitingOn::Credit))
    }
}
