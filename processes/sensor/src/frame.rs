//! A frame in shared memory before it is sent.

use tessera_messages::{FrameHeader, FrameShape, Kind};
use tessera_stage::{Delivery, KillPoints, monotonic_nanos};
use tessera_transport::{Loan, SlicePublisher, TransportError};

/// A frame in shared memory that has not been sent.
pub(crate) struct PreparedFrame {
    pub(crate) index: u64,
    pub(crate) loan: Loan<FrameHeader, u16>,
    /// Time that reading it took.
    pub(crate) decode_nanos: u64,
}

/// A loan with the header of frame `index`; its pixels are to be written. Of kind [`Kind::End`]: the
/// message that the source is exhausted after `index` frames.
pub(crate) fn blank_frame(
    index: u64,
    kind: Kind,
    shape: FrameShape,
    publisher: &SlicePublisher<FrameHeader, u16>,
) -> Result<PreparedFrame, TransportError> {
    let mut loan = publisher.loan(shape.payload_len())?;
    let (width, height) = (shape.width, shape.height);
    let mut header = FrameHeader { index, width, height, kind: kind.to_wire(), ..FrameHeader::default() };
    header.times.read_began = monotonic_nanos();
    *loan.header_mut() = header;
    Ok(PreparedFrame { index, loan, decode_nanos: 0 })
}

/// Whether the frame is to be sent; a test may want it dropped or corrupted.
pub(crate) fn is_delivered(kill_points: &KillPoints, frame: &mut PreparedFrame) -> bool {
    let delivery = kill_points.deliver("read", frame.index);
    if delivery == Delivery::Corrupt {
        let header = frame.loan.header_mut();
        match frame.index % 3 {
            0 => header.width ^= 1,
            1 => header.kind = u32::MAX,
            _ => header.index = u64::MAX,
        }
    }
    if delivery == Delivery::Jumped {
        let header = frame.loan.header_mut();
        header.index = header.index.saturating_add(1 << 40);
    }
    delivery != Delivery::Dropped
}
