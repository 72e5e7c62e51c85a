//! A snapshot as Prometheus reads it (text format 0.0.4).

use super::snapshot::{Snapshot, StageLine};
use tessera_report::Exposition;

/// Reads one figure of a stage.
type Figure = fn(&StageLine) -> f64;

/// Name, kind, meaning, and where the figure stands.
const FIGURES: [(&str, &str, &str, Figure); 8] = [
    ("tessera_frames_total", "counter", "Frames done by the present process.", |s| s.frames as f64),
    ("tessera_queue", "gauge", "Messages waiting.", |s| s.queue as f64),
    ("tessera_cpu_percent", "gauge", "Of one core, since the look before.", |s| s.cpu_percent),
    ("tessera_peak_rss_megabytes", "gauge", "Highest resident set.", |s| s.peak_rss_mb),
    ("tessera_dropped_total", "counter", "Frames left out for newer ones.", |s| s.dropped as f64),
    ("tessera_lost_total", "counter", "Frames that never came.", |s| s.lost as f64),
    ("tessera_refused_total", "counter", "Messages refused.", |s| s.refused as f64),
    ("tessera_restarts_total", "counter", "Lives after the first.", |s| s.restarts as f64),
];

/// All figures of a snapshot.
pub(crate) fn metrics(snapshot: &Snapshot) -> Exposition {
    let mut figures = Exposition::default();
    let run = ("run", snapshot.name.as_str());
    for (name, kind, meaning, figure) in FIGURES {
        figures.family(name, kind, meaning);
        for stage in &snapshot.stages {
            figures.sample(name, &[run, ("stage", stage.stage)], figure(stage));
        }
    }
    let gauges = [
        ("tessera_keyframes", "In the map.", snapshot.keyframes),
        ("tessera_loops", "In the map.", snapshot.loops),
        ("tessera_workload_level", "Workload level of new frames, 0 full to 3 least.", snapshot.workload),
    ];
    for (name, meaning, value) in gauges {
        figures.family(name, "gauge", meaning);
        figures.sample(name, &[run], value as f64);
    }
    const TIMES: &str = "tessera_step_seconds";
    figures.family(TIMES, "summary", "Time of a phase or step in a frame.");
    for stage in &snapshot.stages {
        for (step, t) in &stage.times_ms {
            let labels = [run, ("stage", stage.stage), ("step", step)];
            for (quantile, ms) in [("0.5", t.p50), ("0.9", t.p90), ("0.99", t.p99), ("1", t.max)] {
                let [run, stage, step] = labels;
                figures.sample(TIMES, &[run, stage, step, ("quantile", quantile)], ms * 1e-3);
            }
            figures.sample(&format!("{TIMES}_sum"), &labels, t.mean * t.n as f64 * 1e-3);
            figures.sample(&format!("{TIMES}_count"), &labels, t.n as f64);
        }
    }
    figures
}
