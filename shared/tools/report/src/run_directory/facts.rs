//! The summary in words and numbers.

use tessera_outputs::{Machine, Summary};

/// What came of the run.
pub(super) fn of(summary: &Summary) -> Vec<(String, String)> {
    let mut facts = Vec::new();
    let mut fact = |name: &str, value: String| facts.push((name.to_owned(), value));
    for (name, accuracy) in [("final", &summary.of_final), ("online", &summary.of_online)] {
        let Some(accuracy) = accuracy else { continue };
        let by_parts = match accuracy.world_frames {
            n if n > 1 => format!(", {n} world frames each by itself"),
            _ => String::new(),
        };
        fact(&format!("ATE, {name}"), format!("{:.2} mm{by_parts}", 1e3 * accuracy.ate_rmse_m));
        if let Some(metres) = accuracy.rpe_translation_rmse_m_per_s {
            fact(&format!("RPE, {name}"), format!("{:.2} mm/s", 1e3 * metres));
        }
        if let Some(degrees) = accuracy.rpe_rotation_rmse_deg_per_s {
            fact(&format!("RPE of rotation, {name}"), format!("{degrees:.3} °/s"));
        }
    }
    fact("frames processed", format!("{} of {}", summary.frames_processed, summary.frames_read));
    fact("not tracked", summary.frames_untracked.to_string());
    fact("dropped", summary.frames_dropped.to_string());
    fact("missing", summary.frames_missing.to_string());
    fact("keyframes", summary.keyframes.to_string());
    if summary.map_keyframes > 0 {
        let found =
            summary.first_tracked.map_or("never found in it".into(), |n| format!("found at frame {n}"));
        fact("started in a map", format!("{} keyframes, {found}", summary.map_keyframes));
    }
    fact(
        "loops found / closed / rejected",
        format!("{} / {} / {}", summary.loops_found, summary.loops_closed, summary.loops_rejected),
    );
    fact("global optimisations", summary.global_optimisations.to_string());
    if summary.wall_s > 0.0 {
        let rate = summary.frames_processed as f64 / summary.wall_s;
        fact("speed", format!("{rate:.1} frames/s"));
        fact("time", format!("{:.1} s", summary.wall_s));
    }
    if let Some(latency) = summary.latency_ms.get("end_to_end") {
        fact("latency, p50 / p99", format!("{:.1} / {:.1} ms", latency.p50, latency.p99));
    }
    fact("restarts", summary.restarts.values().sum::<u64>().to_string());
    fact("shared memory", format!("{:.1} MB", summary.shared_memory_mb));
    facts
}

/// Where it was made.
pub(super) fn machine(summary: &Summary, machine: &Machine) -> Vec<(String, String)> {
    let known = |text: &str| if text.is_empty() { "not recorded".to_owned() } else { text.to_owned() };
    let mut facts = vec![("Tessera".to_owned(), summary.version.to_owned())];
    facts.push(("processor".into(), known(&machine.processor)));
    if machine.cores > 0 {
        facts.push(("threads".into(), machine.cores.to_string()));
        facts.push(("memory".into(), format!("{:.1} GB", machine.memory_gb)));
    }
    facts.push(("system".into(), known(&machine.system)));
    facts
}
