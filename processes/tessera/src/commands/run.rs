//! `tessera run`: the four processes from the first frame to the outputs.

use crate::arguments::RunArguments;
use crate::exit::{CommandError, Exit};
use crate::outputs;
use crate::supervisor::{Outcome, Plan, supervise};
use std::path::PathBuf;
use tessera_messages::Stage;
use tessera_settings::Settings;
use tessera_sources::{SourceOptions, SourceSpec};

/// Kill points of the first life of each stage, for tests: `align=stored:12,journaled:40;sensor=…`.
const KILL_PLAN_VARIABLE: &str = "TESSERA_KILL_PLAN";

/// Runs a source to its end.
pub(crate) fn run(arguments: &RunArguments) -> Result<Exit, CommandError> {
    let mut settings = Settings::load(arguments.config.as_deref(), &arguments.overrides)?;
    let run = &mut settings.run;
    if let Some(source) = &arguments.source {
        run.source = source.clone();
    }
    if let Some(camera) = &arguments.camera {
        run.camera = camera.clone();
    }
    run.frames = arguments.frames.unwrap_or(run.frames);
    run.forget_every = arguments.forget_every.unwrap_or(run.forget_every);
    run.live |= arguments.live;
    let spec = SourceSpec::parse(&run.source);
    run.source = spec.to_string();
    let options = SourceOptions {
        camera: (!run.camera.is_empty()).then(|| run.camera.clone()),
        frames: (run.frames > 0).then_some(run.frames),
        ..SourceOptions::default()
    };
    let source = tessera_sources::open(&spec, &options).map_err(|e| CommandError::Input(e.to_string()))?;
    let name = arguments.name.clone().unwrap_or_else(|| format!("run-{}", std::process::id()));
    let run_dir = arguments.out.clone().unwrap_or_else(|| PathBuf::from("runs").join(&name));
    let plan = Plan {
        name,
        run_dir: run_dir.clone(),
        settings,
        camera: source.camera().clone(),
        n_frames: source.n_frames(),
        resume: false,
        executable: std::env::current_exe().map_err(|e| CommandError::Stage(e.to_string()))?,
        kill_points: kill_plan(),
    };
    let supervised = supervise(&plan, &mut |progress| {
        if !arguments.speech.quiet {
            eprintln!(
                "{} of {:?} frames, {} keyframes, {} loops",
                progress.frames, progress.n_frames, progress.keyframes, progress.loops
            );
        }
    })
    .map_err(|e| CommandError::Stage(e.to_string()))?;
    if !arguments.speech.quiet {
        eprintln!("{supervised:#?}");
    }
    outputs::export(&run_dir, &run_dir)?;
    match supervised.outcome {
        Outcome::Finished => Ok(Exit::Done),
        Outcome::Interrupted => Ok(Exit::Interrupted),
        Outcome::Failed(failure) => Err(CommandError::Stage(failure.to_string())),
    }
}

fn kill_plan() -> Vec<(Stage, String)> {
    let text = std::env::var(KILL_PLAN_VARIABLE).unwrap_or_default();
    text.split(';')
        .filter_map(|part| {
            let (stage, points) = part.split_once('=')?;
            Some((Stage::from_name(stage)?, points.to_string()))
        })
        .collect()
}
