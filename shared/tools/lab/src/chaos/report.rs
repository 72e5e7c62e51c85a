//! Report of a campaign: a table for people, JSON lines for scripts.

use super::disturb::Disturbance;
use super::verdict::faults;
use serde::Serialize;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use tessera_outputs::ToolError;

/// Growth of the supervisor's resident set that counts as none, bytes per fault.
const GROWTH: f64 = 1024.0;
/// Faults over which growth must be seen before it is judged.
const GROWTH_OVER: u64 = 100;
/// What a run's supervisor may grow by before it counts: it reads up to 32 kB of the log at each
/// death, twice in memory, and a short run's log is still growing to that.
const FILLING: i64 = 64 << 10;

/// One fault.
#[derive(Clone, Debug, Serialize)]
pub(super) struct FaultReport {
    pub(super) run: u64,
    pub(super) target: &'static str,
    pub(super) fault: String,
    /// Monotonic clock.
    pub(super) at_nanos: u64,
    /// Kill point, where the fault was planned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) place: Option<String>,
    #[serde(skip)]
    pub(super) is_deadly: bool,
    /// From the signal to the first new output of the stage (for optimise: ready; for supervisor
    /// and group: the first new pose of the resumed run).
    pub(super) recovery_ms: Option<f64>,
    pub(super) outcome: &'static str,
}

/// One run.
#[derive(Clone, Debug, Serialize)]
pub(super) struct RunReport {
    pub(super) run: u64,
    pub(super) faults: u64,
    pub(super) wall_s: f64,
    pub(super) finished: bool,
    /// Absent in live mode.
    pub(super) identical: Option<bool>,
    pub(super) frames: u64,
    pub(super) frames_lost: u64,
    pub(super) frames_duplicated: u64,
    pub(super) frames_skipped: u64,
    pub(super) messages_refused: u64,
    pub(super) records_dropped: u64,
    pub(super) files_refused: u64,
    pub(super) left_files: u64,
    pub(super) left_bytes: u64,
    pub(super) undocumented_files: u64,
    pub(super) supervisor_growth_bytes: i64,
    pub(super) supervisor_files_growth: i64,
    pub(super) growth_over_faults: u64,
    pub(super) stages_peak_mb: f64,
    pub(super) stages_peak_undisturbed_mb: f64,
    pub(super) broken: Vec<String>,
}

/// All runs of a campaign.
#[derive(Clone, Debug)]
pub struct ChaosReport {
    source: String,
    seed: u64,
    is_compared: bool,
    runs: Vec<RunReport>,
    faults: Vec<FaultReport>,
    kept: Option<PathBuf>,
}

/// Recovery times of some faults, milliseconds.
#[derive(Clone, Copy, Debug, Serialize)]
struct RecoveryTimes {
    struck: usize,
    measured: usize,
    p50_ms: Option<f64>,
    p99_ms: Option<f64>,
    max_ms: Option<f64>,
}

impl ChaosReport {
    pub(super) fn new(source: String, seed: u64, is_compared: bool) -> Self {
        Self { source, seed, is_compared, runs: Vec::new(), faults: Vec::new(), kept: None }
    }

    pub(super) fn add(&mut self, (run, faults): (RunReport, Vec<FaultReport>)) {
        self.runs.push(run);
        self.faults.extend(faults);
    }

    /// Faults of a run that is not judged.
    pub(super) fn add_faults(&mut self, run: u64, done: &Disturbance, log: &str) {
        self.faults.extend(faults(run, done, log));
    }

    /// The folder of the run that broke the promise.
    pub(super) fn keep(&mut self, dir: &Path) {
        self.kept = Some(dir.to_path_buf());
    }

    pub(super) fn n_faults(&self) -> u64 {
        self.faults.len() as u64
    }

    pub(super) fn n_faults_of_last_run(&self) -> u64 {
        self.runs.last().map_or(0, |run| run.faults)
    }

    /// Everything that the promise forbids and that happened.
    pub fn broken(&self) -> Vec<String> {
        let of_run = |run: &RunReport| {
            let at = self.kept.as_ref().map_or(String::new(), |dir| format!(" ({})", dir.display()));
            run.broken.iter().map(move |reason| format!("run {}: {reason}{at}", run.run)).collect::<Vec<_>>()
        };
        let mut broken: Vec<String> = self.runs.iter().flat_map(of_run).collect();
        let over = self.sum(|run| run.growth_over_faults);
        let leaked: i64 = self.runs.iter().map(|run| (run.supervisor_growth_bytes - FILLING).max(0)).sum();
        let leaked_per_fault = leaked as f64 / over.max(1) as f64;
        if over >= GROWTH_OVER && leaked_per_fault > GROWTH {
            broken.push(format!("the supervisor grew by {leaked_per_fault:.0} bytes a fault"));
        }
        broken
    }

    fn sum(&self, of: impl Fn(&RunReport) -> u64) -> u64 {
        self.runs.iter().map(of).sum()
    }

    fn growth_per_fault(&self) -> f64 {
        let bytes: i64 = self.runs.iter().map(|run| run.supervisor_growth_bytes).sum();
        bytes as f64 / self.sum(|run| run.growth_over_faults).max(1) as f64
    }

