//! Work of the processes, from the summary and the timeline.

use crate::StageFigures;
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
            let end_ms = |bucket: usize| TimeCounts::begin_nanos(bucket.saturating_add(1)) as f64 * 1e-6;
            StageFigures {
                name: name.to_owned(),
                frames: counts.iter().copied().fold(0, u64::saturating_add),
                restarts: summary.restarts.get(name).copied().unwrap_or(0),
                latency_ms: [latency.p50, latency.p99, latency.max],
                cpu_ms_per_frame: summary.cpu_ms_per_frame.get(name).copied(),
                peak_rss_mb: summary.peak_rss_mb.get(name).copied(),
                latency_counts: counts.iter().enumerate().map(|(k, n)| (end_ms(k), *n)).collect(),
            }
        })
        .collect()
}
