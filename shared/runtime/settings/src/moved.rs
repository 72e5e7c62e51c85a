//! Keys of earlier versions, and where each went.

use crate::experiment;
use crate::known::join;
use toml::de::DeValue;
use toml::{Table, Value};

/// The answer to a key that no longer is one, with its full path: for `given` itself, or for the first
/// key in it where it is a table.
pub(crate) fn first(path: &str, given: &DeValue<'_>) -> Option<(String, String)> {
    let inside = match given {
        DeValue::Table(inner) => {
            inner.iter().find_map(|(key, value)| first(&join(path, key.get_ref()), value.get_ref()))
        }
        _ => None,
    };
    inside.or_else(|| Some((path.to_owned(), answer(path)?)))
}

/// Takes out what was removed, with the tables that are empty then.
pub(crate) fn remove(table: &mut Table, prefix: &str) {
    table.retain(|key, value| {
        let path = join(prefix, key);
        let is_removed = REMOVED.iter().any(|(old, _)| *old == path);
        let is_emptied = match value {
            Value::Table(inner) if !inner.is_empty() => {
                remove(inner, &path);
                inner.is_empty()
            }
            _ => false,
        };
        !is_removed && !is_emptied
    });
}

/// Where the key went.
fn answer(key: &str) -> Option<String> {
    if let Some(now) = experiment::path_in_file(key) {
        return Some(format!("now {now}"));
    }
    if let Some((_, now)) = RENAMED.iter().find(|(old, _)| *old == key) {
        return Some(format!("now {now}"));
    }
    let (_, reason) = REMOVED.iter().find(|(old, _)| *old == key)?;
    Some(format!("removed; {reason}"))
}

/// Keys with another name.
const RENAMED: [(&str, &str); 14] = [
    ("registration.search.method", "experiment.registration.search"),
    ("flow.ladder", "flow.load_shedding"),
    ("stages.sensor.restart", "stages.restart, for all stages"),
    ("stages.reconstruct.restart", "stages.restart, for all stages"),
    ("stages.align.restart", "stages.restart, for all stages"),
    ("stages.optimise.restart", "stages.restart, for all stages"),
    ("stages.sensor.threads", "stages.threads, for each stage"),
    ("stages.reconstruct.threads", "stages.threads, for each stage"),
    ("stages.align.threads", "stages.threads, for each stage"),
    ("stages.optimise.threads", "stages.threads, for each stage"),
    ("stages.sensor.memory_mb", "stages.memory_mb, for each stage"),
    ("stages.reconstruct.memory_mb", "stages.memory_mb, for each stage"),
    ("stages.align.memory_mb", "stages.memory_mb, for each stage"),
    ("stages.optimise.memory_mb", "stages.memory_mb, for each stage"),
];

const CORES: &str = "use CPUAffinity= in its unit of systemd, or `taskset`";
const NICE: &str = "use Nice= in its unit of systemd, or `nice`";
const FIFO: &str = "use CPUSchedulingPolicy= in its unit of systemd, or `chrt`";
const LOCK: &str = "stages lock no memory";
const RESTARTS: &str = "use StartLimitBurst= in its unit of systemd";
const FEATURES: &str = "features hold what shape leaves open, see mapping.features";
const WITHIN: &str = "use StartLimitIntervalSec= in its unit of systemd";

