//! `tessera record`: the exact input of one stage, in a file.

use crate::arguments::{RecordArguments, RunArguments};
use crate::commands::run::settings;
use crate::exit::{CommandError, Exit};
use crate::progress::work_bar;
use crate::terminal::say_to_people;
use tessera_lab::profile::{self, Stages};

/// Records a source.
pub(crate) fn record(arguments: &RecordArguments) -> Result<Exit, CommandError> {
    let stage = Stages::named(&arguments.stage)?;
    let settings = settings(&RunArguments {
        sources: vec![arguments.source.clone()],
        camera: arguments.camera.clone(),
        config: arguments.config.clone(),
        overrides: arguments.overrides.clone(),
        skip: arguments.skip,
        frames: arguments.frames,
        ..RunArguments::default()
    })?;
    let (spec, options) = settings.source();
    let source = tessera_sources::open(&spec, &options)?;
    let Some(n_frames) = source.n_frames() else {
        return Err(CommandError::arguments(format!("{spec} has no end, expected --frames N")));
    };
    let bar = work_bar(arguments.quiet, Some(n_frames), "{bar:20} {pos}/{len} frames, {eta} left");
    let bytes = profile::record(&*source, &settings, stage, &arguments.out, &mut || bar.inc(1));
    bar.finish_and_clear();
    let megabytes = bytes? as f64 / f64::from(1 << 20);
    if !arguments.quiet {
        let out = arguments.out.display();
        say_to_people(&format!("{out}: the input of {stage} over {n_frames} frames, {megabytes:.1} MB"));
    }
    Ok(Exit::Done)
}
