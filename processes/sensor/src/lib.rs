//! The sensor stage: frames are read or decoded straight into shared memory and sent on.
//!
//! It keeps nothing but the next index: a recorded frame can be read again at any time, so after
//! a restart it waits for the aligner's word and goes on from there.
#![forbid(unsafe_code)]

mod external;
mod frames;
mod hear;
mod live;
mod lossless;
mod send;

use frames::Frames;
use std::process::ExitCode;
use tessera_messages::{Flow, FrameHeader, Stage};
use tessera_sources::Source;
use tessera_stage::{Context, Outcome, Pulse, StageArgs, StageError, stage_main};
use tessera_transport::{Bell, Ear, SlicePublisher, Subscriber};

/// Runs the stage as a process.
pub fn main(args: &StageArgs) -> ExitCode {
    stage_main(Stage::Sensor, || run(args))
}

/// All connections of the sensor.
struct Ports {
    ear: Ear,
    frames: SlicePublisher<FrameHeader, u16>,
    flow: Subscriber<Flow>,
    reconstruct: Bell,
    pulse: Pulse,
}

/// Runs the stage until the run is finished or it is told to stop.
///
/// # Errors
/// Where the source, the run directory or the shared memory cannot be used.
pub fn run(args: &StageArgs) -> Result<Outcome, StageError> {
    let context = Context::open(Stage::Sensor, args)?;
    let source = if context.settings.is_external() { None } else { Some(open_source(&context)?) };
    let link = context.link(Stage::Sensor)?;
    let mut ports = Ports {
        ear: link.ear(Stage::Sensor)?,
        frames: link.frame_publisher()?,
        flow: link.flow_subscriber()?,
        reconstruct: link.bell(Stage::Reconstruct)?,
        pulse: Pulse::start(&link, Stage::Sensor, &context.stopwatch)?,
    };
    context.kill_points.pass("opened", 0);
    ports.pulse.ready(None);
    let outcome = match &source {
        None => external::work(&context, &link, &mut ports),
        Some(source) => work(&context, &**source, &mut ports),
    };
    ports.pulse.finish();
    outcome
}

/// Reads and sends the frames of a source that can be read at any index.
fn work(context: &Context, source: &dyn Source, ports: &mut Ports) -> Result<Outcome, StageError> {
    let mut frames = Frames::new(source, context);
    if context.settings.run.preload {
        frames.preload(&mut ports.pulse);
    }
    if context.settings.run.live {
        live::work(context, &frames, ports)
    } else {
        lossless::work(context, &frames, ports)
    }
}

/// Opens the source that the settings name, as it was when the run began.
fn open_source(context: &Context) -> Result<Box<dyn Source>, StageError> {
    let (spec, options) = context.settings.source();
    let source = tessera_sources::open(&spec, &options).map_err(|e| StageError::Input(e.to_string()))?;
    if *source.camera() != context.run.camera {
        return Err(StageError::Input(format!(
            "the camera of {} is not the one that the run began with",
            context.settings.run.source
        )));
    }
    Ok(source)
}
