//! Frames of a source that can be read at any index: a folder, a recording, the simulation.

mod broken;
mod clocked;
mod frames;
mod live_clock;
mod read_ahead;

use crate::SensorPorts;
use crate::sending::Supply;
use clocked::Clocked;
use frames::Frames;
use read_ahead::ReadAhead;
use tessera_sources::Source;
use tessera_stage::{StageContext, StageError};

/// The source's frames, read ahead of the window or at their own times.
pub(crate) fn supply<'a>(
    context: &StageContext,
    source: &'a dyn Source,
    ports: &mut SensorPorts,
) -> Box<dyn Supply + 'a> {
    let mut frames = Frames::new(source, context);
    if context.settings.run.preload {
        frames.preload(&mut ports.pulse);
    }
    if context.settings.run.live {
        Box::new(Clocked::new(frames))
    } else {
        Box::new(ReadAhead::new(frames, context.layout.ahead as usize))
    }
}

/// Opens the source that the settings name, as it was when the run began.
pub(crate) fn open(context: &StageContext) -> Result<Box<dyn Source>, StageError> {
    let (spec, mut options) = context.settings.source();
    options.fps = context.run.fps;
    let source = tessera_sources::open(&spec, &options).map_err(|e| StageError::Input(e.to_string()))?;
    if *source.camera() != context.run.camera {
        return Err(StageError::Input(format!(
            "the camera of {} is not the one that the run began with",
            context.settings.run.source
        )));
    }
    Ok(source)
}
