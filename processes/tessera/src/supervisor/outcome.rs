//! How far a run is, and what came of it.

use super::failure::StageFailure;
use super::tally::Counters;
use std::collections::BTreeMap;
use std::time::Duration;
use tessera_messages::Stage;
use tessera_transport::RunClaim;

/// How a run ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// All is done.
    Finished,
    /// By Ctrl-C or SIGTERM; `resume` goes on.
    Interrupted,
    /// A stage failed.
    Failed(Box<StageFailure>),
}

/// A run that is over.
#[derive(Debug)]
pub(crate) struct Supervised {
    /// How it ended.
    pub(crate) outcome: Outcome,
    /// What each stage did.
    pub(crate) stages: BTreeMap<Stage, Counters>,
    /// Most shared memory in use at a time, bytes.
    pub(crate) shared_memory_bytes: u64,
    /// From start to end.
    pub(crate) duration: Duration,
    /// The run's name, free when this is dropped: after the outputs are written.
    pub(crate) claim: RunClaim,
}

/// How far a run is.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Progress {
    /// Frames aligned, or the index reached in live mode.
    pub(crate) frames: u64,
    /// Frames of the source, where known.
    pub(crate) n_frames: Option<u64>,
    /// Keyframes in the map.
    pub(crate) keyframes: u64,
    /// Loops closed.
    pub(crate) loops: u64,
    /// What each stage did so far.
    pub(crate) stages: BTreeMap<Stage, Counters>,
    /// Since the start.
    pub(crate) elapsed: Duration,
}
