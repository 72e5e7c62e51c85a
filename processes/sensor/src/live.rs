//! Frames at their own times: what comes too late is left out, and counted.

use crate::Ports;
use crate::frames::Frames;
use crate::hear::hear;
use crate::send::send;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::time::Duration;
use tessera_messages::{Flow, WaitingOn};
use tessera_stage::{Context, IDLE, Outcome, StageError, monotonic_nanos};

/// A frame is read so many times as long before it is due as reading took at most of late.
const READ_AHEAD: u64 = 2;
/// And at least so long before, nanoseconds.
const LEAST_AHEAD_NANOS: u64 = 5_000_000;
/// Frames that "of late" means.
const LATE: usize = 8;

/// Time between two sendings of the end, which nobody asks for again in live mode.
const END_INTERVAL_NANOS: u64 = 50_000_000;

/// When the first frame was due; kept in the run directory, so that a camera's time goes on while
/// the sensor is dead.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct LiveClock {
    /// Monotonic clock at the stamp of `first_index`, nanoseconds.
    began_nanos: u64,
    /// Index of the first frame.
    first_index: u64,
}

impl LiveClock {
    fn read_or_begin(context: &Context, first_index: u64) -> Result<Self, StageError> {
        let path = context.files.live_clock();
        if let Ok(text) = std::fs::read_to_string(&path)
            && let Ok(clock) = serde_json::from_str(&text)
        {
            return Ok(clock);
        }
        let clock = LiveClock { began_nanos: monotonic_nanos(), first_index };
        let wrong = |problem: String| StageError::RunFile { path: path.clone(), problem };
        let text = serde_json::to_string(&clock).map_err(|e| wrong(e.to_string()))?;
        let temporary = path.with_extension("clock.new");
        std::fs::write(&temporary, text)
            .and_then(|()| std::fs::rename(&temporary, &path))
            .map_err(|e| wrong(format!("cannot write: {e}")))?;
        Ok(clock)
    }

    /// When a frame is due on the monotonic clock.
    fn due_nanos(&self, frames: &Frames<'_>, index: u64) -> Option<u64> {
        let first = frames.stamp_nanos(self.first_index)?;
        let since = frames.stamp_nanos(index)?.saturating_sub(first);
        Some(self.began_nanos.saturating_add(u64::try_from(since).unwrap_or(0)))
    }
}

/// How long the last frames took to read.
#[derive(Default)]
struct Readings(VecDeque<u64>);

impl Readings {
    fn note(&mut self, nanos: u64) {
        self.0.truncate(LATE - 1);
        self.0.push_front(nanos);
    }

    /// How long before a frame is due its reading begins; as early as can be where nothing is known.
    fn ahead_nanos(&self) -> u64 {
        let slowest = self.0.iter().max();
        slowest.map_or(u64::MAX, |nanos| nanos.saturating_mul(READ_AHEAD).max(LEAST_AHEAD_NANOS))
    }
}

/// Sends each frame when it is due.
pub(crate) fn work(context: &Context, frames: &Frames<'_>, ports: &mut Ports) -> Result<Outcome, StageError> {
    let mut flow: Option<Flow> = None;
    let mut clock: Option<(LiveClock, u64)> = None;
    let mut dropped_before = 0;
    let mut end_sent_at = 0;
    let mut readings = Readings::default();
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
            return Ok(Outcome::Finished);
        }
        let (live_clock, next) = match &mut clock {
            Some(known) => known,
            None => {
                let known = LiveClock::read_or_begin(context, flow.acknowledged)?;
                clock.insert((known, flow.acknowledged))
            }
        };
        // What has been overtaken is left out, as a camera would.
        let now = monotonic_nanos();
        while *next + 1 < frames.n_frames
            && live_clock.due_nanos(frames, *next + 1).is_some_and(|due| due <= now)
        {
            *next += 1;
            dropped_before += 1;
            ports.pulse.beat.dropped += 1;
        }
        if *next >= frames.n_frames {
            if now.saturating_sub(end_sent_at) >= END_INTERVAL_NANOS {
                end_sent_at = now;
                let mut end = frames.end(&ports.frames)?;
                end.loan.header_mut().epoch = flow.epoch;
                end.loan.header_mut().dropped_before = dropped_before;
                end.loan.send()?;
                ports.reconstruct.ring();
            }
            ports.pulse.waiting(WaitingOn::Flow);
            ports.ear.wait(IDLE)?;
            continue;
        }
        if context.poison.contains(next) {
            tracing::warn!(frame = *next, "lost: it ended the sensor again and again");
            *next += 1;
            ports.pulse.beat.lost += 1;
            dropped_before += 1;
            continue;
        }
        ports.pulse.working(*next);
        // Read ahead, so that the frame is in shared memory when it is due, but no sooner than has
        // to be: the frame before it is being worked on.
        let due = live_clock.due_nanos(frames, *next).unwrap_or(now);
        if !sleep_until(due.saturating_sub(readings.ahead_nanos()), context, ports)? {
            return Ok(Outcome::Stopped);
        }
        let began = monotonic_nanos();
        let (prepared, problem) = frames.prepare(*next..*next + 1, &ports.frames)?;
        readings.note(monotonic_nanos().saturating_sub(began));
        let index = *next;
        *next += 1;
        let Some(mut frame) = prepared.into_iter().next() else {
            // A camera's bad frame is lost, the run goes on.
            if let Some(problem) = problem {
                tracing::warn!(frame = index, "lost: {problem}");
            }
            ports.pulse.beat.lost += 1;
            dropped_before += 1;
            continue;
        };
        if !sleep_until(due, context, ports)? {
            return Ok(Outcome::Stopped);
        }
        frame.loan.header_mut().dropped_before = std::mem::take(&mut dropped_before);
        send(context, frame, &flow, due, ports)?;
    }
}

/// Sleeps until a time of the monotonic clock; `false` when told to stop.
fn sleep_until(due: u64, context: &Context, ports: &mut Ports) -> Result<bool, StageError> {
    loop {
        if context.lifeline.is_cut() {
            return Ok(false);
        }
        let now = monotonic_nanos();
        if now >= due {
            return Ok(true);
        }
        ports.pulse.waiting(WaitingOn::Clock);
        std::thread::sleep(Duration::from_nanos(due - now).min(IDLE));
    }
}
