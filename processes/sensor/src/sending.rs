//! The loop of the sensor: one, with a [`Pace`] and a [`Supply`].

use crate::SensorPorts;
use crate::frame::{PreparedFrame, blank_frame};
use crate::send::send;
use tessera_messages::{Flow, Kind, WaitingOn};
use tessera_stage::{IDLE, Outcome, StageContext, StageError, monotonic_nanos};

/// Time between two sendings of the end in live mode, where it is not asked for again.
const END_INTERVAL_NANOS: u64 = 50_000_000;

/// When frames may go out.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Pace {
    /// Lossless: while `index - acknowledged < window`.
    Window(u64),
    /// At the camera's own rate.
    Live,
}

/// Answer of a supply when it is asked for the next frame.
pub(crate) enum Supplied {
    /// The frame; `due_nanos`: when it was to be sent on the monotonic clock, 0 without a clock.
    Frame { frame: PreparedFrame, due_nanos: u64 },
    /// The source is exhausted after so many frames.
    End(u64),
    /// Something was done, and there may be more.
    Again,
    /// Nothing before something comes.
    Wait(WaitingOn),
    /// Nothing before this time of the monotonic clock, nanoseconds.
    NotBefore(u64),
}

/// Where frames come from: a source that is read, or a camera's own program.
pub(crate) trait Supply {
    /// Begins at the first frame that the aligner does not have; called with each new epoch.
    fn begin_epoch(&mut self, context: &StageContext, first_missing: u64) -> Result<(), StageError>;

    /// The next frame that may be sent now. It may block for as long as reading frames takes.
    fn next(&mut self, turn: &mut Turn<'_>) -> Result<Supplied, StageError>;

    /// The run is finished.
    fn finish(&mut self) -> Result<(), StageError> {
        Ok(())
    }
}

/// What a supply needs to know of the loop, and what it counts.
pub(crate) struct Turn<'a> {
    pub(crate) context: &'a StageContext,
    pub(crate) ports: &'a mut SensorPorts,
    pub(crate) flow: Flow,
    /// Frames below this index may be sent now.
    pub(crate) limit: u64,
    /// Frames left out since the last one that was sent (live mode).
    dropped_before: &'a mut u64,
}

impl Turn<'_> {
    /// Counts frames that newer ones have overtaken.
    pub(crate) fn drop_frames(&mut self, n_frames: u64) {
        *self.dropped_before = self.dropped_before.saturating_add(n_frames);
        let beat = &mut self.ports.pulse.beat;
        beat.dropped = beat.dropped.saturating_add(n_frames);
    }

    /// Counts an image that came before.
    pub(crate) fn note_duplicate(&mut self) {
        let beat = &mut self.ports.pulse.beat;
        beat.duplicates = beat.duplicates.saturating_add(1);
    }

    /// Counts a frame that cannot be used.
    pub(crate) fn lose_frame(&mut self) {
        *self.dropped_before += 1;
        self.ports.pulse.beat.lost += 1;
    }

    /// Whether the frame ended this stage again and again; it is then lost.
    pub(crate) fn loses_poison(&mut self, index: u64) -> bool {
        let is_poison = self.context.poison.contains(&index);
        if is_poison {
            tracing::warn!(frame = index, "lost: it ended the sensor again and again");
            self.lose_frame();
        }
        is_poison
    }
}

