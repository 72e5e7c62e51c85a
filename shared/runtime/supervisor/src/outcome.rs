//! Progress and outcome of a run.

use crate::failure::StageFailure;
use crate::tally::Counters;
use std::collections::BTreeMap;
use std::time::Duration;
use tessera_messages::{Beat, Stage};
use tessera_transport::RunClaim;

/// How a run ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RunOutcome {
    /// All is done.
    Finished,
    /// By Ctrl-C or SIGTERM; `resume` goes on.
    Interrupted,
    /// A stage failed.
    Failed(Box<StageFailure>),
}

/// A run that is over.
#[derive(Debug)]
pub struct Supervised {
    /// How it ended.
    pub outcome: RunOutcome,
    /// What each stage did.
    pub stages: BTreeMap<Stage, Counters>,
    /// Most shared memory in use at a time, bytes.
    pub shared_memory_bytes: u64,
    /// From start to end.
    pub duration: Duration,
    /// The run's name, free when this is dropped: after the outputs are written.
    pub claim: RunClaim,
}

/// What the aligner has journaled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MapCounts {
    /// Keyframes in the map.
    pub keyframes: u64,
    /// Loops closed.
    pub loops: u64,
    /// Frames left out (live mode).
    pub left_out: u64,
}

impl From<&Beat> for MapCounts {
    fn from(beat: &Beat) -> Self {
        Self { keyframes: beat.keyframes, loops: beat.loops, left_out: beat.left_out }
    }
}

/// How far a run is.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress {
    /// Frames aligned, or the index reached in live mode.
    pub frames: u64,
    /// Frames of the source, where known.
    pub n_frames: Option<u64>,
    /// What the aligner has journaled.
    pub map: MapCounts,
    /// What each stage did so far.
    pub stages: BTreeMap<Stage, Counters>,
    /// Since the start.
    pub elapsed: Duration,
}
