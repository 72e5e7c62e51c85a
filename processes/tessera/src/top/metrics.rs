//! A snapshot as Prometheus reads it (text format 0.0.4).

use super::snapshot::{Snapshot, StageLine};
use std::fmt::Write;

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
pub(crate) fn metrics(snapshot: &Snapshot) -> String {
    let mut text = String::new();
    let run = &snapshot.name;
    // Writing to a String cannot fail.
    for (name, kind, meaning, figure) in FIGURES {
        let _ = writeln!(text, "# HELP {name} {meaning}\n# TYPE {name} {kind}");
        for stage in &snapshot.stages {
            let _ = writeln!(text, "{name}{{run=\"{run}\",stage=\"{}\"}} {}", stage.stage, figure(stage));
        }
    }
    let gauges = [
        ("keyframes", "In the map.", snapshot.keyframes),
        ("loops", "In the map.", snapshot.loops),
        ("workload_level", "Workload level of new frames, 0 full to 3 least.", snapshot.workload),
    ];
    for (name, meaning, value) in gauges {
        let _ = writeln!(text, "# HELP tessera_{name} {meaning}\n# TYPE tessera_{name} gauge");
        let _ = writeln!(text, "tessera_{name}{{run=\"{run}\"}} {value}");
    }
    const TIMES: &str = "tessera_step_seconds";
    let _ = writeln!(text, "# HELP {TIMES} Time of a phase or step in a frame.\n# TYPE {TIMES} summary");
    for stage in &snapshot.stages {
        for (step, t) in &stage.times_ms {
            let labels = format!("run=\"{run}\",stage=\"{}\",step=\"{step}\"", stage.stage);
            for (quantile, ms) in [("0.5", t.p50), ("0.9", t.p90), ("0.99", t.p99), ("1", t.max)] {
                let _ = writeln!(text, "{TIMES}{{{labels},quantile=\"{quantile}\"}} {}", ms * 1e-3);
            }
            let _ = writeln!(text, "{TIMES}_sum{{{labels}}} {}", t.mean * t.n as f64 * 1e-3);
            let _ = writeln!(text, "{TIMES}_count{{{labels}}} {}", t.n);
        }
    }
    text
}
