//! State of a run at one time.

use serde::Serialize;
use std::collections::BTreeMap;
use tessera_lab::profile::Times;
use tessera_outputs::LatencyMs;

/// One process.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct StageLine {
    pub(crate) stage: &'static str,
    /// Absent where nothing was heard of it.
    pub(crate) pid: Option<u32>,
    pub(crate) state: String,
    /// Frames (or requests) done by this process.
    pub(crate) frames: u64,
    /// Since the look before.
    pub(crate) frames_per_s: f64,
    pub(crate) queue: u64,
    /// From taking up a frame to handing on its result.
    pub(crate) latency_ms: LatencyMs,
    /// Of one core, since the look before.
    pub(crate) cpu_percent: f64,
    /// Highest resident set, megabytes (1e6 bytes).
    pub(crate) peak_rss_mb: f64,
    /// Frames left out because newer ones had come (live mode).
    pub(crate) dropped: u64,
    pub(crate) lost: u64,
    pub(crate) refused: u64,
    pub(crate) restarts: u64,
    /// Where its time goes, by phase and step.
    pub(crate) times_ms: BTreeMap<&'static str, Times>,
}

/// The pose published last.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct LastPose {
    pub(crate) frame: u64,
    pub(crate) state: &'static str,
    /// In the map.
    pub(crate) translation_m: [f64; 3],
    pub(crate) rotation_xyzw: [f64; 4],
    /// From the frame being in shared memory; absent for a pose that was published again.
    pub(crate) latency_ms: Option<f64>,
}

/// One look at a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Snapshot {
    pub(crate) name: String,
    /// Seconds of looking.
    pub(crate) at_s: f64,
    pub(crate) keyframes: u64,
    pub(crate) loops: u64,
    /// Workload level of new frames, 0 (full) to 3 (live mode).
    pub(crate) workload: u64,
    pub(crate) pose: Option<LastPose>,
    pub(crate) stages: Vec<StageLine>,
}
