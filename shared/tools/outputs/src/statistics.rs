//! Statistics of the processes by the supervisor, kept in the run directory.

use crate::ToolError;
use crate::files::write_file;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;
use tessera_messages::{Latency, Stage};
use tessera_supervisor::Counters;

/// Name of the file in the run directory.
pub const STATISTICS_FILE: &str = "statistics.json";

/// How a run ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ended {
    /// It did not, or its supervisor was gone.
    #[default]
    Unfinished,
    /// It goes on: found by its readers, never written.
    GoingOn,
    /// The source was exhausted and all was done.
    Finished,
    /// By Ctrl-C or SIGTERM.
    Interrupted,
    /// A stage failed.
    Failed,
}

/// A distribution of times, milliseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LatencyMs {
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Longest.
    pub max: f64,
}

/// One stage over all its lives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct StageStatistics {
    /// Lives after the first.
    pub restarts: u64,
    /// Frames (or requests) worked on.
    pub frames: u64,
    /// From taking up a frame to handing on its result.
    pub latency_ms: LatencyMs,
    /// CPU time, milliseconds.
    pub cpu_ms: f64,
    /// Highest resident set, megabytes (1e6 bytes).
    pub peak_rss_mb: f64,
}

impl From<Latency> for LatencyMs {
    fn from(nanos: Latency) -> Self {
        let [p50, p99, max] = [nanos.p50, nanos.p99, nanos.max].map(|nanos| nanos as f64 * 1e-6);
        Self { p50, p99, max }
    }
}

impl StageStatistics {
    fn new(counters: &Counters) -> Self {
        Self {
            restarts: counters.restarts,
            frames: counters.frames,
            latency_ms: counters.latency.into(),
            cpu_ms: counters.cpu_nanos as f64 * 1e-6,
            peak_rss_mb: counters.peak_rss_bytes as f64 * 1e-6,
        }
    }

    /// Both together; the percentiles are those of the part that did more frames.
    fn and(&self, later: &Self) -> Self {
        Self {
            restarts: self.restarts.saturating_add(later.restarts),
            frames: self.frames.saturating_add(later.frames),
            latency_ms: join(self.latency_ms, later.latency_ms, later.frames >= self.frames),
            cpu_ms: self.cpu_ms + later.cpu_ms,
            peak_rss_mb: self.peak_rss_mb.max(later.peak_rss_mb),
        }
    }
}

fn join(before: LatencyMs, later: LatencyMs, is_later_longer: bool) -> LatencyMs {
    LatencyMs { max: before.max.max(later.max), ..if is_later_longer { later } else { before } }
}

/// All processes of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RunStatistics {
    /// How the run ended.
    pub ended: Ended,
    /// From start to end, seconds, over all resumptions.
    pub wall_s: f64,
    /// By the name of the stage.
    pub stages: BTreeMap<String, StageStatistics>,
    /// From the frame being in shared memory to its published pose.
    pub end_to_end_ms: LatencyMs,
    /// Most shared memory in use, megabytes (1e6 bytes).
    pub shared_memory_mb: f64,
}

impl RunStatistics {
    /// What the supervisor counted until now.
    pub fn new(
        ended: Ended,
        stages: &BTreeMap<Stage, Counters>,
        duration: Duration,
        shared_memory_bytes: u64,
    ) -> Self {
        let end_to_end = stages.get(&Stage::Align).map(|align| align.end_to_end).unwrap_or_default();
        Self {
            ended,
            wall_s: duration.as_secs_f64(),
            stages: stages
                .iter()
                .map(|(stage, counters)| (stage.name().to_owned(), StageStatistics::new(counters)))
                .collect(),
            end_to_end_ms: end_to_end.into(),
            shared_memory_mb: shared_memory_bytes as f64 * 1e-6,
        }
    }

    /// These and those of a resumption.
    pub fn and(&self, later: &Self) -> Self {
        let mut stages = self.stages.clone();
        for (name, later) in &later.stages {
            let stage = stages.entry(name.clone()).or_default();
            *stage = stage.and(later);
        }
        let n_aligned = |run: &Self| run.stages.get(Stage::Align.name()).map_or(0, |align| align.frames);
        let is_later_longer = n_aligned(later) >= n_aligned(self);
        Self {
            ended: later.ended,
            wall_s: self.wall_s + later.wall_s,
            stages,
            end_to_end_ms: join(self.end_to_end_ms, later.end_to_end_ms, is_later_longer),
            shared_memory_mb: self.shared_memory_mb.max(later.shared_memory_mb),
        }
    }
}

/// Reads what was written last; a run that has written nothing yet has all zero.
pub fn read_statistics(run_folder: &Path) -> Result<RunStatistics, ToolError> {
    let path = run_folder.join(STATISTICS_FILE);
    let wrong = |reason: String| ToolError::Input(format!("{}: {reason}", path.display()));
    match std::fs::read(&path) {
        Ok(bytes) => serde_json::from_slice(&bytes).map_err(|error| wrong(error.to_string())),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(RunStatistics::default()),
        Err(error) => Err(wrong(error.to_string())),
    }
}

/// Writes the statistics of a run into its folder.
pub fn write_statistics(run_folder: &Path, statistics: &RunStatistics) -> Result<(), ToolError> {
    let json = serde_json::to_string_pretty(statistics);
    let json = json.map_err(|error| ToolError::Stage(error.to_string()))?;
    write_file(&run_folder.join(STATISTICS_FILE), |writer| writeln!(writer, "{json}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resumption_adds_to_what_was_there() {
        let part = |frames, p50, max| {
            let latency = tessera_messages::Latency { p50, p99: p50, max };
            let align =
                Counters { frames, restarts: 1, cpu_nanos: 2_000_000, latency, ..Counters::default() };
            let stages = [(Stage::Align, align)].into();
            RunStatistics::new(Ended::Finished, &stages, Duration::from_secs(2), 3_000_000)
        };
        let both = part(100, 1_000_000, 9_000_000).and(&part(10, 5_000_000, 6_000_000));
        let align = both.stages["align"];
        assert_eq!((align.frames, align.restarts, align.cpu_ms), (110, 2, 4.0));
        assert_eq!(
            part(u64::MAX, 1, 1).and(&both).stages["align"].frames,
            u64::MAX,
            "a file may hold any number"
        );
        assert_eq!(align.latency_ms, LatencyMs { p50: 1.0, p99: 1.0, max: 9.0 });
        assert_eq!((both.wall_s, both.shared_memory_mb), (4.0, 3.0));
    }

    #[test]
    fn statistics_survive_their_file() {
        let dir = tempfile::tempdir().unwrap();
        assert_eq!(read_statistics(dir.path()).unwrap(), RunStatistics::default());
        let statistics = RunStatistics { ended: Ended::Failed, wall_s: 1.5, ..RunStatistics::default() };
        write_statistics(dir.path(), &statistics).unwrap();
        assert_eq!(read_statistics(dir.path()).unwrap(), statistics);
        std::fs::write(dir.path().join(STATISTICS_FILE), "{").unwrap();
        assert!(read_statistics(dir.path()).unwrap_err().to_string().contains("statistics.json: EOF"));
    }
}
