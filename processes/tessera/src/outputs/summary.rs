//! `summary.json`, and the summary that a person reads.

use crate::exit::CommandError;
use crate::outputs::files::write_whole;
use crate::outputs::replay::Replay;
use crate::outputs::statistics::{Ended, LatencyMs, RunStatistics, StageStatistics};
use crate::outputs::trajectories::{Rows, as_trajectory, final_rows, online_rows};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use tessera_geometry::Camera;
use tessera_mapping::Refinement;
use tessera_settings::Settings;
use tessera_trajectory::{EvaluationOptions, Trajectory, evaluate};

/// Names of the stages in the order of the flow, as every table of the summary lists them.
const STAGES: [&str; 4] = ["sensor", "reconstruct", "align", "optimise"];

/// Errors against the ground truth, by the definitions of the TUM scripts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Accuracy {
    /// Absolute trajectory error, metres.
    pub(crate) ate_rmse_m: f64,
    /// Relative pose error over one second; absent where the run is shorter.
    pub(crate) rpe_translation_rmse_m_per_s: Option<f64>,
    /// Relative pose error over one second; absent where the run is shorter.
    pub(crate) rpe_rotation_rmse_deg_per_s: Option<f64>,
    /// How far the last pose is off, seen from the first, metres.
    pub(crate) end_error_m: f64,
    /// Poses compared.
    pub(crate) pairs: usize,
}

/// What came of a run. Field names are an interface: scripts read them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Summary {
    pub(crate) version: &'static str,
    pub(crate) source: String,
    pub(crate) ended: Ended,
    /// Whether the optimisation at the end of the run is in the outputs.
    pub(crate) final_optimisation: bool,
    pub(crate) frames_read: u64,
    pub(crate) frames_processed: u64,
    pub(crate) frames_dropped: u64,
    pub(crate) frames_lost: u64,
    pub(crate) frames_untracked: u64,
    /// Processed frames by the effort they got, from the full one down; less than full in live
    /// mode alone.
    pub(crate) frames_at_effort: [u64; 4],
    pub(crate) keyframes: u64,
    /// Of those, in the map of the earlier run that this one started in.
    pub(crate) map_keyframes: u64,
    /// First tracked frame; in a run that started in a map, the frame that was found there.
    pub(crate) first_tracked: Option<u64>,
    pub(crate) loops_closed: u64,
    pub(crate) global_optimisations: u64,
    pub(crate) restarts: BTreeMap<String, u64>,
    pub(crate) latency_ms: BTreeMap<String, LatencyMs>,
    pub(crate) cpu_ms_per_frame: BTreeMap<String, f64>,
    pub(crate) peak_rss_mb: BTreeMap<String, f64>,
    pub(crate) shared_memory_mb: f64,
    pub(crate) wall_s: f64,
    /// Of `trajectory.txt`; absent without ground truth.
    #[serde(rename = "final", skip_serializing_if = "Option::is_none")]
    pub(crate) of_final: Option<Accuracy>,
    /// Of `trajectory_online.txt`; absent without ground truth.
    #[serde(rename = "online", skip_serializing_if = "Option::is_none")]
    pub(crate) of_online: Option<Accuracy>,
    /// What became of the camera; absent where the run was not asked to refine it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) refinement: Option<RefinementSummary>,
}

/// What `--refine-camera` did.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum RefinementSummary {
    /// The outputs are those of another camera.
    Refined {
        camera: Box<Camera>,
        /// How far the image moved, root mean square pixels.
        moved_px: f64,
        /// Combinations of parameters that the motion does not determine.
        held: u32,
        /// Root mean square residual of keyframe pairs, standard deviations of depth.
        residual_sigmas_before: f64,
        residual_sigmas_after: f64,
        /// Of the final trajectory with the run's own camera; absent without ground truth.
        final_before: Option<Accuracy>,
    },
    /// The outputs are those of the run's own camera, and why.
    Kept(String),
}

