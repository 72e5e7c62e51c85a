//! Settings of tracking, keyframes, loops and the global optimisation.

use serde::{Deserialize, Serialize};
use tessera_surface::{SettingError, check_range};

/// The local window and its alignment (SPEC 5.1, 6).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WindowSettings {
    /// Fixed reference poses `w`, 1 to 10.
    pub size: u32,
    /// Keyframes farther away take no part, metres.
    pub radius_m: f64,
    /// Keyframes looking elsewhere take no part, degrees between optical axes.
    pub angle_deg: f64,
    /// Correspondences sought per frame, split evenly over the window.
    pub match_budget: u32,
    /// Share of the correspondences sought in all but the last outer iteration.
    pub early_share: f64,
    /// Outer iterations while tracking.
    pub outer_iterations: u32,
    /// Outer iterations of the second attempt, after a failure.
    pub retry_iterations: u32,
    /// Bounds of the first distance limit while tracking, metres.
    pub min_first_distance_m: f64,
    /// Upper bound of the first distance limit while tracking, metres.
    pub max_first_distance_m: f64,
    /// An outer iteration that moves less than this is the last but one, metres (and radians).
    pub converged_step: f64,
    /// Standard deviation of the constant velocity prediction, metres per frame.
    pub prior_translation_m: f64,
    /// Standard deviation of the constant velocity prediction, degrees per frame.
    pub prior_rotation_deg: f64,
    /// Whether the rotation of the prediction is the gyroscope's where the source has one.
    pub inertial_rotation: bool,
    /// Standard deviation that the last pose's rotation adds to the gyroscope's, degrees.
    pub inertial_floor_deg: f64,
    /// Whether shifts and turns about the last pose are tried where the other attempts fail.
    pub long_strides: bool,
    /// Least share of queries with a match.
    pub min_match_share: f64,
    /// Largest median normal residual, standard deviations of depth.
    pub max_residual_sigmas: f64,
    /// Least share with a match of what the best reference sees of the frame.
    pub min_matched: f64,
    /// Largest share of that in front of what the reference saw.
    pub max_in_front: f64,
    /// A translation is free when its matches claim a larger standard deviation, metres, and it
    /// is `free_ratio` times that of the best known translation.
    pub free_translation_m: f64,
    /// A rotation is free when its matches claim a larger standard deviation, degrees, and it is
    /// `free_ratio` times that of the best known rotation.
    pub free_rotation_deg: f64,
    /// See `free_translation_m`.
    pub free_ratio: f64,
    /// Factor of the covariance that independent, unfiltered correspondences would have. Below
    /// one: the filter takes more noise away than correlation brings back.
    pub correlation: f64,
}

impl Default for WindowSettings {
    fn default() -> Self {
        Self {
            size: 5,
            radius_m: 0.3,
            angle_deg: 30.0,
            match_budget: 4000,
            early_share: 0.3,
            outer_iterations: 6,
            retry_iterations: 10,
            min_first_distance_m: 0.1,
            max_first_distance_m: 0.5,
            converged_step: 2e-4,
            prior_translation_m: 0.05,
            prior_rotation_deg: 3.0,
            inertial_rotation: true,
            inertial_floor_deg: 0.2,
            long_strides: true,
            min_match_share: 0.15,
            max_residual_sigmas: 3.0,
            min_matched: 0.3,
            max_in_front: 0.4,
            free_translation_m: 0.0015,
            free_rotation_deg: 0.1,
            free_ratio: 10.0,
            correlation: 0.07,
        }
    }
}

/// When a frame becomes a keyframe (SPEC 9).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct KeyframeSettings {
    /// Distance from the last keyframe, metres.
    pub translation_m: f64,
    /// Rotation from the last keyframe, degrees.
    pub rotation_deg: f64,
    /// Gain of entropy over the keyframe's reference, nats; 0 switches the test off.
    pub entropy_gain_nats: f64,
    /// Ratio of entropies below which a keyframe is made (eq. 15); 0 switches the test off.
    pub entropy_ratio: f64,
    /// Frames after a keyframe before the entropy tests may trigger.
    pub min_frames: u32,
    /// Keyframes of the working map at most; 0: no limit. Those beyond it move along with their
    /// neighbours; nothing is aligned to them any more, and frames are not solved again at the end.
    pub budget: u32,
}

impl Default for KeyframeSettings {
    fn default() -> Self {
        Self {
            translation_m: 0.1,
            rotation_deg: 6.0,
            entropy_gain_nats: 4.0,
            entropy_ratio: 0.0,
            min_frames: 3,
            budget: 0,
        }
    }
}