/// Keys that are gone, each with what holds now.
#[rustfmt::skip]
const REMOVED: [(&str, &str); 100] = [
    ("simulation.noise", "simulation.sensor = \"exact\" is without"),
    ("simulation.disparity_sigma_px", "it is 0.0625 now"),
    ("simulation.lateral_sigma_px", "it is 0.5 now"),
    ("simulation.colour_lag_s", "it is 0 now"),
    ("simulation.imu_noise_rad_per_s_sqrt_hz", "it is 0.000175 now"),
    ("simulation.imu_bias_sigma_rad_per_s", "it is 0.009 now"),
    ("simulation.distortion", "give a camera file by --camera"),
    ("surface.noise", "it is the paper's model now"),
    ("surface.edge_angle_deg", "it is 12.5 now"),
    ("surface.length_rule", "it is linear now"),
    ("surface.filter_passes", "it is 1 now"),
    ("surface.filter_position", "it is 1 now"),
    ("surface.filter_normal", "it is 1 now"),
    ("surface.filter_intensity", "it is 1 now"),
    ("surface.filter_include_self", "it is true now"),
    ("surface.cell_brightness", FEATURES),
    ("registration.weight.brightness", FEATURES),
    ("registration.weight.brightness_sigma", FEATURES),
    ("surface.min_view_cosine", "it is 0.15 now"),
    ("registration.max_sample_depth_m", "it is 5 now"),
    ("registration.inner_iterations", "it is 10 now"),
    ("registration.search.first_stride", "it is 1 now"),
    ("registration.search.first_reach", "it is 4 now"),
    ("registration.search.last_reach", "it is 2 now"),
    ("registration.search.first_normal_cosine", "it is 0.707 now"),
    ("registration.search.last_normal_cosine", "it is 0.866 now"),
    ("registration.search.one_to_one", "it is true now"),
    ("registration.search.median_factor", "it is 3 now"),
    ("mapping.window.radius_m", "it is 0.3 now"),
    ("mapping.window.angle_deg", "it is 30 now"),
    ("mapping.window.match_budget", "it is 4000 now"),
    ("mapping.window.early_share", "it is 0.3 now"),
    ("mapping.window.retry_iterations", "it is 10 now"),
    ("mapping.window.converged_step", "it is 0.0002 now"),
    ("mapping.window.prior_translation_m", "it is estimated now"),
    ("mapping.window.prior_rotation_deg", "it is estimated now"),
    ("mapping.window.inertial_floor_deg", "it is 0.2 now"),
    ("mapping.window.min_match_share", "it is 0.15 now"),
    ("mapping.window.max_residual_sigmas", "it is 3 now"),
    ("mapping.window.min_matched", "it is 0.3 now"),
    ("mapping.window.max_in_front", "it is 0.4 now"),
    ("mapping.window.free_translation_m", "it is 0.0015 now"),
    ("mapping.window.free_rotation_deg", "it is 0.1 now"),
    ("mapping.window.free_ratio", "it is 10 now"),
    ("mapping.window.correlation", "noise scales are estimated now"),
    ("mapping.features.weight", "noise scales are estimated now"),
    ("mapping.features.keyframe_weight", "noise scales are estimated now"),
    ("mapping.window.long_strides", "relocalisation finds what fits nowhere about the last pose"),
    ("experiment.mapping.window.long_strides", "relocalisation finds what fits nowhere about the last pose"),
    ("mapping.window.inertial_rotation", "the gyroscope is used where the source has one"),
    ("mapping.keyframe.min_frames", "it is 3 now"),
    ("mapping.loop.min_seconds", "mapping.loop.min_frames alone decides"),
    ("mapping.loop.min_keyframes", "it is 5 now"),
    ("mapping.loop.conflict_translation_m", "the newest keyframes are solved for with each new one"),
    ("mapping.loop.conflict_rotation_deg", "the newest keyframes are solved for with each new one"),
    ("mapping.loop.extended_window", "the newest keyframes are solved for with each new one"),
    ("mapping.loop.delay_per_keyframe", "it is 0.5 now"),
    ("mapping.relocalise.n_recognised", "it is 3 now"),
    ("mapping.relocalise.n_turned", "views turned about the last pose found no place that others did not"),
    ("mapping.relocalise.min_in_view", "it is 0.3 now"),
    ("mapping.relocalise.min_matched", "it is 0.5 now"),
    ("mapping.relocalise.max_in_front", "it is 0.1 now"),
    ("mapping.relocalise.max_residual_sigmas", "it is 0.7 now"),
    ("mapping.relocalise.confirm_frames", "it is 3 now"),
    ("mapping.global.radius_m", "it is 1.5 now"),
    ("mapping.global.angle_deg", "it is 45 now"),
    ("mapping.global.neighbours", "it is 12 now"),
    ("mapping.global.queries_per_pair", "it is 150 now"),
    ("mapping.global.outer_iterations", "it is 2 now"),
    ("mapping.global.final_iterations", "it is 2 now"),
    ("mapping.global.first_distance_m", "it is 0.15 now"),
    ("mapping.global.min_overlap", "it is 0.2 now"),
    ("mapping.global.max_in_front", "it is 0.2 now"),
    ("mapping.global.max_inconsistency_sigmas", "it is 1.5 now"),
    ("mapping.global.loop_residual_sigmas", "it is 1 now"),
    ("flow.ahead", "the sensor decodes as many frames ahead as flow.window says"),
    ("stages.sensor.restarts", RESTARTS),
    ("stages.sensor.restarts_within_s", WITHIN),
    ("stages.sensor.cores", CORES),
    ("stages.sensor.nice", NICE),
    ("stages.sensor.fifo", FIFO),
    ("stages.sensor.lock_memory", LOCK),
    ("stages.reconstruct.restarts", RESTARTS),
    ("stages.reconstruct.restarts_within_s", WITHIN),
    ("stages.reconstruct.cores", CORES),
    ("stages.reconstruct.nice", NICE),
    ("stages.reconstruct.fifo", FIFO),
    ("stages.reconstruct.lock_memory", LOCK),
    ("stages.align.restarts", RESTARTS),
    ("stages.align.restarts_within_s", WITHIN),
    ("stages.align.cores", CORES),
    ("stages.align.nice", NICE),
    ("stages.align.fifo", FIFO),
    ("stages.align.lock_memory", LOCK),
    ("stages.optimise.restarts", RESTARTS),
    ("stages.optimise.restarts_within_s", WITHIN),
    ("stages.optimise.cores", CORES),
    ("stages.optimise.nice", NICE),
    ("stages.optimise.fifo", FIFO),
    ("stages.optimise.lock_memory", LOCK),
];