impl Summary {
    /// Puts together what the journal, the supervisor and the ground truth say.
    pub(crate) fn new(
        settings: &Settings,
        replay: &Replay,
        statistics: &RunStatistics,
        groundtruth: Option<&Trajectory>,
    ) -> Self {
        let (processed, dropped) = (replay.frames.len() as u64, replay.skipped.len() as u64);
        // Until the source has ended, what was sent and not yet processed is not lost but undone.
        let read = replay.n_source_frames.unwrap_or(processed + dropped).max(processed + dropped);
        let stage = |name: &str| statistics.stages.get(name).copied().unwrap_or_default();
        let cpu = |stage: StageStatistics| if processed > 0 { stage.cpu_ms / processed as f64 } else { 0.0 };
        let mut latency_ms = by_stage(|name| stage(name).latency_ms);
        latency_ms.insert("end_to_end".to_owned(), statistics.end_to_end_ms);
        let accuracy = |rows: &Rows| groundtruth.and_then(|truth| accuracy(rows, truth));
        Self {
            version: env!("CARGO_PKG_VERSION"),
            source: settings.run.source.clone(),
            ended: statistics.ended,
            final_optimisation: replay.is_finally_optimised,
            frames_read: read,
            frames_processed: processed,
            frames_dropped: dropped,
            frames_lost: read - processed - dropped,
            frames_untracked: replay.n_untracked(),
            frames_at_effort: replay.n_at_effort(),
            keyframes: replay.keyframes.len() as u64,
            map_keyframes: replay.n_map_keyframes as u64,
            first_tracked: replay.first_tracked,
            loops_closed: replay.n_loops_closed(),
            global_optimisations: replay.n_corrections,
            restarts: by_stage(|name| stage(name).restarts),
            latency_ms,
            cpu_ms_per_frame: by_stage(|name| cpu(stage(name))),
            peak_rss_mb: by_stage(|name| stage(name).peak_rss_mb),
            shared_memory_mb: statistics.shared_memory_mb,
            wall_s: statistics.wall_s,
            of_final: accuracy(&final_rows(replay)),
            of_online: accuracy(&online_rows(replay)),
            refinement: settings
                .mapping
                .global
                .refine_camera
                .then(|| RefinementSummary::new(replay.refinement.as_ref())),
        }
    }

    /// Adds the errors of the run as its own camera saw it, beside those of the refined one.
    pub(crate) fn compare_with(&mut self, as_mapped: &Replay, groundtruth: Option<&Trajectory>) {
        if let Some(RefinementSummary::Refined { final_before, .. }) = &mut self.refinement {
            *final_before = groundtruth.and_then(|truth| accuracy(&final_rows(as_mapped), truth));
        }
    }

    /// Whether the run started in a map and no frame of it was found there.
    pub(crate) fn is_nowhere(&self) -> bool {
        self.map_keyframes > 0 && self.first_tracked.is_none()
    }

    /// Writes `summary.json`.
    pub(crate) fn write(&self, folder: &Path) -> Result<(), CommandError> {
        let json = self.to_json()?;
        write_whole(folder, "summary.json", |writer| writeln!(writer, "{json}"))
    }

    /// The summary as JSON.
    pub(crate) fn to_json(&self) -> Result<String, CommandError> {
        serde_json::to_string_pretty(self).map_err(|error| CommandError::Stage(error.to_string()))
    }

    /// The summary as lines of at most 80 columns, unless a name or a number is uncommonly long.
    pub(crate) fn for_people(&self) -> String {
        let mut text = String::new();
        // Writing to a String cannot fail, here and below.
        let _ = writeln!(text, "{}", self.headline());
        let Self { frames_read, frames_processed, frames_dropped, frames_lost, frames_untracked, .. } = self;
        let _ = writeln!(
            text,
            "  frames      {frames_processed} of {frames_read} processed, {frames_untracked} not tracked, {frames_dropped} dropped, {frames_lost} lost"
        );
        if let [_, fewer, small, least] = self.frames_at_effort
            && fewer + small + least > 0
        {
            let _ = writeln!(
                text,
                "  effort      lowered in {} frames: {fewer} by 1 rung, {small} by 2, {least} by 3",
                fewer + small + least
            );
        }
        let Self { keyframes, loops_closed, global_optimisations, .. } = self;
        let _ = writeln!(
            text,
            "  map         {keyframes} keyframes, {loops_closed} loops closed, {global_optimisations} global optimisations"
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
        text
    }

    /// How the run ended, in a word.
    pub(crate) fn how_it_ended(&self) -> &'static str {
        match self.ended {
            Ended::Finished => "done",
            Ended::Interrupted => "interrupted",
            Ended::Failed => "failed",
            Ended::Unfinished => "unfinished",
        }
    }

