//! What the supervisor saw of the processes, as it is kept in the run directory.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Name of the file in the run directory.
pub(crate) const STATISTICS_FILE: &str = "statistics.json";

/// How a run ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Ended {
    /// It did not, or nobody was left to say so.
    #[default]
    Unfinished,
    /// The source was exhausted and all was done.
    Finished,
    /// By Ctrl-C or SIGTERM.
    Interrupted,
    /// A stage failed.
    Failed,
}

/// A distribution of times, milliseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct LatencyMs {
    /// Median.
    pub(crate) p50: f64,
    /// 99th percentile.
    pub(crate) p99: f64,
    /// Longest.
    pub(crate) max: f64,
}

/// One stage over all its lives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct StageStatistics {
    /// Lives after the first.
    pub(crate) restarts: u64,
    /// Frames (or requests) worked on.
    pub(crate) frames: u64,
    /// From taking up a frame to handing on its result.
    pub(crate) latency_ms: LatencyMs,
    /// CPU time, milliseconds.
    pub(crate) cpu_ms: f64,
    /// Highest resident set, megabytes (1e6 bytes).
    pub(crate) peak_rss_mb: f64,
}

/// All processes of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct RunStatistics {
    /// How the run ended.
    pub(crate) ended: Ended,
    /// From start to end, seconds, over all resumptions.
    pub(crate) wall_s: f64,
    /// By the name of the stage.
    pub(crate) stages: BTreeMap<String, StageStatistics>,
    /// From the frame being in shared memory to its published pose.
    pub(crate) end_to_end_ms: LatencyMs,
    /// Most shared memory in use, megabytes (1e6 bytes).
    pub(crate) shared_memory_mb: f64,
}
