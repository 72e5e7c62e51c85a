//! Frames from a camera's own program: checked, copied once, and sent on.
//!
//! The program stays outside the window and its epochs: what it writes cannot stall or lose a
//! frame of the pipeline, and it may die and come back at any time.
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::indexing_slicing,
        clippy::cast_possible_truncation,
        clippy::arithmetic_side_effects
    )
)]

mod camera;
mod in_order;
mod newest;
mod session;
mod stamps;

use crate::SensorPorts;
use crate::frame::{PreparedFrame, blank_frame};
use crate::sending::Supply;
use camera::{ExternalCamera, ExternalImage};
use in_order::InOrder;
use newest::Newest;
use tessera_messages::Kind;
use tessera_stage::{StageContext, StageError, monotonic_nanos};
use tessera_transport::Link;

/// The images of the camera's own program: each in order, or the newest.
pub(crate) fn supply(context: &StageContext, link: &Link) -> Result<Box<dyn Supply>, StageError> {
    let camera = ExternalCamera::open(context, link)?;
    Ok(if context.settings.run.live {
        Box::new(Newest::new(camera))
    } else {
        Box::new(InOrder::new(camera, u64::from(context.layout.window)))
    })
}

/// Frames to take at most.
fn most_frames(context: &StageContext) -> Option<u64> {
    Some(context.settings.run.frames).filter(|frames| *frames > 0)
}

/// The frame as the pipeline has it: the one copy on the way.
fn copy(
    image: &ExternalImage,
    index: u64,
    ports: &SensorPorts,
    context: &StageContext,
) -> Result<PreparedFrame, StageError> {
    let mut frame = blank_frame(index, Kind::Frame, context.layout.frame, &ports.frames)?;
    let header = frame.loan.header_mut();
    let began = header.times.read_began;
    header.stamp_nanos = image.header.stamp_nanos;
    header.has_colour = image.header.has_colour;
    header.rotation = image.header.rotation;
    header.up = image.header.up;
    let from = image.received.payload();
    let to = frame.loan.payload_mut();
    let (to, rest) = to.split_at_mut(from.len().min(to.len()));
    // As long as the shorter of the two.
    to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
    // What an earlier frame left behind the depth must not look like this one's colour.
    rest.fill(0);
    frame.decode_nanos = monotonic_nanos().saturating_sub(began);
    Ok(frame)
}