/// Sends what the supply gives until the run is finished or the stage is told to stop; a new epoch
/// of the aligner begins again at the first frame that it does not have.
pub(crate) fn send_frames(
    context: &StageContext,
    ports: &mut SensorPorts,
    pace: Pace,
    supply: &mut dyn Supply,
) -> Result<Outcome, StageError> {
    let mut flow: Option<Flow> = None;
    let mut dropped_before = 0;
    let mut end = SentEnd::default();
    loop {
        if context.lifeline.is_cut() {
            return Ok(Outcome::Stopped);
        }
        if let Some(newest) = receive_flow(ports)? {
            let epoch = flow.map(|known| known.epoch);
            if epoch.is_none_or(|epoch| newest.epoch > epoch) {
                // Never below what was asked for, and nothing that is in hand by now.
                supply.begin_epoch(context, newest.acknowledged)?;
            }
            flow = flow.filter(|known| newest.epoch < known.epoch).or(Some(newest));
        }
        let Some(flow) = flow else {
            ports.wait(pace, WaitingOn::Flow)?;
            continue;
        };
        if flow.finished == 1 {
            supply.finish()?;
            return Ok(Outcome::Finished);
        }
        let limit = match pace {
            Pace::Window(window) => flow.acknowledged.saturating_add(window),
            Pace::Live => u64::MAX,
        };
        let mut turn = Turn { context, ports: &mut *ports, flow, limit, dropped_before: &mut dropped_before };
        match supply.next(&mut turn)? {
            Supplied::Again => {}
            Supplied::Frame { mut frame, due_nanos } => {
                frame.loan.header_mut().dropped_before = std::mem::take(&mut dropped_before);
                send(context, frame, &flow, due_nanos, ports)?;
            }
            Supplied::End(n_frames) => {
                if end.is_due(pace, flow.epoch) {
                    let mut frame = blank_frame(n_frames, Kind::End, context.layout.frame, &ports.frames)?;
                    frame.loan.header_mut().dropped_before = dropped_before;
                    end.send(context, pace, frame, &flow, ports)?;
                }
                let on = if matches!(pace, Pace::Live) { WaitingOn::Flow } else { WaitingOn::Credit };
                ports.wait(pace, on)?;
            }
            Supplied::Wait(on) => ports.wait(pace, on)?,
            Supplied::NotBefore(due_nanos) => ports.sleep_until(due_nanos),
        }
    }
}

/// The aligner's newest flow message since the last call; one that breaks a rule is refused and
/// counted.
fn receive_flow(ports: &mut SensorPorts) -> Result<Option<Flow>, StageError> {
    let Some(newest) = ports.flow.newest()? else { return Ok(None) };
    match newest.validate() {
        Ok(()) => Ok(Some(newest)),
        Err(refusal) => {
            tracing::warn!("refused: {refusal}");
            ports.pulse.beat.refused += 1;
            Ok(None)
        }
    }
}

/// When the end was sent last.
#[derive(Default)]
struct SentEnd {
    epoch: Option<u64>,
    at_nanos: u64,
}

impl SentEnd {
    /// Once an epoch in lossless mode, again and again in live mode.
    fn is_due(&self, pace: Pace, epoch: u64) -> bool {
        match pace {
            Pace::Window(_) => self.epoch != Some(epoch),
            Pace::Live => monotonic_nanos().saturating_sub(self.at_nanos) >= END_INTERVAL_NANOS,
        }
    }

    fn send(
        &mut self,
        context: &StageContext,
        pace: Pace,
        mut frame: PreparedFrame,
        flow: &Flow,
        ports: &mut SensorPorts,
    ) -> Result<(), StageError> {
        *self = Self { epoch: Some(flow.epoch), at_nanos: monotonic_nanos() };
        match pace {
            Pace::Window(_) => send(context, frame, flow, 0, ports),
            Pace::Live => {
                // A repeated end is not counted as a frame.
                frame.loan.header_mut().epoch = flow.epoch;
                frame.loan.send()?;
                ports.reconstruct.notify();
                Ok(())
            }
        }
    }
}

impl SensorPorts {
    /// Sleeps until a notification, at most [`IDLE`].
    fn wait(&mut self, pace: Pace, on: WaitingOn) -> Result<(), StageError> {
        if matches!(pace, Pace::Window(_)) {
            // A late subscriber gets the history.
            self.frames.update()?;
        }
        self.pulse.waiting(on);
        self.listener.wait(IDLE)?;
        Ok(())
    }

    /// Sleeps until a time of the monotonic clock, at most [`IDLE`].
    fn sleep_until(&mut self, due_nanos: u64) {
        self.pulse.waiting(WaitingOn::Clock);
        let left = std::time::Duration::from_nanos(due_nanos.saturating_sub(monotonic_nanos()));
        std::thread::sleep(left.min(IDLE));
    }
}