/// When a loop is a loop, and when it asks for an optimisation (SPEC 7).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LoopSettings {
    /// Least difference of frame indices.
    pub min_frames: u64,
    /// Least difference of stamps, seconds.
    pub min_seconds: f64,
    /// Least number of keyframes between.
    pub min_keyframes: u32,
    /// A jump by the old poses beyond this is a conflict, metres.
    pub conflict_translation_m: f64,
    /// A jump by the old poses beyond this is a conflict, degrees.
    pub conflict_rotation_deg: f64,
    /// Whether a conflict is settled at once between the frame and the keyframes of its window.
    pub extended_window: bool,
    /// Keyframes between two requests, at least.
    pub request_interval: u32,
    /// Frames between a request and its effect: `delay_frames + keyframes * delay_per_keyframe`.
    pub delay_frames: u32,
    /// See `delay_frames`.
    pub delay_per_keyframe: f64,
    /// Keyframes that look more alike than this are tried as a loop wherever they lie, 0 to 1.
    pub min_similarity: f64,
}

impl Default for LoopSettings {
    fn default() -> Self {
        Self {
            min_frames: 150,
            min_seconds: 5.0,
            min_keyframes: 5,
            conflict_translation_m: 0.05,
            conflict_rotation_deg: 3.0,
            extended_window: true,
            request_interval: 30,
            delay_frames: 15,
            delay_per_keyframe: 0.5,
            min_similarity: 0.75,
        }
    }
}

/// How a lost camera finds its place again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RelocaliseSettings {
    /// Whether a lost frame's place is looked for at all.
    pub enabled: bool,
    /// Keyframes that look most like the frame and are tried.
    pub n_recognised: u32,
    /// Turned and shifted views that are tried in each frame.
    pub n_turned: u32,
    /// Least share of the frame that the best reference sees.
    pub min_in_view: f64,
    /// Least share of that part that has a match.
    pub min_matched: f64,
    /// Largest share of that part that floats in front of what the reference saw.
    pub max_in_front: f64,
    /// Largest median normal residual, standard deviations of depth.
    pub max_residual_sigmas: f64,
    /// Frames in a row that must pass after a place was found before the map may change again.
    pub confirm_frames: u32,
}

impl Default for RelocaliseSettings {
    fn default() -> Self {
        Self {
            enabled: true,
            n_recognised: 3,
            n_turned: 6,
            min_in_view: 0.3,
            min_matched: 0.5,
            max_in_front: 0.1,
            max_residual_sigmas: 0.7,
            confirm_frames: 3,
        }
    }
}

impl RelocaliseSettings {
    /// Looser limits, for the first alignment of a candidate.
    pub(crate) fn coarse(&self) -> Self {
        Self {
            min_in_view: 0.8 * self.min_in_view,
            min_matched: 0.7 * self.min_matched,
            max_in_front: 2.0 * self.max_in_front,
            max_residual_sigmas: 1.5 * self.max_residual_sigmas,
            ..self.clone()
        }
    }
}

/// The optimisation of all keyframes (SPEC 8).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GlobalSettings {
    /// Pairs farther apart take no part, metres.
    pub radius_m: f64,
    /// Pairs looking elsewhere take no part, degrees between optical axes.
    pub angle_deg: f64,
    /// Neighbours of a keyframe, half of them nearest in pose, half far in index.
    pub neighbours: u32,
    /// Queries of a pair.
    pub queries_per_pair: u32,
    /// Outer iterations of a request during the run.
    pub outer_iterations: u32,
    /// Outer iterations of the final request.
    pub final_iterations: u32,
    /// First distance limit, metres.
    pub first_distance_m: f64,
    /// Least share of queries with a match for a pair to count.
    pub min_overlap: f64,
    /// Largest share of queries in front of what the other keyframe of a loop pair saw.
    pub max_in_front: f64,
    /// Largest disagreement between both directions of a loop pair, standard deviations of depth.
    pub max_inconsistency_sigmas: f64,
    /// A loop pair that disagrees with the graph by more loses its weight, standard deviations of
    /// depth; 0 switches this off.
    pub loop_residual_sigmas: f64,
    /// The final request solves for the camera too. What was tracked and mapped stays as it is;
    /// the outputs are those of the refined camera.
    pub refine_camera: bool,
}

impl Default for GlobalSettings {
    fn default() -> Self {
        Self {
            radius_m: 1.5,
            angle_deg: 45.0,
            neighbours: 12,
            queries_per_pair: 150,
            outer_iterations: 2,
            final_iterations: 4,
            first_distance_m: 0.15,
            min_overlap: 0.2,
            max_in_front: 0.2,
            max_inconsistency_sigmas: 1.5,
            loop_residual_sigmas: 1.0,
            refine_camera: false,
        }
    }
}

/// All settings of mapping.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MappingSettings {
    /// The local window.
    pub window: WindowSettings,
    /// Keyframes.
    pub keyframe: KeyframeSettings,
    /// Loops.
    #[serde(rename = "loop")]
    pub loops: LoopSettings,
    /// Lost and found.
    pub relocalise: RelocaliseSettings,
    /// Global optimisation.
    pub global: GlobalSettings,
}

