//! `timeline.json`: what the processes did over the time of a run, and on which machine. For the
//! report alone: nothing else reads it.

use crate::ToolError;
use crate::files::write_file;
use crate::machine::Machine;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;
use tessera_messages::{Stage, TimeCounts};
use tessera_supervisor::Counters;

/// Name of the file in the run directory.
pub(crate) const TIMELINE_FILE: &str = "timeline.json";
/// Name under which the time from shared memory to pose stands among the stages.
pub const END_TO_END: &str = "end_to_end";

/// Samples kept of one start of the supervisor; with more, every second goes.
const MOST_SAMPLES: usize = 400;
/// First time between two samples.
const FIRST_INTERVAL: Duration = Duration::from_millis(200);

/// One stage between two samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Point {
    /// Frames (or requests) done since the sample before.
    pub frames: u64,
    /// Mean time for one of them, milliseconds, to 10 %; absent without any.
    pub mean_ms: Option<f64>,
    /// Longest time for one of them, milliseconds, to 20 %.
    pub longest_ms: Option<f64>,
    /// Frames dropped since the sample before.
    pub dropped: u64,
    /// Restarts since the sample before.
    pub restarts: u64,
    /// Highest resident set until then, megabytes (1e6 bytes).
    pub peak_rss_mb: f64,
}

/// All stages at one time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct TimelineSample {
    /// Since the start of the run, over all resumptions, seconds.
    pub at_s: f64,
    /// By the name of the stage.
    pub stages: BTreeMap<String, Point>,
}

/// The file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Timeline {
    /// Where the run was started last.
    pub machine: Machine,
    /// In the order of time.
    pub samples: Vec<TimelineSample>,
    /// How often a frame took how long in each stage, in the buckets of `TimeCounts`.
    pub latency_counts: BTreeMap<String, Vec<u64>>,
}

type TimelineSnapshot = BTreeMap<Stage, Counters>;

/// Gathers a timeline while a run goes on; its memory has a bound.
pub struct Recorder {
    before: Timeline,
    offset_s: f64,
    interval: Duration,
    snapshots: Vec<(Duration, TimelineSnapshot)>,
}

impl Recorder {
    /// Goes on behind what was recorded in the first `offset_s` seconds of the run.
    pub fn new(mut before: Timeline, offset_s: f64) -> Self {
        before.machine = Machine::this();
        Self { before, offset_s, interval: FIRST_INTERVAL, snapshots: Vec::new() }
    }

    /// Takes a sample, if it is time for one or the last.
    pub fn note(&mut self, elapsed: Duration, stages: &TimelineSnapshot, is_last: bool) {
        let last = self.snapshots.last().map_or(Duration::ZERO, |(at, _)| *at);
        if !is_last && elapsed.saturating_sub(last) < self.interval {
            return;
        }
        self.snapshots.push((elapsed, stages.clone()));
        if self.snapshots.len() > MOST_SAMPLES {
            self.interval = self.interval.saturating_mul(2);
            // The newest stays: counters only grow.
            self.snapshots = std::mem::take(&mut self.snapshots).into_iter().step_by(2).collect();
        }
    }

    /// What is known until now.
    pub fn timeline(&self) -> Timeline {
        let mut timeline = self.before.clone();
        let mut old: BTreeMap<String, FrameProgress> = BTreeMap::new();
        for (at, snapshot) in &self.snapshots {
            let now = progresses(snapshot);
            let stages = now
                .iter()
                .map(|(name, now)| {
                    (name.clone(), now.since(old.get(name).unwrap_or(&FrameProgress::default())))
                })
                .collect();
            timeline.samples.push(TimelineSample { at_s: self.offset_s + at.as_secs_f64(), stages });
            old = now;
        }
        for (name, progress) in &old {
            let counts = timeline.latency_counts.entry(name.clone()).or_default();
            counts.resize(progress.counts.0.len(), 0);
            counts
                .iter_mut()
                .zip(progress.counts.0)
                .for_each(|(sum, n)| *sum = sum.saturating_add(u64::from(n)));
        }
        timeline
    }
}

/// What a stage has done until one sample.
#[derive(Clone, Copy, Default)]
struct FrameProgress {
    counts: TimeCounts,
    dropped: u64,
    restarts: u64,
    peak_rss_bytes: u64,
}

fn progresses(snapshot: &TimelineSnapshot) -> BTreeMap<String, FrameProgress> {
    let mut all = BTreeMap::new();
    for (stage, counters) in snapshot {
        let Counters { dropped, restarts, peak_rss_bytes, latency_counts, end_to_end_counts, .. } = *counters;
        let own = FrameProgress { counts: latency_counts, dropped, restarts, peak_rss_bytes };
        all.insert(stage.name().to_owned(), own);
        if *stage == Stage::Align {
            let whole = FrameProgress { counts: end_to_end_counts, ..FrameProgress::default() };
            all.insert(END_TO_END.to_owned(), whole);
        }
    }
    all
}

