//! A stage's sign of life, with what it has done so far.

use crate::message::{Message, Refusal};
use crate::stage::Stage;
use crate::time_counts::TimeCounts;
use bytemuck::{Pod, Zeroable};

/// What a stage is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BeatState {
    /// Opening services and reading its files.
    Starting,
    /// Nothing to do until something comes.
    Waiting,
    /// Has work in hand.
    Working,
    /// Done with the run; exits next.
    Finished,
}

impl BeatState {
    const ALL: [(BeatState, &'static str); 4] = [
        (BeatState::Starting, "starting"),
        (BeatState::Waiting, "waiting"),
        (BeatState::Working, "working"),
        (BeatState::Finished, "finished"),
    ];

    /// Name for people.
    pub fn name(self) -> &'static str {
        Self::ALL.get(self as usize).map_or("", |(_, name)| name)
    }
}

/// What a waiting stage waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaitingOn {
    /// Not waiting.
    Nothing,
    /// The next frame.
    Frames,
    /// The next surface.
    Surfaces,
    /// The window: the slowest stage sets the pace.
    Credit,
    /// A correction that is due.
    Correction,
    /// A request to optimise.
    Requests,
    /// The next frame's time (live mode).
    Clock,
    /// The aligner's first word on where to begin.
    Flow,
    /// The next image of a camera's own program.
    Camera,
    /// The answer of a base to a request.
    Base,
}

impl WaitingOn {
    const ALL: [(WaitingOn, &'static str); 10] = [
        (WaitingOn::Nothing, ""),
        (WaitingOn::Frames, "frames"),
        (WaitingOn::Surfaces, "surfaces"),
        (WaitingOn::Credit, "window"),
        (WaitingOn::Correction, "correction"),
        (WaitingOn::Requests, "requests"),
        (WaitingOn::Clock, "clock"),
        (WaitingOn::Flow, "flow"),
        (WaitingOn::Camera, "camera"),
        (WaitingOn::Base, "base"),
    ];

    /// Name for people.
    pub fn name(self) -> &'static str {
        Self::ALL.get(self as usize).map_or("", |(_, name)| name)
    }
}

/// A distribution of times, nanoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Latency {
    /// Median.
    pub p50: u64,
    /// 99th percentile.
    pub p99: u64,
    /// Longest.
    pub max: u64,
}

/// A sign of life with counters since this process started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Beat {
    /// [`Stage::number`].
    pub stage: u32,
    /// Process id.
    pub pid: u32,
    /// [`BeatState`] by position.
    pub state: u32,
    /// [`WaitingOn`] by position.
    pub waiting_on: u32,
    /// Counts beats: a frozen process stops counting.
    pub sequence: u64,
    /// Rises with every piece of work done, inner iterations of a solve among them.
    pub progress: u64,
    /// Frame (or request) in hand or done last.
    pub index: u64,
    /// Frames (or requests) done by this process.
    pub frames: u64,
    /// Frames left out here because newer ones had come (live mode).
    pub dropped: u64,
    /// Frames that should have come and never did.
    pub lost: u64,
    /// Messages refused.
    pub refused: u64,
    /// Messages that came again and were not needed.
    pub duplicates: u64,
    /// Messages waiting.
    pub queue: u64,
    /// CPU time of the process, nanoseconds.
    pub cpu_nanos: u64,
    /// Highest resident set so far, bytes.
    pub peak_rss_bytes: u64,
    /// Keyframes in the map.
    pub keyframes: u64,
    /// Loops closed.
    pub loops: u64,
    /// Frames journaled as left out, by whichever stage, since the run began (align, live mode).
    pub left_out: u64,
    /// Workload level of new frames, 0 (full) to 3 (align, live mode).
    pub workload: u64,
    /// Time from taking up a piece of work to handing on its result.
    pub latency: Latency,
    /// Time from the frame being in shared memory to its published pose (align only).
    pub end_to_end: Latency,
    /// How often a piece of work took how long.
    pub latency_counts: TimeCounts,
    /// The same from the frame being in shared memory to its published pose (align only).
    pub end_to_end_counts: TimeCounts,
    /// Version of the program, zero-padded.
    pub version: [u8; 16],
}

impl Message for Beat {
    const NAME: &'static str = "tessera.Beat.v4";
}

impl Beat {
    /// The newest of the beats that were written one behind the other, as plain bytes of this machine.
    pub fn last_of(bytes: &[u8]) -> Option<Self> {
        bytes.chunks_exact(size_of::<Self>()).next_back().map(bytemuck::pod_read_unaligned)
    }

    /// As [`Beat::last_of`] reads it.
    pub fn as_bytes(&self) -> &[u8] {
        bytemuck::bytes_of(self)
    }

    /// Checks the numbers that stand for names.
    ///
    /// # Errors
    /// A [`Refusal`] that names the value.
    pub fn validate(&self) -> Result<(Stage, BeatState, WaitingOn), Refusal> {
        let refuse = |what, found: u32| Refusal::Value {
            index: self.index,
            what,
            found: found.to_string(),
            rule: "a number this version knows",
        };
        let stage = Stage::from_number(self.stage).ok_or_else(|| refuse("stage", self.stage))?;
        let state = BeatState::ALL.get(self.state as usize).ok_or_else(|| refuse("state", self.state))?.0;
        let waiting = WaitingOn::ALL
            .get(self.waiting_on as usize)
            .ok_or_else(|| refuse("waiting_on", self.waiting_on))?
            .0;
        Ok((stage, state, waiting))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_whole_beat_is_read() {
        let [first, second] = [1, 2].map(|sequence| Beat { sequence, ..Beat::default() });
        let bytes = [first.as_bytes(), second.as_bytes(), &first.as_bytes()[..9]].concat();
        assert_eq!(Beat::last_of(&bytes), Some(second));
        assert_eq!(Beat::last_of(&bytes[..9]), None);
    }

    #[test]
    fn numbers_and_names_agree() {
        for (position, (state, _)) in BeatState::ALL.iter().enumerate() {
            assert_eq!(*state as usize, position);
        }
        for (position, (waiting, _)) in WaitingOn::ALL.iter().enumerate() {
            assert_eq!(*waiting as usize, position);
        }
        for stage in Stage::ALL {
            assert_eq!(Stage::from_number(stage.number()), Some(stage));
            assert_eq!(Stage::from_name(stage.name()), Some(stage));
        }
        let beat = Beat { stage: 2, state: 1, waiting_on: 4, ..Beat::default() };
        assert_eq!(beat.validate(), Ok((Stage::Align, BeatState::Waiting, WaitingOn::Correction)));
        assert!(Beat { stage: 9, ..beat }.validate().unwrap_err().to_string().contains("stage is 9"));
    }
}