    fn times(&self, of: impl Fn(&FaultReport) -> bool) -> RecoveryTimes {
        let struck: Vec<&FaultReport> = self.faults.iter().filter(|fault| of(fault)).collect();
        let mut times: Vec<f64> = struck.iter().filter_map(|fault| fault.recovery_ms).collect();
        times.sort_by(f64::total_cmp);
        // The nearest rank: a time that was measured.
        let rank = |q: f64| times.get(((q * times.len() as f64).ceil() as usize).max(1) - 1).copied();
        RecoveryTimes {
            struck: struck.len(),
            measured: times.len(),
            p50_ms: rank(0.5),
            p99_ms: rank(0.99),
            max_ms: times.last().copied(),
        }
    }

    /// One line for each fault, each run, and the total.
    pub fn to_json_lines(&self) -> Result<String, ToolError> {
        #[derive(Serialize)]
        struct Line<'a, T> {
            event: &'a str,
            #[serde(flatten)]
            what: T,
        }
        #[derive(Serialize)]
        struct Total<'a> {
            source: &'a str,
            seed: u64,
            runs: usize,
            faults: usize,
            kept: bool,
            recovery: RecoveryTimes,
            growth_bytes_per_fault: f64,
            broken: Vec<String>,
        }
        fn line(event: &str, what: impl Serialize) -> Result<String, ToolError> {
            serde_json::to_string(&Line { event, what }).map_err(|error| ToolError::Stage(error.to_string()))
        }
        let mut lines: Vec<String> =
            self.faults.iter().map(|fault| line("fault", fault)).collect::<Result<_, _>>()?;
        for run in &self.runs {
            lines.push(line("run", run)?);
        }
        let broken = self.broken();
        lines.push(line(
            "total",
            Total {
                source: &self.source,
                seed: self.seed,
                runs: self.runs.len(),
                faults: self.faults.len(),
                kept: broken.is_empty(),
                recovery: self.times(|_| true),
                growth_bytes_per_fault: self.growth_per_fault(),
                broken,
            },
        )?);
        Ok(lines.join("\n"))
    }

    /// A table of at most 80 columns.
    pub fn for_people(&self) -> String {
        let mut text = format!("{}, seed {}: {} faults", self.source, self.seed, self.faults.len());
        // Writing to a String cannot fail, here and below.
        let _ = writeln!(text, " in {} runs", self.runs.len().max(1));
        let _ = writeln!(
            text,
            "  {:<22}{:>8}{:>10}{:>10}{:>10}{:>10}",
            "", "struck", "measured", "p50 ms", "p99 ms", "max ms"
        );
        let mut row = |name: &str, times: RecoveryTimes| {
            let ms = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.0}"));
            let RecoveryTimes { struck, measured, p50_ms, p99_ms, max_ms } = times;
            let (p50, p99, max) = (ms(p50_ms), ms(p99_ms), ms(max_ms));
            let _ = writeln!(text, "  {name:<22}{struck:>8}{measured:>10}{p50:>10}{p99:>10}{max:>10}");
        };
        let kinds: BTreeSet<(&str, &str)> =
            self.faults.iter().map(|f| (f.target, f.fault.as_str())).collect();
        for (target, fault) in kinds {
            row(&format!("{target} {fault}"), self.times(|f| f.target == target && f.fault == fault));
        }
        row("all", self.times(|_| true));
        if self.runs.is_empty() {
            return text;
        }
        let runs = self.runs.len();
        let _ = writeln!(
            text,
            "  frames      {} journaled, {} lost, {} twice, {} left out",
            self.sum(|r| r.frames - r.frames_lost - r.frames_skipped),
            self.sum(|r| r.frames_lost),
            self.sum(|r| r.frames_duplicated),
            self.sum(|r| r.frames_skipped)
        );
        let _ = writeln!(
            text,
            "  damage      {} messages refused, {} torn or damaged ends dropped, {} files refused",
            self.sum(|r| r.messages_refused),
            self.sum(|r| r.records_dropped),
            self.sum(|r| r.files_refused)
        );
        let _ = writeln!(
            text,
            "  left        {} files with {} bytes in shared memory, {} undocumented files",
            self.sum(|r| r.left_files),
            self.sum(|r| r.left_bytes),
            self.sum(|r| r.undocumented_files)
        );
        let peak = |of: fn(&RunReport) -> f64| self.runs.iter().map(of).fold(0.0, f64::max);
        let _ = writeln!(
            text,
            "  memory      supervisor {:+.0} bytes and {:+} files over {} faults; stages {:.0} MB, undisturbed {:.0}",
            self.growth_per_fault() * self.sum(|r| r.growth_over_faults) as f64,
            self.runs.iter().map(|run| run.supervisor_files_growth).sum::<i64>(),
            self.sum(|r| r.growth_over_faults),
            peak(|r| r.stages_peak_mb),
            peak(|r| r.stages_peak_undisturbed_mb)
        );
        if self.is_compared {
            let identical = self.runs.iter().filter(|run| run.identical == Some(true)).count();
            let _ = writeln!(text, "  outputs     identical in {identical} of {runs} runs");
        }
        let verdict = if self.broken().is_empty() { "kept" } else { "BROKEN" };
        let _ = writeln!(text, "  promise     {verdict}");
        text
    }
}
