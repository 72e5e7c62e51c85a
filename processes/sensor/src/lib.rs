//! The sensor stage: frames are read or decoded straight into shared memory and sent on.
//!
//! One loop (`sending.rs`) with a pace, lossless or live, and a supply, a source that is read or a
//! camera's own program. It keeps nothing but the next index: a recorded frame can be read again
//! at any time, so after a restart it waits for the aligner's flow message and goes on from there.
#![forbid(unsafe_code)]

mod external;
mod frame;
mod send;
mod sending;
mod source;

use sending::{Pace, Supply, send_frames};
use std::process::ExitCode;
use tessera_messages::{Flow, FrameHeader, Stage};
use tessera_stage::{Outcome, Pulse, StageArgs, StageContext, StageError, stage_main};
use tessera_transport::{Listener, Notifier, SlicePublisher, Subscriber};

/// Runs the stage as a process.
pub fn main(args: &StageArgs) -> ExitCode {
    stage_main(Stage::Sensor, || run(args))
}

/// All connections of the sensor.
struct SensorPorts {
    listener: Listener,
    frames: SlicePublisher<FrameHeader, u16>,
    flow: Subscriber<Flow>,
    reconstruct: Notifier,
    pulse: Pulse,
}

/// Runs the stage until the run is finished or it is told to stop.
///
/// # Errors
/// Where the source, the run directory or the shared memory cannot be used.
pub fn run(args: &StageArgs) -> Result<Outcome, StageError> {
    let context = StageContext::open(Stage::Sensor, args)?;
    let source = if context.settings.is_external() { None } else { Some(source::open(&context)?) };
    let link = context.link(Stage::Sensor)?;
    let mut ports = SensorPorts {
        listener: link.listener(Stage::Sensor)?,
        frames: link.frame_publisher()?,
        flow: link.flow_subscriber()?,
        reconstruct: link.notifier(Stage::Reconstruct)?,
        pulse: Pulse::start(&link, Stage::Sensor, &context)?,
    };
    context.kill_points.pass("opened", 0);
    ports.pulse.ready(None);
    let mut supply: Box<dyn Supply + '_> = match &source {
        None => external::supply(&context, &link)?,
        Some(source) => source::supply(&context, &**source, &mut ports),
    };
    let is_live = context.settings.run.live;
    let pace = if is_live { Pace::Live } else { Pace::Window(u64::from(context.layout.window)) };
    let outcome = send_frames(&context, &mut ports, pace, &mut *supply);
    ports.pulse.finish();
    outcome
}
