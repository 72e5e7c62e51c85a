//! The summary that a person reads.

use crate::accuracy::Accuracy;
use crate::statistics::Ended;
use crate::summary::{RefinementSummary, STAGES, Summary};
use crate::verdict::Grade;
use std::fmt::Write;

impl Summary {
    /// The summary as lines of at most 80 columns, unless a name or a number is uncommonly long, and
    /// behind it the verdict in sentences.
    pub fn for_people(&self) -> String {
        let mut text = String::new();
        // Writing to a String cannot fail, here and below.
        let _ = writeln!(text, "{}", self.headline());
        let Self { frames_read, frames_processed, frames_dropped, frames_missing, frames_untracked, .. } =
            self;
        let _ = writeln!(
            text,
            "  frames      {frames_processed} of {frames_read} processed, {frames_untracked} not tracked, {frames_dropped} dropped, {frames_missing} missing"
        );
        if let [_, fewer, small, least] = self.frames_at_workload
            && let lowered @ 1.. = fewer.saturating_add(small).saturating_add(least)
        {
            let _ = writeln!(
                text,
                "  workload    lowered in {lowered} frames: {fewer} by 1 level, {small} by 2, {least} by 3"
            );
        }
        let Self { keyframes, loops_closed, loops_rejected, global_optimisations, .. } = self;
        let _ = writeln!(
            text,
            "  map         {keyframes} keyframes, {loops_closed} loops closed, {loops_rejected} rejected, {global_optimisations} global optimisations"
        );
        match (self.map_keyframes, self.first_tracked) {
            (0, _) => {}
            (n, Some(frame)) => {
                let _ = writeln!(text, "  started in  a map of {n} keyframes, found at frame {frame}");
            }
            (n, None) => {
                let _ = writeln!(
                    text,
                    "  WARNING     never found in the map of {n} keyframes, which stays as it was"
                );
            }
        }
        if self.submaps > 1 {
            let Self { submaps, submaps_joined, submaps_apart, frames_apart, .. } = self;
            let _ = writeln!(
                text,
                "  submaps     {submaps}: {submaps_joined} joined, {submaps_apart} apart with {frames_apart} frames"
            );
        }
        if self.wall_s > 0.0 {
            let rate = *frames_processed as f64 / self.wall_s;
            let latency = self.latency_ms.get("end_to_end").copied().unwrap_or_default();
            let _ = writeln!(
                text,
                "  speed       {rate:.1} frames/s, latency p50 {:.1} p99 {:.1} max {:.1} ms",
                latency.p50, latency.p99, latency.max
            );
            text.push_str(&self.stage_table());
        }
        let restarts: u64 = self.restarts.values().sum();
        if restarts > 0 {
            let _ = writeln!(text, "  restarts    {restarts}");
        }
        for (name, accuracy) in [("final", &self.of_final), ("online", &self.of_online)] {
            if let Some(accuracy) = accuracy {
                let _ = writeln!(text, "  {name:<11} {}", accuracy.for_people());
            }
        }
        if let Some(refinement) = &self.refinement {
            text.push_str(&refinement.for_people());
        }
        text.push_str(&self.verdict.for_people());
        text
    }

    /// How the run ended, in a word.
    pub fn how_it_ended(&self) -> &'static str {
        match self.ended {
            Ended::Finished => "done",
            Ended::Interrupted => "interrupted",
            Ended::Failed => "failed",
            Ended::Unfinished => "unfinished",
            Ended::GoingOn => "going on",
        }
    }

    /// Whether the end of the run is a reason to worry.
    pub fn is_alarming(&self) -> bool {
        self.verdict.grade != Grade::Good
    }

    fn headline(&self) -> String {
        let how = self.how_it_ended();
        let optimised = if self.final_optimisation { "" } else { ", without the final optimisation" };
        format!("{}: {how}{optimised}", self.source)
    }

    fn stage_table(&self) -> String {
        let mut text = format!("  {:<12}", "");
        for name in STAGES {
            let _ = write!(text, "{name:>13}");
        }
        for (title, values) in [("CPU ms/frame", &self.cpu_ms_per_frame), ("peak MB", &self.peak_rss_mb)] {
            let _ = write!(text, "\n  {title:<12}");
            for name in STAGES {
                let _ = write!(text, "{:>13.1}", values.get(name).copied().unwrap_or_default());
            }
        }
        let _ = writeln!(text, "\n  shared MB   {:>13.1}", self.shared_memory_mb);
        text
    }
}

impl RefinementSummary {
    fn for_people(&self) -> String {
        match self {
            Self::Refined {
                moved_px,
                held,
                residual_sigmas_before: before,
                residual_sigmas_after: after,
                final_before,
                ..
            } => {
                let mut text = format!(
                    "  camera      refined by {moved_px:.2} px, {held} held, residual {before:.3} to {after:.3}\n"
                );
                if let Some(accuracy) = final_before {
                    let _ = writeln!(text, "  before that {}", accuracy.for_people());
                }
                text
            }
            Self::Kept(reason) => format!("  camera      not refined: {reason}\n"),
        }
    }
}

impl Accuracy {
    fn for_people(&self) -> String {
        let mut text = format!("ATE {:.4} m", self.ate_rmse_m);
        if let (Some(metres), Some(degrees)) =
            (self.rpe_translation_rmse_m_per_s, self.rpe_rotation_rmse_deg_per_s)
        {
            let _ = write!(text, ", RPE {metres:.4} m/s {degrees:.3} deg/s");
        }
        let _ = write!(text, ", end {:.4} m, {} pairs", self.end_error_m, self.pairs);
        if self.world_frames > 1 {
            let _ = write!(text, "\n{:14}in {} world frames, each aligned by itself", "", self.world_frames);
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::summary::tests::summary;

    #[test]
    fn people_read_lines_of_at_most_80_columns() {
        let text = summary().for_people();
        let accuracy = Accuracy {
            ate_rmse_m: 0.0123,
            rpe_translation_rmse_m_per_s: Some(0.0234),
            rpe_rotation_rmse_deg_per_s: Some(1.345),
            end_error_m: 0.0456,
            pairs: 360,
            world_frames: 2,
        };
        let accuracy = format!("  final       {}", accuracy.for_people());
        // The terminal breaks the sentences of the verdict, which name files and numbers.
        let (table, verdict) = text.split_once("  verdict     doubtful\n").unwrap();
        assert!(verdict.contains("try: tessera resume"), "{verdict}");
        for line in table.lines().chain(accuracy.lines()) {
            assert!(line.len() <= 80, "{line}");
        }
        assert!(text.starts_with("room: interrupted, without the final optimisation\n"), "{text}");
        assert!(text.contains("6 of 7 processed, 1 not tracked, 1 dropped, 0 missing"), "{text}");
        assert!(text.contains("restarts    1"), "{text}");
    }
}