impl FrameProgress {
    fn since(&self, old: &Self) -> Point {
        let (mut frames, mut sum_ms, mut longest_ms) = (0_u64, 0.0, None);
        for (bucket, (now, before)) in self.counts.0.iter().zip(old.counts.0).enumerate() {
            let n = u64::from(now.saturating_sub(before));
            if n > 0 {
                let border_ms = |bucket| TimeCounts::begin_nanos(bucket) as f64 * 1e-6;
                let end_ms = border_ms(bucket.saturating_add(1));
                frames = frames.saturating_add(n);
                sum_ms += n as f64 * 0.5 * (border_ms(bucket) + end_ms);
                longest_ms = Some(end_ms);
            }
        }
        Point {
            frames,
            mean_ms: (frames > 0).then(|| sum_ms / frames as f64),
            longest_ms,
            dropped: self.dropped.saturating_sub(old.dropped),
            restarts: self.restarts.saturating_sub(old.restarts),
            peak_rss_mb: self.peak_rss_bytes as f64 * 1e-6,
        }
    }
}

/// Reads the timeline of a run; `None` where there is none or it is of another form.
pub fn read_timeline(run_folder: &Path) -> Option<Timeline> {
    let bytes = std::fs::read(run_folder.join(TIMELINE_FILE)).ok()?;
    serde_json::from_slice(&bytes).ok()
}

/// Writes the timeline of a run into its folder.
pub fn write_timeline(run_folder: &Path, timeline: &Timeline) -> Result<(), ToolError> {
    let json = serde_json::to_string(timeline).map_err(|error| ToolError::Stage(error.to_string()))?;
    write_file(&run_folder.join(TIMELINE_FILE), |writer| writeln!(writer, "{json}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn snapshot(n_done: usize, restarts: u64) -> TimelineSnapshot {
        let mut counters = Counters { restarts, dropped: 2 * restarts, ..Counters::default() };
        (0..n_done).for_each(|_| counters.latency_counts.add(2_000_000));
        [(Stage::Align, counters)].into()
    }

    #[test]
    fn a_point_tells_what_happened_since_the_one_before() {
        let mut recorder = Recorder::new(Timeline::default(), 10.0);
        recorder.note(Duration::from_secs(1), &snapshot(10, 0), false);
        recorder.note(Duration::from_millis(1100), &snapshot(11, 0), false);
        recorder.note(Duration::from_secs(2), &snapshot(30, 1), true);
        let timeline = recorder.timeline();
        let points: Vec<&Point> = timeline.samples.iter().map(|sample| &sample.stages["align"]).collect();
        assert_eq!(
            points.iter().map(|p| (p.frames, p.restarts, p.dropped)).collect::<Vec<_>>(),
            [(10, 0, 0), (20, 1, 2)]
        );
        assert!((points[0].mean_ms.unwrap() - 2.0).abs() < 0.2, "{points:?}");
        assert_eq!(timeline.samples[1].at_s, 12.0);
        assert_eq!(timeline.latency_counts["align"].iter().sum::<u64>(), 30);
        assert!(timeline.samples[0].stages.contains_key(END_TO_END));
    }

    #[test]
    fn memory_has_a_bound_and_nothing_is_counted_twice() {
        let mut recorder = Recorder::new(Timeline::default(), 0.0);
        for k in 0..3000u64 {
            recorder.note(Duration::from_secs(k), &snapshot(k as usize / 10, k), false);
        }
        let timeline = recorder.timeline();
        assert!(timeline.samples.len() <= MOST_SAMPLES);
        let restarts: u64 = timeline.samples.iter().map(|sample| sample.stages["align"].restarts).sum();
        let newest = recorder.snapshots.last().unwrap();
        assert_eq!(restarts, newest.1[&Stage::Align].restarts);
    }

    #[test]
    fn a_timeline_survives_its_file_and_a_resumption_adds_to_it() {
        let dir = tempfile::tempdir().unwrap();
        let mut recorder = Recorder::new(Timeline::default(), 0.0);
        recorder.note(Duration::from_secs(1), &snapshot(3, 0), true);
        write_timeline(dir.path(), &recorder.timeline()).unwrap();
        let read = read_timeline(dir.path()).unwrap();
        // JSON may change the last bit of a number.
        assert_eq!(
            (&read.machine, &read.latency_counts),
            (&Machine::this(), &recorder.timeline().latency_counts)
        );
        assert_eq!((read.samples.len(), read.samples[0].stages["align"].frames), (1, 3));
        let mut later = Recorder::new(read, 5.0);
        later.note(Duration::from_secs(1), &snapshot(4, 0), true);
        assert_eq!(later.timeline().latency_counts["align"].iter().sum::<u64>(), 7);
        assert_eq!(later.timeline().samples.iter().map(|s| s.at_s).collect::<Vec<_>>(), [1.0, 6.0]);
        std::fs::write(dir.path().join(TIMELINE_FILE), "[").unwrap();
        assert_eq!(read_timeline(dir.path()), None);
    }
}
