//! Every frame, in order, as fast as the window allows.

use crate::Ports;
use crate::frames::{Frames, Prepared};
use crate::hear::hear;
use crate::send::send;
use std::collections::VecDeque;
use tessera_messages::{Flow, WaitingOn};
use tessera_stage::{Context, IDLE, Outcome, StageError};

/// Sends while `index - acknowledged < window`; begins again where the aligner asks for it.
pub(crate) fn work(context: &Context, frames: &Frames<'_>, ports: &mut Ports) -> Result<Outcome, StageError> {
    let (window, ahead) = (u64::from(context.layout.window), context.layout.ahead as usize);
    // Decoding in batches as wide as the machine keeps all cores busy while the window is full.
    let batch = rayon::current_num_threads().clamp(1, ahead) as u64;
    let mut flow: Option<Flow> = None;
    let mut ready: VecDeque<Prepared> = VecDeque::new();
    // The next index to prepare; the source's end counts as one more.
    let mut next = 0;
    let mut unreadable: Option<StageError> = None;
    loop {
        if context.lifeline.is_cut() {
            return Ok(Outcome::Stopped);
        }
        if let Some(newest) = hear(ports)? {
            if flow.is_none_or(|known| newest.epoch > known.epoch) {
                ready.clear();
                // Never below what was asked for, and nothing that is in hand by now.
                next = newest.acknowledged;
                unreadable = None;
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
            return Ok(Outcome::Finished);
        }
        let mut did_something = false;
        let limit = flow.acknowledged.saturating_add(window);
        while ready.front().is_some_and(|frame| frame.index < limit) {
            if let Some(frame) = ready.pop_front() {
                send(context, frame, &flow, 0, ports)?;
            }
            did_something = true;
        }
        let has_room = ready.len() + (batch as usize) <= ahead.max(batch as usize);
        if has_room && unreadable.is_none() && next <= frames.n_frames {
            ports.pulse.working(next);
            if next == frames.n_frames {
                ready.push_back(frames.end(&ports.frames)?);
                next += 1;
            } else {
                // The first of a life is waited for; it comes soonest alone.
                let n = if ports.pulse.beat.frames == 0 && ready.is_empty() { 1 } else { batch };
                let end = frames.n_frames.min(next + n);
                let (prepared, problem) = frames.prepare(next..end, &ports.frames)?;
                next += prepared.len() as u64;
                ready.extend(prepared);
                unreadable = problem;
            }
            did_something = true;
        }
        // A frame that cannot be read ends the run after all frames before it are safe.
        if unreadable.is_some() && ready.is_empty() && flow.acknowledged >= next {
            return unreadable.map_or(Ok(Outcome::Stopped), Err);
        }
        if !did_something {
            ports.frames.update();
            ports.pulse.beat.queue = ready.len() as u64;
            ports.pulse.waiting(WaitingOn::Credit);
            ports.ear.wait(IDLE)?;
        }
    }
}
