//! What a fresh run is to be, and where.

use crate::arguments::RunArguments;
use crate::exit::CommandError;
use crate::launch::kill_plan;
use crate::run_folder;
use std::path::{Path, PathBuf};
use tessera_geometry::Camera;
use tessera_settings::Settings;
use tessera_supervisor::Plan;

/// Folder of a run of that name.
pub(super) fn run_dir(arguments: &RunArguments, name: &str) -> PathBuf {
    arguments.out.clone().unwrap_or_else(|| Path::new(run_folder::RUNS).join(name))
}

/// What a fresh run is to be.
pub(super) fn new_plan(
    arguments: &RunArguments,
    settings: &Settings,
    name: &str,
    camera: Camera,
    n_frames: Option<u64>,
) -> Result<Plan, CommandError> {
    Ok(Plan {
        name: name.to_owned(),
        run_dir: run_dir(arguments, name),
        settings: settings.clone(),
        camera,
        stamp_sigma_s: 0.0,
        n_frames,
        fps: arguments.topics.fps,
        doubts: Vec::new(),
        warnings: Vec::new(),
        hold: arguments.hold,
        resume: false,
        drop_damaged: false,
        executable: std::env::current_exe()
            .map_err(|error| CommandError::stage(format!("cannot find the own program: {error}")))?,
        kill_points: arguments.faults.as_deref().map(kill_plan),
        is_traced: arguments.trace.is_some(),
    })
}
