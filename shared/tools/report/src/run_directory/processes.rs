//! Work of the processes, from the summary and the timeline.

use crate::{ProcessSample, StageFigures, StageSample};
use tessera_messages::TimeCounts;
use tessera_outputs::{END_TO_END, Summary, Timeline};

/// Stages in the order of the flow, and the way through all of them.
const ROWS: [&str; 5] = ["sensor", "reconstruct", "align", "optimise", END_TO_END];

/// What each stage did over all its lives.
pub(super) fn stages(summary: &Summary, timeline: &Timeline) -> Vec<StageFigures> {
    ROWS.iter()
        .map(|&name| {
            let latency = summary.latency_ms.get(name).copied().unwrap_or_default();
            let counts = timeline.latency_counts.get(name).map_or(&[][..], Vec::as_slice);
            let end_ms = |bucket: usize| TimeCounts::begin_nanos(bucket + 1) as f64 * 1e-6;
            StageFigures {
                name: name.to_owned(),
                frames: counts.iter().sum(),
                restarts: summary.restarts.get(name).copied().unwrap_or(0),
                latency_ms: [latency.p50, latency.p99, latency.max],
                cpu_ms_per_frame: summary.cpu_ms_per_frame.get(name).copied(),
                peak_rss_mb: summary.peak_rss_mb.get(name).copied(),
                latency_counts: counts.iter().enumerate().map(|(k, n)| (end_ms(k), *n)).collect(),
            }
        })
        .collect()
}

/// The timeline in the report's form.
pub(super) fn samples(timeline: &Timeline) -> Vec<ProcessSample> {
    let stage = |(name, point): (&String, &tessera_outputs::Point)| StageSample {
        stage: name.clone(),
        mean_longest_ms: point.mean_ms.zip(point.longest_ms),
        dropped: point.dropped,
        restarts: point.restarts,
        peak_rss_mb: point.peak_rss_mb,
    };
    let sample = |sample: &tessera_outputs::TimelineSample| ProcessSample {
        at_s: sample.at_s,
        stages: sample.stages.iter().map(stage).collect(),
    };
    timeline.samples.iter().map(sample).collect()
}