    /// Whether the end of the run is a reason to worry.
    pub(crate) fn is_alarming(&self) -> bool {
        self.ended != Ended::Finished || self.frames_lost > 0 || self.is_nowhere()
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
    fn new(refinement: Option<&Refinement>) -> Self {
        match refinement {
            Some(Refinement::Refined(found)) => Self::Refined {
                camera: Box::new(found.camera.clone()),
                moved_px: found.moved_px,
                held: found.n_held,
                residual_sigmas_before: found.residual_sigmas[0],
                residual_sigmas_after: found.residual_sigmas[1],
                final_before: None,
            },
            Some(Refinement::Kept(reason)) => Self::Kept(reason.clone()),
            None => Self::Kept("the run ended without a final optimisation".to_owned()),
        }
    }

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
        text
    }
}

fn by_stage<T>(value: impl Fn(&str) -> T) -> BTreeMap<String, T> {
    STAGES.iter().map(|name| ((*name).to_owned(), value(name))).collect()
}

/// The errors of a trajectory; `None` where too little overlaps with the ground truth.
fn accuracy(rows: &Rows, groundtruth: &Trajectory) -> Option<Accuracy> {
    let estimate = as_trajectory(rows)?;
    let evaluation = evaluate(&estimate, groundtruth, &EvaluationOptions::default()).ok()?;
    Some(Accuracy {
        ate_rmse_m: evaluation.ate_rmse_m,
        rpe_translation_rmse_m_per_s: evaluation.rpe_translation_rmse_m_per_s,
        rpe_rotation_rmse_deg_per_s: evaluation.rpe_rotation_rmse_deg_per_s,
        end_error_m: evaluation.end_error_m,
        pairs: evaluation.pairs,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outputs::test_run;

    fn summary() -> Summary {
        let replay = test_run::replay();
        let truth = as_trajectory(&online_rows(&replay)).unwrap();
        let stage = StageStatistics { restarts: 1, cpu_ms: 30.0, ..StageStatistics::default() };
        let statistics = RunStatistics {
            stages: [("align".to_owned(), stage)].into(),
            ended: Ended::Interrupted,
            wall_s: 2.0,
            ..RunStatistics::default()
        };
        Summary::new(&Settings::default(), &replay, &statistics, Some(&truth))
    }

    #[test]
    fn the_json_has_the_fields_that_scripts_read() {
        let json: serde_json::Value = serde_json::from_str(&summary().to_json().unwrap()).unwrap();
        let numbers = [
            ("frames_read", 7),
            ("frames_processed", 6),
            ("frames_dropped", 1),
            ("frames_lost", 0),
            ("frames_untracked", 1),
            ("keyframes", 3),
            ("loops_closed", 1),
            ("global_optimisations", 1),
        ];
        for (key, expected) in numbers {
            assert_eq!(json[key], expected, "{key}");
        }
        assert_eq!((&json["map_keyframes"], &json["first_tracked"]), (&0.into(), &0.into()));
        assert_eq!(json["restarts"]["align"], 1);
        assert_eq!(json["restarts"]["sensor"], 0);
        assert_eq!(json["cpu_ms_per_frame"]["align"], 5.0);
        assert!(json["latency_ms"]["end_to_end"]["p99"].is_number());
        assert!(json["peak_rss_mb"]["optimise"].is_number());
        assert!(json["shared_memory_mb"].is_number());
        assert_eq!(json["final_optimisation"], false);
        assert_eq!(json["online"]["pairs"], 6);
        assert!(json["online"]["ate_rmse_m"].as_f64().unwrap() < 1e-9);
        assert!(json["final"]["ate_rmse_m"].as_f64().unwrap() > 0.1);
        // Shorter than a second: no RPE, and not a number made up for it.
        assert!(json["final"]["rpe_translation_rmse_m_per_s"].is_null());
    }

    #[test]
    fn people_read_lines_of_at_most_80_columns() {
        let text = summary().for_people();
        let accuracy = Accuracy {
            ate_rmse_m: 0.0123,
            rpe_translation_rmse_m_per_s: Some(0.0234),
            rpe_rotation_rmse_deg_per_s: Some(1.345),
            end_error_m: 0.0456,
            pairs: 360,
        };
        let accuracy = format!("  final       {}", accuracy.for_people());
        for line in text.lines().chain([accuracy.as_str()]) {
            assert!(line.len() <= 80, "{line}");
        }
        assert!(text.starts_with("room: interrupted, without the final optimisation\n"), "{text}");
        assert!(text.contains("6 of 7 processed, 1 not tracked, 1 dropped, 0 lost"), "{text}");
        assert!(text.contains("restarts    1"), "{text}");
    }
}
