//! Report of a profile.

use serde::Serialize;
use std::fmt::Write;
use tessera_messages::{Phase, Stage, StageTimes, TIME_ROWS, TimeRow};

/// A distribution of times, milliseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Times {
    /// Frames in which it took any time, over all passes.
    pub n: u64,
    /// Mean.
    pub mean: f64,
    /// Median.
    pub p50: f64,
    /// 90th percentile.
    pub p90: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Largest.
    pub max: f64,
}

impl From<&TimeRow> for Times {
    fn from(row: &TimeRow) -> Self {
        let ms = |nanos: u64| nanos as f64 * 1e-6;
        let mean = ms(row.sum) / row.n.max(1) as f64;
        Self { n: row.n, mean, p50: ms(row.p50), p90: ms(row.p90), p99: ms(row.p99), max: ms(row.max) }
    }
}

/// One step.
#[derive(Clone, Debug, Serialize)]
pub(super) struct StepReport {
    name: &'static str,
    /// Of the time of the whole stage.
    share: f64,
    #[serde(flatten)]
    ms: Times,
}

/// What a stage took by itself.
#[derive(Clone, Debug, Serialize)]
pub struct ProfileReport {
    stage: &'static str,
    /// Frames (or requests) of the recording.
    frames: u64,
    repeat: u64,
    /// Checksum over all results, which are those of the pipeline.
    output: String,
    cpu_ms_per_frame: f64,
    /// The whole step.
    ms: Times,
    steps: Vec<StepReport>,
    /// Of the whole, what belongs to no step; all of it where steps are not measured.
    unnamed_share: f64,
}

impl ProfileReport {
    pub(super) fn new(
        stage: Stage,
        frames: u64,
        repeat: u64,
        cpu_nanos: u64,
        output: u32,
        rows: &[TimeRow; TIME_ROWS],
    ) -> Self {
        let whole = rows[StageTimes::phase_row(Phase::Computing)];
        let times = StageTimes { stage: stage.number(), pid: std::process::id(), rows: *rows };
        let steps = times.named().filter(|(name, _)| *name != Phase::Computing.name());
        let steps: Vec<StepReport> = steps
            .map(|(name, row)| StepReport {
                name,
                share: row.sum as f64 / whole.sum.max(1) as f64,
                ms: Times::from(row),
            })
            .collect();
        Self {
            stage: stage.name(),
            frames,
            repeat,
            output: format!("{output:08x}"),
            cpu_ms_per_frame: cpu_nanos as f64 * 1e-6 / whole.n.max(1) as f64,
            ms: Times::from(&whole),
            unnamed_share: 1.0 - steps.iter().map(|step| step.share).sum::<f64>(),
            steps,
        }
    }

    /// As text.
    pub fn for_people(&self) -> String {
        let unit = if self.stage == Stage::Optimise.name() { "requests" } else { "frames" };
        let mut text = format!(
            "{}: {} {unit}, {} passes, {:.3} ms of CPU each; output {}, as in the pipeline\n",
            self.stage, self.frames, self.repeat, self.cpu_ms_per_frame, self.output
        );
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "  {:<12}{:>8}{:>9}{:>9}{:>9}{:>9}{:>9}",
            "ms", "share", "mean", "p50", "p90", "p99", "max"
        );
        let mut line = |name: &str, share: f64, t: &Times| {
            let share = format!("{:.1} %", 100.0 * share);
            let _ = writeln!(
                text,
                "  {name:<12}{share:>8}{:>9.3}{:>9.3}{:>9.3}{:>9.3}{:>9.3}",
                t.mean, t.p50, t.p90, t.p99, t.max
            );
        };
        line("all", 1.0, &self.ms);
        self.steps.iter().for_each(|step| line(step.name, step.share, &step.ms));
        if !self.steps.is_empty() {
            let _ =
                writeln!(text, "  {:<12}{:>8}", "no step", format!("{:.1} %", 100.0 * self.unnamed_share));
        }
        text
    }
}
