//! `summary.json`.

use crate::ToolError;
use crate::accuracy::{Accuracy, accuracy, accuracy_by_gauge};
use crate::colour::ColourSummary;
use crate::facts::{Beside, Facts};
use crate::files::write_file;
use crate::noise::NoiseSummary;
use crate::replay::Replay;
use crate::statistics::{Ended, LatencyMs, RunStatistics, StageStatistics};
use crate::trajectories::{Rows, final_rows, online_rows};
use crate::verdict::{Verdict, verdict};
use crate::wrong_camera::focal;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;
use tessera_evaluation::Trajectory;
use tessera_geometry::Camera;
use tessera_settings::Settings;
use tessera_slam::Refinement;
use tessera_sources::judge::FocalSource;

/// Names of the stages in the order of the flow, as every table of the summary lists them.
pub(crate) const STAGES: [&str; 4] = ["sensor", "reconstruct", "align", "optimise"];

/// What came of a run. Field names are an interface: scripts read them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Version of the program that wrote it.
    pub version: &'static str,
    /// Source, as the user named it.
    pub source: String,
    /// How the run ended.
    pub ended: Ended,
    /// Whether the outputs can be relied on, and why not.
    pub verdict: Verdict,
    /// Whether the optimisation at the end of the run is in the outputs.
    pub final_optimisation: bool,
    /// Frames that the sensor sent.
    pub frames_read: u64,
    /// Frames with a record.
    pub frames_processed: u64,
    /// Frames left out in a live run.
    pub frames_dropped: u64,
    /// Frames that ended their stage again and again.
    pub frames_missing: u64,
    /// Frames whose pose is a prediction.
    pub frames_untracked: u64,
    /// Where they are: first and last frame of each span.
    pub untracked: Vec<[u64; 2]>,
    /// Frames with a missing or broken image, which went on without it.
    pub frames_broken: u64,
    /// Processed frames by the workload they got, from the full one down; less than full in live
    /// mode alone.
    pub frames_at_workload: [u64; 4],
    /// Keyframes of the map.
    pub keyframes: u64,
    /// Of those, in the map of the earlier run that this one started in.
    pub map_keyframes: u64,
    /// First tracked frame; in a run that started in a map, the frame that was found there.
    pub first_tracked: Option<u64>,
    /// Submaps: one, and another for each time that the camera was lost for long.
    pub submaps: u64,
    /// Of those, the ones joined to another.
    pub submaps_joined: u64,
    /// Those with a trajectory of their own.
    pub submaps_apart: u64,
    /// Processed frames that are not in `trajectory.txt` but in the file of a submap.
    pub frames_apart: u64,
    /// Pairs of keyframes that would close a loop.
    pub loops_found: u64,
    /// Those that were verified and that the optimisation kept.
    pub loops_closed: u64,
    /// Those that were verified and that the optimisation rejected.
    pub loops_rejected: u64,
    /// Corrections of all keyframes.
    pub global_optimisations: u64,
    /// Of those, the ones that the base of a fleet computed; absent where the run asked no base.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub corrections_from_base: Option<u64>,
    /// Restarts by stage.
    pub restarts: BTreeMap<String, u64>,
    /// Latency by stage, milliseconds.
    pub latency_ms: BTreeMap<String, LatencyMs>,
    /// CPU time by stage, milliseconds a frame.
    pub cpu_ms_per_frame: BTreeMap<String, f64>,
    /// Largest resident memory by stage, MB.
    pub peak_rss_mb: BTreeMap<String, f64>,
    /// Shared memory of the run, MB.
    pub shared_memory_mb: f64,
    /// Duration, seconds.
    pub wall_s: f64,
    /// Of `trajectory.txt`; absent without ground truth.
    #[serde(rename = "final", skip_serializing_if = "Option::is_none")]
    pub of_final: Option<Accuracy>,
    /// Of `trajectory_online.txt`, by world frames where the camera began a submap; absent without ground truth.
    #[serde(rename = "online", skip_serializing_if = "Option::is_none")]
    pub of_online: Option<Accuracy>,
    /// How colour lies against depth; absent where no features were judged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub colour: Option<ColourSummary>,
    /// Frames whose colour image was that of the frame before; left out of the alignment.
    pub repeated_colour: u64,
    /// Noise scales of surfaces and features; absent where no frame was aligned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<NoiseSummary>,
    /// The focal length that all evidence together finds; absent without evidence.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focal: Option<FocalSummary>,
    /// What became of the camera; absent where the run was not asked to refine it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refinement: Option<RefinementSummary>,
}

/// The focal length along x by all evidence, as the verdict judges it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FocalSummary {
    /// The camera's, pixels.
    pub stated_px: f64,
    /// By the evidence, pixels.
    pub likely_px: f64,
    /// Standard deviation of that, pixels.
    pub deviation_px: f64,
    /// How far both are apart, standard deviations of both.
    pub sigmas: f64,
    /// The camera's is refuted.
    pub is_doubted: bool,
    /// What the evidence is of.
    pub by: Vec<FocalSource>,
}

