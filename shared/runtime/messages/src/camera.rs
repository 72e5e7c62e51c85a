//! Messages from and to a camera's own program: the public interface of `tessera run
//! external`, for any language that iceoryx2 speaks (`docs/camera.md`).

use crate::frame::{FrameShape, Kind};
use crate::message::{Message, Refusal};
use crate::rotation::{RotationBits, UpBits};
use bytemuck::{Pod, Zeroable};
use tessera_geometry::{Camera, CameraError};

/// Header of an image on the service `camera`; the payload is depth and, packed behind it, colour
/// (see [`FrameShape`]), in units of 16 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct CameraFrame {
    /// Any number that differs from one start of the publisher to the next.
    pub session: u64,
    /// Counts the images of a session from 0 on, those that were not sent too.
    pub index: u64,
    /// Time of the depth image, nanoseconds; rises from image to image.
    pub stamp_nanos: i64,
    /// 0: an image. 1: the camera has ended; the index is the number of images, and the payload is not read.
    /// 2: an image with which relocalisation is asked for.
    pub kind: u32,
    /// 1: the payload holds colour, else 0.
    pub has_colour: u32,
    /// Columns, pixels.
    pub width: u32,
    /// Rows, pixels.
    pub height: u32,
    /// 0: live, nothing comes again. Else so many images are kept and sent again on request.
    pub ring_frames: u32,
    /// 1: colour is registered to depth, pixel by pixel, else 0.
    pub colour_registered: u32,
    /// Focal length along x, pixels; 0: the publisher does not know its camera, `--camera` gives it.
    pub fx: f64,
    /// Focal length along y, pixels.
    pub fy: f64,
    /// Principal point, column.
    pub cx: f64,
    /// Principal point, row.
    pub cy: f64,
    /// Raw depth divided by this is metres: 1000 for millimetres.
    pub units_per_metre: f64,
    /// Brown-Conrady coefficients `k1 k2 p1 p2 k3`.
    pub distortion: [f64; 5],
    /// Seconds from the exposure of the first depth row to that of the last; 0: global shutter.
    pub readout_s: f64,
    /// Metres to add to every measured depth.
    pub depth_offset_m: f64,
    /// The rotation that a gyroscope measured; all zero without one.
    pub rotation: RotationBits,
    /// The direction against gravity; all zero where it is not known.
    pub up: UpBits,
}

impl Message for CameraFrame {
    const NAME: &'static str = "tessera.CameraFrame.v2";
}

/// What the publisher is told on the service `camera_flow`. A live publisher need not read it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct CameraFlow {
    /// Rises whenever images are asked for again.
    pub epoch: u64,
    /// In a new epoch a publisher with a ring goes on from here: the first image that is missing.
    pub send_from: u64,
    /// A publisher with a ring sends images below this index alone.
    pub send_below: u64,
    /// 1: nothing more is needed.
    pub finished: u64,
}

impl Message for CameraFlow {
    const NAME: &'static str = "tessera.CameraFlow.v1";
}

impl CameraFrame {
    /// [`Self::kind`] of an image with which relocalisation is asked for.
    pub const RELOCALISE: u32 = 2;

    /// Whether relocalisation is asked for: the camera's place is to be looked for anew from this image on.
    pub fn asks_relocalisation(&self) -> bool {
        self.kind == Self::RELOCALISE
    }

    /// The header of a camera's frames, which describes it; [`Self::camera`] reads it back.
    pub fn of_camera(camera: &Camera) -> Self {
        Self {
            width: camera.width,
            height: camera.height,
            colour_registered: camera.colour_registered.into(),
            fx: camera.fx,
            fy: camera.fy,
            cx: camera.cx,
            cy: camera.cy,
            units_per_metre: camera.units_per_metre,
            distortion: camera.distortion,
            readout_s: camera.readout_s,
            depth_offset_m: camera.depth_offset_m,
            ..Self::default()
        }
    }

    /// The camera that the header describes; `None` where the publisher leaves that to `--camera`.
    ///
    /// # Errors
    /// Names the first number that cannot be.
    pub fn camera(&self) -> Result<Option<Camera>, CameraError> {
        if self.fx == 0.0 {
            return Ok(None);
        }
        let focal_and_centre = [self.fx, self.fy, self.cx, self.cy];
        let camera = Camera {
            distortion: self.distortion,
            readout_s: self.readout_s,
            depth_offset_m: self.depth_offset_m,
            colour_registered: self.colour_registered == 1,
            ..Camera::pinhole((self.width, self.height), focal_and_centre, self.units_per_metre)
        };
        camera.check().map(|()| Some(camera))
    }

