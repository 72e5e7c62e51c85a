//! A depth image with optional colour on its way from the sensor to the reconstruction.

use crate::message::{Message, Refusal, StepTimes};
use crate::rotation::{RotationBits, UpBits};
use bytemuck::{Pod, Zeroable};

/// What a frame or surface message stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// An image, or the surface made of one.
    Frame,
    /// The source is exhausted: the index is the number of frames.
    End,
}

impl Kind {
    /// As written in a header.
    pub fn to_wire(self) -> u32 {
        match self {
            Kind::Frame => 0,
            Kind::End => 1,
        }
    }

    pub(crate) fn check(index: u64, wire: u32) -> Result<Kind, Refusal> {
        match wire {
            0 => Ok(Kind::Frame),
            1 => Ok(Kind::End),
            other => Err(Refusal::Value {
                index,
                what: "kind",
                found: other.to_string(),
                rule: "0 (frame) or 1 (end)",
            }),
        }
    }
}

/// Header of a frame; the payload is depth and, packed behind it, colour (see [`FrameShape`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FrameHeader {
    /// Frame index as the source counts.
    pub index: u64,
    /// Epoch of the flow in which it was sent; raised whenever frames are asked for again.
    pub epoch: u64,
    /// Sensor time.
    pub stamp_nanos: i64,
    /// Frames that the source left out before this one because they came too fast (live mode).
    pub dropped_before: u64,
    /// Relocalisation is asked for from this index on, in this frame and in all behind it (live mode) or in
    /// this one alone; 0: it was never asked for.
    pub relocalise_from: u64,
    /// Columns, pixels.
    pub width: u32,
    /// Rows, pixels.
    pub height: u32,
    /// [`Kind`] as written by [`Kind::to_wire`].
    pub kind: u32,
    /// 1: the payload holds colour.
    pub has_colour: u32,
    /// What a gyroscope measured.
    pub rotation: RotationBits,
    /// What an accelerometer measured.
    pub up: UpBits,
    /// When each step happened.
    pub times: StepTimes,
}

impl Message for FrameHeader {
    const NAME: &'static str = "tessera.FrameHeader.v4";
}

/// The image size that the run's camera has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameShape {
    /// Columns, pixels.
    pub width: u32,
    /// Rows, pixels.
    pub height: u32,
}

impl FrameShape {
    /// Pixels of the image.
    pub fn n_pixels(self) -> usize {
        (self.width as usize).saturating_mul(self.height as usize)
    }

    /// Bytes of its colour: three a pixel.
    fn n_colour(self) -> usize {
        self.n_pixels().saturating_mul(3)
    }

    /// Length of the payload in units of 16 bits: depth, then three bytes of colour a pixel.
    pub fn payload_len(self) -> usize {
        self.n_pixels().saturating_add(self.n_colour().div_ceil(2))
    }

    /// Splits a payload into depth and colour to write into; `None` where it is too short.
    pub fn split_mut(self, payload: &mut [u16]) -> Option<(&mut [u16], &mut [u8])> {
        let payload = payload.get_mut(..self.payload_len())?;
        let (depth, colour) = payload.split_at_mut(self.n_pixels());
        let colour: &mut [u8] = bytemuck::cast_slice_mut(colour);
        Some((depth, colour.get_mut(..self.n_colour())?))
    }
}

/// A checked frame, read in place.
#[derive(Clone, Copy, Debug)]
pub struct FramePayload<'a> {
    /// Raw depth, row by row.
    pub depth: &'a [u16],
    /// Red, green, blue, row by row, where the frame has colour.
    pub colour: Option<&'a [u8]>,
}

impl FrameHeader {
    /// Checks everything that this header says against what the run's configuration says.
    ///
    /// `limit` is the first index that cannot be in flight; no check where `None` (live mode).
    ///
    /// # Errors
    /// A [`Refusal`] that names the frame, what was found and what was expected.
    pub fn validate(&self, shape: FrameShape, limit: Option<u64>) -> Result<Kind, Refusal> {
        let index = self.index;
        let kind = Kind::check(index, self.kind)?;
        Refusal::unless_equal(index, "width", self.width.into(), shape.width.into())?;
        Refusal::unless_equal(index, "height", self.height.into(), shape.height.into())?;
        self.rotation.read(index)?;
        self.up.read(index)?;
        Refusal::unless_reached(index, self.relocalise_from)?;
        match limit {
            Some(limit) if index >= limit => Err(Refusal::Future { index, limit }),
            _ => Ok(kind),
        }
    }

    /// The payload's parts, by the configured shape and not by what the header says.
    ///
    /// # Errors
    /// A [`Refusal`] where the payload has another length.
    pub fn payload<'a>(&self, shape: FrameShape, payload: &'a [u16]) -> Result<FramePayload<'a>, Refusal> {
        let expected = shape.payload_len();
        Refusal::unless_equal(self.index, "payload length", payload.len() as u64, expected as u64)?;
        let (depth, colour) = payload.split_at(shape.n_pixels());
        let colour: &[u8] = bytemuck::cast_slice(colour);
        let colour = colour.get(..shape.n_colour()).filter(|_| self.has_colour == 1);
        Ok(FramePayload { depth, colour })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MOST_LEFT_OUT;

    const SHAPE: FrameShape = FrameShape { width: 5, height: 3 };

    fn header() -> FrameHeader {
        FrameHeader { index: 7, width: 5, height: 3, has_colour: 1, ..FrameHeader::default() }
    }

    #[test]
    fn what_is_written_is_read_back_in_place() {
        let mut payload = vec![0u16; SHAPE.payload_len()];
        let (depth, colour) = SHAPE.split_mut(&mut payload).unwrap();
        depth[14] = 4711;
        colour[44] = 99;
        let read = header().payload(SHAPE, &payload).unwrap();
        assert_eq!((read.depth[14], read.colour.unwrap()[44]), (4711, 99));
        assert!(FrameHeader { has_colour: 0, ..header() }.payload(SHAPE, &payload).unwrap().colour.is_none());
    }

    #[test]
    fn each_lie_is_refused_by_name() {
        let check = |header: FrameHeader| header.validate(SHAPE, Some(10)).map_err(|e| e.to_string());
        assert_eq!(check(header()), Ok(Kind::Frame));
        assert_eq!(check(FrameHeader { kind: 1, ..header() }), Ok(Kind::End));
        let refused = |header| check(header).unwrap_err();
        assert_eq!(refused(FrameHeader { width: 6, ..header() }), "frame 7: width is 6, expected 5");
        assert!(refused(FrameHeader { height: 9, ..header() }).contains("height is 9"));
        assert!(refused(FrameHeader { kind: 77, ..header() }).contains("kind is 77"));
        assert!(refused(FrameHeader { index: 10, ..header() }).contains("below 10"));
        assert!(refused(FrameHeader { relocalise_from: 8, ..header() }).contains("relocalise_from is 8"));
        assert_eq!(check(FrameHeader { relocalise_from: 7, ..header() }), Ok(Kind::Frame));
        let in_source = |index, kind| Refusal::unless_in_source(index, kind, Some(8), 0).is_ok();
        let endless = |index| Refusal::unless_in_source(index, Kind::Frame, None, 100).is_ok();
        assert!(endless(0) && endless(100 + MOST_LEFT_OUT) && !endless(101 + MOST_LEFT_OUT));
        assert!(in_source(7, Kind::Frame) && in_source(8, Kind::End));
        assert!(!in_source(8, Kind::Frame) && !in_source(7, Kind::End));
        assert!(header().payload(SHAPE, &[0; 4]).unwrap_err().to_string().contains("payload length is 4"));
    }
}
