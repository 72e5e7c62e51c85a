//! `tessera resume`: a run that was interrupted or killed goes on to its end.

use crate::arguments::{ResumeArguments, Speech};
use crate::exit::{CommandError, Exit};
use crate::launch::{kill_plan, launch};
use crate::run_folder;
use std::path::Path;
use tessera_numerics::Isa;
use tessera_settings::Settings;
use tessera_sources::SourceSpec;
use tessera_stage::{RunFile, RunFiles};
use tessera_supervisor::Plan;

/// Goes on with a run as it was begun: same name, camera and settings.
pub(crate) fn resume(arguments: &ResumeArguments) -> Result<Exit, CommandError> {
    resume_in(&run_folder::find(&arguments.run)?, arguments.speech, false)
}

/// Goes on with the run of a folder; with `hold` the stages are started from outside.
pub(crate) fn resume_in(run_dir: &Path, speech: Speech, hold: bool) -> Result<Exit, CommandError> {
    let files = RunFiles::new(run_dir);
    let run = RunFile::read(&files)?;
    let config = files.config();
    let text = std::fs::read_to_string(&config)
        .map_err(|error| CommandError::input(format!("{}: {error}", config.display())))?;
    let mut settings = Settings::from_toml(&text, &config.display().to_string())?;
    // The same bits on every set: a run that began on another kind of machine goes on with this
    // one's.
    settings.set_isa(settings.run.isa.resolve().unwrap_or(Isa::of_machine()));
    let (spec, mut options) = settings.source();
    options.fps = run.fps;
    // Opened here too, so that a source that went away is told before anything starts.
    let source = match spec {
        // The sensor waits for it.
        SourceSpec::External => None,
        _ => Some(tessera_sources::open(&spec, &options)?),
    };
    let plan = Plan {
        name: run.name,
        run_dir: run_dir.to_owned(),
        settings,
        camera: run.camera,
        n_frames: run.n_frames,
        fps: run.fps,
        doubts: run.doubts,
        warnings: run.warnings,
        hold,
        resume: true,
        executable: std::env::current_exe()
            .map_err(|error| CommandError::stage(format!("cannot find the own program: {error}")))?,
        kill_points: kill_plan(),
        is_traced: false,
    };
    Ok(launch(&plan, None, source.as_ref().and_then(|source| source.ground_truth()), speech, &mut || ())?)
}
