//! Sending a frame.

use crate::SensorPorts;
use crate::frame::{PreparedFrame, is_delivered};
use tessera_messages::{Flow, Kind, Phase};
use tessera_numerics::Step;
use tessera_stage::{StageContext, StageError, monotonic_nanos};

/// Sends a frame and counts it; `due_nanos`: when it was to be sent, 0 without a clock.
pub(crate) fn send(
    context: &StageContext,
    mut frame: PreparedFrame,
    flow: &Flow,
    due_nanos: u64,
    ports: &mut SensorPorts,
) -> Result<(), StageError> {
    let index = frame.index;
    context.kill_points.pass("read", index);
    let decode_nanos = frame.decode_nanos;
    let header = frame.loan.header_mut();
    let read_began = header.times.read_began;
    header.epoch = flow.epoch;
    let is_end = header.kind == Kind::End.to_wire();
    let sent = monotonic_nanos();
    header.times.frame_sent = sent;
    if is_delivered(&context.kill_points, &mut frame) {
        frame.loan.send()?;
        ports.reconstruct.notify();
    }
    context.kill_points.pass("sent", index);
    ports.pulse.output(index);
    ports.pulse.beat.index = index;
    ports.pulse.step(Step::Decode, read_began, decode_nanos);
    ports.pulse.phase(Phase::Computing, decode_nanos);
    ports.pulse.phase(Phase::Publishing, monotonic_nanos().saturating_sub(sent));
    match is_end {
        // It is no frame.
        true => ports.pulse.progress(),
        false => ports.pulse.done(read_began.max(due_nanos), sent),
    }
    Ok(())
}