/// What `--refine-camera` did.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RefinementSummary {
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
    pub fn new(
        settings: &Settings,
        replay: &Replay,
        statistics: &RunStatistics,
        groundtruth: Option<&Trajectory>,
        beside: &Beside,
    ) -> Self {
        let facts = Facts::new(replay, statistics, groundtruth, beside);
        let processed = facts.n_processed;
        let stage = |name: &str| statistics.stages.get(name).copied().unwrap_or_default();
        let cpu = |stage: StageStatistics| if processed > 0 { stage.cpu_ms / processed as f64 } else { 0.0 };
        let mut latency_ms = by_stage(|name| stage(name).latency_ms);
        latency_ms.insert("end_to_end".to_owned(), statistics.end_to_end_ms);
        let accuracy = |rows: &Rows| groundtruth.and_then(|truth| accuracy(rows, truth));
        Self {
            version: env!("CARGO_PKG_VERSION"),
            source: settings.run.source.clone(),
            ended: statistics.ended,
            verdict: verdict(&facts),
            final_optimisation: replay.is_finally_optimised,
            frames_read: facts.n_read,
            frames_processed: processed,
            frames_dropped: facts.n_dropped,
            frames_missing: facts.n_missing,
            frames_untracked: replay.n_untracked(),
            untracked: facts.untracked.iter().map(|span| [span.first, span.last]).collect(),
            frames_broken: facts.broken.len() as u64,
            frames_at_workload: replay.n_at_workload(),
            keyframes: replay.keyframes.len() as u64,
            map_keyframes: replay.n_map_keyframes as u64,
            first_tracked: replay.first_tracked,
            submaps: facts.n_submaps,
            submaps_joined: facts.n_submaps.saturating_sub(u64::from(replay.submaps().n_components())),
            submaps_apart: facts.apart.len() as u64,
            frames_apart: facts.apart.values().sum(),
            loops_found: replay.n_loops_found(),
            loops_closed: replay.n_loops_closed(),
            loops_rejected: replay.n_loops_rejected(),
            global_optimisations: replay.n_corrections,
            corrections_from_base: beside.n_from_base,
            restarts: by_stage(|name| stage(name).restarts),
            latency_ms,
            cpu_ms_per_frame: by_stage(|name| cpu(stage(name))),
            peak_rss_mb: by_stage(|name| stage(name).peak_rss_mb),
            shared_memory_mb: statistics.shared_memory_mb,
            wall_s: statistics.wall_s,
            of_final: accuracy(&final_rows(replay)),
            of_online: groundtruth
                .and_then(|truth| accuracy_by_gauge(&online_rows(replay), replay.online_gauges(), truth)),
            colour: ColourSummary::new(&replay.colour(beside.stated_colour)),
            repeated_colour: replay.frames.iter().filter(|frame| frame.evidence.repeats_colour).count()
                as u64,
            noise: NoiseSummary::new(replay.frames.iter().filter_map(|frame| frame.evidence.noise.as_ref())),
            focal: focal(&facts).map(|found| FocalSummary {
                stated_px: beside.focal_px,
                likely_px: found.ratio * beside.focal_px,
                deviation_px: found.sigma * beside.focal_px,
                sigmas: found.sigmas,
                is_doubted: found.is_wrong,
                by: found.sources,
            }),
            refinement: settings
                .mapping
                .global
                .refine_camera
                .then(|| RefinementSummary::new(replay.refinement.as_ref())),
        }
    }

    /// Adds the errors of the run as its own camera saw it, beside those of the refined one.
    pub fn compare_with(&mut self, as_mapped: &Replay, groundtruth: Option<&Trajectory>) {
        if let Some(RefinementSummary::Refined { final_before, .. }) = &mut self.refinement {
            *final_before = groundtruth.and_then(|truth| accuracy(&final_rows(as_mapped), truth));
        }
    }

    /// Whether the run started in a map and no frame of it was found there.
    pub fn is_nowhere(&self) -> bool {
        self.map_keyframes > 0 && self.first_tracked.is_none()
    }

    /// Writes `summary.json`.
    pub fn write(&self, folder: &Path) -> Result<(), ToolError> {
        let json = self.to_json()?;
        write_file(&folder.join("summary.json"), |writer| writeln!(writer, "{json}"))
    }

    /// The summary as JSON.
    pub fn to_json(&self) -> Result<String, ToolError> {
        serde_json::to_string_pretty(self).map_err(|error| ToolError::Stage(error.to_string()))
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
}

fn by_stage<T>(value: impl Fn(&str) -> T) -> BTreeMap<String, T> {
    STAGES.iter().map(|name| ((*name).to_owned(), value(name))).collect()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::test_run;
    use crate::trajectories::as_trajectory;

    pub(crate) fn summary() -> Summary {
        let replay = test_run::replay();
        let truth = as_trajectory(&online_rows(&replay)).unwrap();
        let stage = StageStatistics { restarts: 1, cpu_ms: 30.0, ..StageStatistics::default() };
        let statistics = RunStatistics {
            stages: [("align".to_owned(), stage)].into(),
            ended: Ended::Interrupted,
            wall_s: 2.0,
            ..RunStatistics::default()
        };
        Summary::new(&Settings::default(), &replay, &statistics, Some(&truth), &Beside::default())
    }

    #[test]
    fn the_json_has_the_fields_that_scripts_read() {
        let json: serde_json::Value = serde_json::from_str(&summary().to_json().unwrap()).unwrap();
        let numbers = [
            ("frames_read", 7),
            ("frames_processed", 6),
            ("frames_dropped", 1),
            ("frames_missing", 0),
            ("frames_untracked", 1),
            ("keyframes", 3),
            ("loops_closed", 1),
            ("global_optimisations", 1),
            ("submaps", 1),
            ("submaps_joined", 0),
            ("submaps_apart", 0),
            ("frames_apart", 0),
        ];
        for (key, expected) in numbers {
            assert_eq!(json[key], expected, "{key}");
        }
        assert_eq!((&json["verdict"]["grade"], &json["untracked"][0][1]), (&"doubtful".into(), &4.into()));
        let reason = &json["verdict"]["reasons"][0];
        assert!(reason["found"].as_str().unwrap().contains("not finished") && reason["advice"].is_string());
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
}
