//! `tessera resume`: a run that was interrupted or killed goes on to its end.

use crate::arguments::{ResumeArguments, Speech};
use crate::exit::{CommandError, Exit};
use crate::launch::{kill_plan, launch};
use crate::run_folder;
use crate::terminal::say;
use std::path::Path;
use tessera_numerics::Isa;
use tessera_outputs::Ended;
use tessera_settings::Settings;
use tessera_sources::SourceSpec;
use tessera_stage::{RunFile, RunFiles};
use tessera_supervisor::Plan;

/// Goes on with a run as it was begun: same name, camera and settings.
pub(crate) fn resume(arguments: &ResumeArguments) -> Result<Exit, CommandError> {
    let how =
        Resumption { drop_damaged: arguments.drop_damaged, faults: arguments.faults.as_deref(), hold: false };
    resume_in(&run_folder::find(&arguments.run)?, arguments.speech, how)
}

/// How a run goes on.
pub(crate) struct Resumption<'a> {
    /// The stages are started from outside.
    pub(crate) hold: bool,
    /// Goes on without what lies behind damage.
    pub(crate) drop_damaged: bool,
    /// Faults on purpose.
    pub(crate) faults: Option<&'a str>,
}

/// Goes on with the run of a folder.
pub(crate) fn resume_in(run_dir: &Path, speech: Speech, how: Resumption<'_>) -> Result<Exit, CommandError> {
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
    let before = tessera_outputs::read_statistics(run_dir)?;
    if before.ended == Ended::Finished && !speech.quiet && !speech.json {
        say(&format!("{} had finished: what it recorded is read, its outputs are written again", run.name));
    }
    let plan = Plan {
        name: run.name,
        run_dir: run_dir.to_owned(),
        settings,
        camera: run.camera,
        stamp_sigma_s: run.stamp_sigma_s,
        n_frames: run.n_frames,
        fps: run.fps,
        doubts: run.doubts,
        warnings: run.warnings,
        hold: how.hold,
        resume: true,
        drop_damaged: how.drop_damaged,
        executable: std::env::current_exe()
            .map_err(|error| CommandError::stage(format!("cannot find the own program: {error}")))?,
        kill_points: how.faults.map(kill_plan),
        is_traced: false,
    };
    launch(&plan, None, source.as_ref().and_then(|source| source.ground_truth()), speech, &mut || ())
}