impl MappingSettings {
    /// Checks every range, NaN included.
    ///
    /// # Errors
    /// Names the first key that is out of range, its value and the rule.
    pub fn check(&self) -> Result<(), SettingError> {
        let w = &self.window;
        check_range("window.size", w.size.into(), 1.0, 10.0)?;
        check_range("window.radius_m", w.radius_m, 0.0, 100.0)?;
        check_range("window.angle_deg", w.angle_deg, 0.0, 180.0)?;
        check_range("window.match_budget", w.match_budget.into(), 50.0, 1e6)?;
        check_range("window.early_share", w.early_share, 0.01, 1.0)?;
        check_range("window.outer_iterations", w.outer_iterations.into(), 2.0, 100.0)?;
        check_range("window.retry_iterations", w.retry_iterations.into(), 2.0, 100.0)?;
        check_range("window.min_first_distance_m", w.min_first_distance_m, 0.001, 10.0)?;
        check_range("window.max_first_distance_m", w.max_first_distance_m, w.min_first_distance_m, 10.0)?;
        check_range("window.converged_step", w.converged_step, 0.0, 0.1)?;
        check_range("window.prior_translation_m", w.prior_translation_m, 1e-4, 1e3)?;
        check_range("window.prior_rotation_deg", w.prior_rotation_deg, 1e-3, 1e3)?;
        check_range("window.inertial_floor_deg", w.inertial_floor_deg, 1e-3, 1e3)?;
        check_range("window.min_match_share", w.min_match_share, 0.0, 1.0)?;
        check_range("window.max_residual_sigmas", w.max_residual_sigmas, 0.1, 1e3)?;
        check_range("window.min_matched", w.min_matched, 0.0, 1.0)?;
        check_range("window.max_in_front", w.max_in_front, 0.0, 1.0)?;
        check_range("window.free_translation_m", w.free_translation_m, 1e-4, 1e3)?;
        check_range("window.free_rotation_deg", w.free_rotation_deg, 1e-2, 1e3)?;
        check_range("window.free_ratio", w.free_ratio, 1.0, 1e6)?;
        check_range("window.correlation", w.correlation, 1e-3, 1e6)?;
        let k = &self.keyframe;
        check_range("keyframe.translation_m", k.translation_m, 0.001, 10.0)?;
        check_range("keyframe.rotation_deg", k.rotation_deg, 0.1, 180.0)?;
        check_range("keyframe.entropy_gain_nats", k.entropy_gain_nats, 0.0, 1e3)?;
        check_range("keyframe.entropy_ratio", k.entropy_ratio, 0.0, 1.0)?;
        check_range("keyframe.min_frames", k.min_frames.into(), 1.0, 1e6)?;
        if k.budget != 0 {
            check_range("keyframe.budget", k.budget.into(), 10.0, 2000.0)?;
        }
        let l = &self.loops;
        check_range("loop.min_frames", l.min_frames as f64, 1.0, 1e9)?;
        check_range("loop.min_seconds", l.min_seconds, 0.0, 1e6)?;
        check_range("loop.min_keyframes", l.min_keyframes.into(), 0.0, 1e6)?;
        check_range("loop.conflict_translation_m", l.conflict_translation_m, 0.0, 100.0)?;
        check_range("loop.conflict_rotation_deg", l.conflict_rotation_deg, 0.0, 180.0)?;
        check_range("loop.request_interval", l.request_interval.into(), 1.0, 1e6)?;
        check_range("loop.delay_frames", l.delay_frames.into(), 1.0, 1e6)?;
        check_range("loop.delay_per_keyframe", l.delay_per_keyframe, 0.0, 100.0)?;
        check_range("loop.min_similarity", l.min_similarity, 0.0, 1.0)?;
        let r = &self.relocalise;
        check_range("relocalise.n_recognised", r.n_recognised.into(), 0.0, 1e3)?;
        check_range("relocalise.n_turned", r.n_turned.into(), 0.0, 1e3)?;
        check_range("relocalise.min_in_view", r.min_in_view, 0.0, 1.0)?;
        check_range("relocalise.min_matched", r.min_matched, 0.0, 1.0)?;
        check_range("relocalise.max_in_front", r.max_in_front, 0.0, 1.0)?;
        check_range("relocalise.max_residual_sigmas", r.max_residual_sigmas, 0.0, 1e3)?;
        check_range("relocalise.confirm_frames", r.confirm_frames.into(), 1.0, 1e3)?;
        let g = &self.global;
        check_range("global.radius_m", g.radius_m, 0.0, 100.0)?;
        check_range("global.angle_deg", g.angle_deg, 0.0, 180.0)?;
        check_range("global.neighbours", g.neighbours.into(), 1.0, 1e4)?;
        check_range("global.queries_per_pair", g.queries_per_pair.into(), 20.0, 1e6)?;
        check_range("global.outer_iterations", g.outer_iterations.into(), 1.0, 100.0)?;
        check_range("global.final_iterations", g.final_iterations.into(), 1.0, 100.0)?;
        check_range("global.first_distance_m", g.first_distance_m, 0.001, 10.0)?;
        check_range("global.min_overlap", g.min_overlap, 0.0, 1.0)?;
        check_range("global.max_in_front", g.max_in_front, 0.0, 1.0)?;
        check_range("global.max_inconsistency_sigmas", g.max_inconsistency_sigmas, 0.0, 1e3)?;
        check_range("global.loop_residual_sigmas", g.loop_residual_sigmas, 0.0, 1e3)
    }
}