    /// Checks what can be checked without knowing the images before this one.
    ///
    /// # Errors
    /// A [`Refusal`] that names the image, what was found and what was expected.
    pub fn validate(&self, shape: FrameShape) -> Result<Kind, Refusal> {
        let index = self.index;
        let value = |what, found: u64, rule| Refusal::Value { index, what, found: found.to_string(), rule };
        // Indices are added to: the upper half of the range is no count of images.
        if index > u64::MAX / 2 {
            return Err(value("index", index, "a count of images"));
        }
        let kind = match self.kind {
            0 | Self::RELOCALISE => Kind::Frame,
            1 => return Ok(Kind::End),
            other => {
                let rule = "0 (image), 1 (end) or 2 (image, relocalise)";
                return Err(value("kind", other.into(), rule));
            }
        };
        Refusal::unless_equal(index, "width", self.width.into(), shape.width.into())?;
        Refusal::unless_equal(index, "height", self.height.into(), shape.height.into())?;
        if self.has_colour > 1 {
            return Err(value("has_colour", self.has_colour.into(), "0 or 1"));
        }
        self.rotation.read(index)?;
        self.up.read(index)?;
        Ok(kind)
    }

    /// Refuses a payload that is not as long as depth, or depth and colour, of that shape.
    ///
    /// # Errors
    /// A [`Refusal`] with both lengths.
    pub fn check_payload(&self, shape: FrameShape, len: usize) -> Result<(), Refusal> {
        let expected = if self.has_colour == 1 { shape.payload_len() } else { shape.n_pixels() };
        if self.has_colour == 0 && len == shape.payload_len() {
            return Ok(());
        }
        Refusal::unless_equal(self.index, "payload length", len as u64, expected as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAPE: FrameShape = FrameShape { width: 20, height: 16 };

    fn frame() -> CameraFrame {
        let (fx, fy, units_per_metre) = (20.0, 20.0, 1000.0);
        let (width, height) = (20, 16);
        CameraFrame { index: 7, width, height, has_colour: 1, fx, fy, units_per_metre, ..Default::default() }
    }

    #[test]
    fn each_lie_is_refused_by_name() {
        assert_eq!(frame().validate(SHAPE), Ok(Kind::Frame));
        assert_eq!(CameraFrame { kind: 1, width: 0, ..frame() }.validate(SHAPE), Ok(Kind::End));
        assert_eq!(CameraFrame { kind: 2, ..frame() }.validate(SHAPE), Ok(Kind::Frame));
        assert!(CameraFrame { kind: 2, ..frame() }.asks_relocalisation() && !frame().asks_relocalisation());
        let refused = |frame: CameraFrame| frame.validate(SHAPE).unwrap_err().to_string();
        assert_eq!(refused(CameraFrame { width: 6, ..frame() }), "frame 7: width is 6, expected 20");
        assert!(refused(CameraFrame { kind: 9, ..frame() }).contains("kind is 9"));
        assert!(refused(CameraFrame { has_colour: 2, ..frame() }).contains("has_colour is 2"));
        for kind in [0, 1, 2] {
            let last = CameraFrame { index: u64::MAX, kind, ..frame() };
            assert!(refused(last).contains("a count of images"), "kind {kind}");
        }
        let rotation = RotationBits { variance_rad2: f64::NAN, ..Default::default() };
        assert!(refused(CameraFrame { rotation, ..frame() }).contains("the rotation"));
        let up = UpBits { in_camera: [1.0, 1.0, 0.0], sigma_rad: 0.1 };
        assert!(refused(CameraFrame { up, ..frame() }).contains("up is"));
    }

    #[test]
    fn a_payload_has_depth_and_the_colour_that_the_header_tells_of() {
        let check = |has_colour, len| CameraFrame { has_colour, ..frame() }.check_payload(SHAPE, len).is_ok();
        assert!(check(1, 320 + 480) && check(0, 320) && check(0, 320 + 480));
        assert!(!check(1, 320) && !check(0, 319) && !check(1, 801));
    }

    #[test]
    fn the_camera_is_checked_or_left_to_others() {
        assert_eq!(frame().camera().unwrap().unwrap().units_per_metre, 1000.0);
        assert_eq!(CameraFrame { fx: 0.0, ..frame() }.camera(), Ok(None));
        let error = CameraFrame { units_per_metre: f64::NAN, ..frame() }.camera().unwrap_err();
        assert!(error.to_string().contains("units_per_metre is NaN"), "{error}");
    }
}
