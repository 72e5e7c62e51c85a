//! The one interface behind which all sources stand.

use crate::{ColourCamera, SourceError};
use std::path::PathBuf;
use tessera_evaluation::Trajectory;
use tessera_geometry::{Camera, InertialRotation, UpDirection};

/// Where a frame is decoded to: slices of the caller, for instance in shared memory.
#[derive(Debug)]
pub struct FrameBuffers<'a> {
    /// Raw depth, row by row, `width * height` values; 0 and 65535 mean no measurement.
    pub depth: &'a mut [u16],
    /// Colour as red, green, blue bytes, row by row, `3 * width * height` values.
    pub colour: &'a mut [u8],
}

impl FrameBuffers<'_> {
    /// Checks that both slices fit the camera's images.
    ///
    /// # Errors
    /// Says the lengths found and expected.
    pub fn check(&self, camera: &Camera) -> Result<(), SourceError> {
        let n_pixels = (camera.width as usize).saturating_mul(camera.height as usize);
        let n_colour = n_pixels.saturating_mul(3);
        if self.depth.len() != n_pixels || self.colour.len() != n_colour {
            return Err(SourceError::Buffers {
                depth: self.depth.len(),
                colour: self.colour.len(),
                expected_depth: n_pixels,
                expected_colour: n_colour,
            });
        }
        Ok(())
    }
}

/// What came with a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameInfo {
    /// Time of the depth image, nanoseconds.
    pub stamp_nanos: i64,
    /// Whether the colour slice was filled from an image; without one it is all zero.
    pub has_colour: bool,
    /// The camera's rotation since the first frame, where a gyroscope measured it.
    pub rotation: Option<InertialRotation>,
    /// The direction against gravity, where an accelerometer measured it.
    pub up: Option<UpDirection>,
}

/// A colour image as it was taken, before it is brought to the pixels of depth.
#[derive(Clone, Debug)]
pub struct TakenColour {
    /// Its camera, and where that is from the depth camera.
    pub camera: ColourCamera,
    /// Red, green, blue bytes, row by row, in the size of its camera.
    pub rgb: Vec<u8>,
    /// The file that holds it alone, where there is one.
    pub file: Option<PathBuf>,
}

/// How depth and colour images were paired.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pairing {
    /// Depth images.
    pub n_depth: usize,
    /// Colour images.
    pub n_colour: usize,
    /// Pairs within the limit.
    pub n_pairs: usize,
    /// Largest difference of paired times, nanoseconds.
    pub largest_difference_nanos: i64,
    /// From the stamps of depth images to the times at which they were taken, nanoseconds: median, 0 or negative.
    pub taken_after_nanos: i64,
}

impl Pairing {
    /// Standard deviation of a frame's time, seconds.
    ///
    /// Both images are stamped some time after they were taken. Of two such delays from one exponential distribution
    /// the smaller has half of their difference as its mean and its deviation: exponentials have no memory.
    pub fn stamp_sigma_s(self) -> f64 {
        0.5e-9 * self.taken_after_nanos.unsigned_abs() as f64
    }
}

/// Frames by index. `read` takes `&self` so that several threads can decode ahead.
pub trait Source: Send + Sync {
    /// Camera of the depth images; colour has the same size.
    fn camera(&self) -> &Camera;

    /// Number of frames; `None` for a source without an end.
    fn n_frames(&self) -> Option<u64>;

    /// Time of a frame, nanoseconds, without reading it; `None` beyond the end.
    fn stamp_nanos(&self, index: u64) -> Option<i64>;

    /// Reads a frame into the caller's slices. The same index always gives the same bytes.
    ///
    /// # Errors
    /// Names the frame and file, what was found and what was expected; the source stays usable. The
    /// slices then hold anything, but for [`SourceError::Colour`], where depth is whole.
    fn read(&self, index: u64, buffers: &mut FrameBuffers<'_>) -> Result<FrameInfo, SourceError>;

    /// Makes reading from that frame on quick, with a sign of life now and then where that takes long: a video is
    /// decoded from its beginning. What is read is the same without.
    fn go_to(&self, _index: u64, _alive: &mut dyn FnMut()) {}

    /// The colour image of a frame as its own camera took it; `None` where [`Self::read`] gives it as it was
    /// taken, or there is none.
    ///
    /// # Errors
    /// As [`Self::read`].
    fn colour_as_taken(&self, _index: u64) -> Result<Option<TakenColour>, SourceError> {
        Ok(None)
    }

    /// True poses `world_from_camera` at the times of the source, where known.
    fn ground_truth(&self) -> Option<&Trajectory> {
        None
    }

    /// How depth and colour were paired.
    fn pairing(&self) -> Pairing;

    /// Reads a frame of which an image may be missing or broken: depth that cannot be read is
    /// empty, colour that cannot be read is left out, and the error says which and why.
    ///
    /// # Errors
    /// What no other frame can cure: an index beyond the end, wrong slices.
    fn read_what_is_there(
        &self,
        index: u64,
        buffers: &mut FrameBuffers<'_>,
    ) -> Result<(FrameInfo, Option<SourceError>), SourceError> {
        let error = match self.read(index, buffers) {
            Ok(info) => return Ok((info, None)),
            Err(error) => error,
        };
        let stamp_nanos = self.stamp_nanos(index).filter(|_| error.is_of_one_frame());
        let Some(stamp_nanos) = stamp_nanos else { return Err(error) };
        if !matches!(error, SourceError::Colour(_)) {
            buffers.depth.fill(0);
        }
        buffers.colour.fill(0);
        Ok((FrameInfo { stamp_nanos, has_colour: false, rotation: None, up: None }, Some(error)))
    }

    /// Looks whether the images of a frame are there and whole, without decoding them.
    ///
    /// # Errors
    /// As [`Self::read`].
    fn inspect(&self, _index: u64) -> Result<(), SourceError> {
        Ok(())
    }

    /// What speaks against the camera that is used, in sentences.
    fn doubts(&self) -> &[String] {
        &[]
    }

    /// What was recognised and chosen: names and values, as `("layout", "7-Scenes")`.
    fn description(&self) -> Vec<(&'static str, String)> {
        Vec::new()
    }

    /// What was found wrong while opening and could be worked around, in sentences.
    fn warnings(&self) -> &[String] {
        &[]
    }
}
