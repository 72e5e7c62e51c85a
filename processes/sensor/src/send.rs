//! Handing a frame on.

use crate::Ports;
use crate::frames::{Prepared, deliver};
use tessera_messages::{Flow, Phase};
use tessera_stage::{Context, StageError, monotonic_nanos};
use tessera_steps::Step;

/// Sends a frame, with what a test wants to happen to it; `due_nanos`: when it was to be sent, 0
/// where it has no time of its own.
pub(crate) fn send(
    context: &Context,
    mut frame: Prepared,
    flow: &Flow,
    due_nanos: u64,
    ports: &mut Ports,
) -> Result<(), StageError> {
    let index = frame.index;
    context.kill_points.pass("read", index);
    let decode_nanos = frame.decode_nanos;
    let header = frame.loan.header_mut();
    let read_began = header.times.read_began;
    header.epoch = flow.epoch;
    let sent = monotonic_nanos();
    header.times.frame_sent = sent;
    if deliver(&context.kill_points, &mut frame) {
        frame.loan.send()?;
        ports.reconstruct.ring();
    }
    context.kill_points.pass("sent", index);
    ports.pulse.output(index);
    ports.pulse.beat.index = index;
    ports.pulse.step(Step::Decode, read_began, decode_nanos);
    ports.pulse.phase(Phase::Computing, decode_nanos);
    ports.pulse.phase(Phase::Publishing, monotonic_nanos().saturating_sub(sent));
    ports.pulse.done(read_began.max(due_nanos), sent);
    Ok(())
}
