//! Frames from a program that is none of ours: checked, copied once, and sent on.
//!
//! The program stays outside the window and its epochs: what it writes cannot stall or lose a
//! frame of the pipeline, and it may die and come back at any time.

mod camera;
mod live;
mod lossless;
mod session;

use crate::Ports;
use crate::frames::Prepared;
use camera::{Camera, Image};
use tessera_messages::{FrameHeader, Kind};
use tessera_stage::{Context, Outcome, StageError};
use tessera_transport::{Link, Loan};

/// Takes frames from the camera's own program until the run is finished or told to stop.
pub(crate) fn work(context: &Context, link: &Link, ports: &mut Ports) -> Result<Outcome, StageError> {
    let mut camera = Camera::open(context, link)?;
    if context.settings.run.live {
        live::work(context, &mut camera, ports)
    } else {
        lossless::work(context, &mut camera, ports)
    }
}

/// Frames to take at most.
fn most_frames(context: &Context) -> Option<u64> {
    Some(context.settings.run.frames).filter(|frames| *frames > 0)
}

/// The frame as the pipeline knows it: the one copy of the way.
fn copy(image: &Image, index: u64, ports: &Ports, context: &Context) -> Result<Prepared, StageError> {
    let began = tessera_stage::monotonic_nanos();
    let mut loan = loan(index, Kind::Frame, ports, context)?;
    let header = loan.header_mut();
    header.stamp_nanos = image.header.stamp_nanos;
    header.has_colour = image.header.has_colour;
    header.rotation = image.header.rotation;
    header.times.read_began = began;
    let from = image.received.payload();
    let to = loan.payload_mut();
    let len = from.len().min(to.len());
    to[..len].copy_from_slice(&from[..len]);
    // What an earlier frame left behind the depth must not look like this one's colour.
    to[len..].fill(0);
    let decode_nanos = tessera_stage::monotonic_nanos().saturating_sub(began);
    Ok(Prepared { index, loan, decode_nanos })
}

/// The message that says that there are so many frames.
fn end(n_frames: u64, ports: &Ports, context: &Context) -> Result<Prepared, StageError> {
    Ok(Prepared { index: n_frames, loan: loan(n_frames, Kind::End, ports, context)?, decode_nanos: 0 })
}

fn loan(
    index: u64,
    kind: Kind,
    ports: &Ports,
    context: &Context,
) -> Result<Loan<FrameHeader, u16>, StageError> {
    let shape = context.layout.frame;
    let mut loan = ports.frames.loan(shape.payload_len())?;
    let (width, height) = (shape.width, shape.height);
    *loan.header_mut() = FrameHeader { index, width, height, kind: kind.to_wire(), ..FrameHeader::default() };
    Ok(loan)
}
