//! The camera of a recording, from its CameraInfo or CameraCalibration.

use crate::UNITS_OF_METRES;
use crate::chunks::{Chunks, Spot};
use crate::error::{MessageError, RecordingError};
use crate::librealsense;
use crate::messages::{self, CameraMessage, ImageForm, ImageMessage};
use crate::pixels;
use crate::topics::Topics;
use tessera_frames::{OtherLens, StatedLens, decode};
use tessera_geometry::Camera;

/// Units of 16-bit depth in ROS: millimetres (REP 118).
const UNITS_OF_MILLIMETRES: f64 = 1000.0;

/// A camera as a recording has it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RecordedCamera {
    /// With the five coefficients that the camera model has, or without any where `lens` has them.
    pub(super) camera: Camera,
    /// A lens that the camera model does not have: images are undistorted as they are read.
    pub(super) lens: Option<OtherLens>,
    /// Name of its coordinate frame; empty where it is not known.
    pub(super) frame: String,
}

/// Reads the camera that belongs to the depth topic; `units_at` says its units, where they are not those of ROS.
pub(super) fn of_depth(
    chunks: &Chunks,
    topics: &Topics,
    (camera_at, units_at): (Option<&Spot>, Option<&Spot>),
    first_depth: &Spot,
) -> Result<RecordedCamera, RecordingError> {
    let missing = || RecordingError::NoCamera { topic: topics.depth.clone() };
    let (spot, topic) = camera_at.zip(topics.camera.as_ref()).ok_or_else(missing)?;
    let data = chunks.read(first_depth)?;
    let image = messages::image(first_depth.kind, &data).map_err(|problem| first(problem, &topics.depth))?;
    let units = match units_at {
        Some(at) => librealsense::units_per_metre(&chunks.read(at)?)
            .map_err(|problem| first(problem, topics.units.as_deref().unwrap_or_default()))?,
        None => units_per_metre(&image),
    };
    read(chunks, spot, units, (topics.depth.contains("rect"), image_size(&image)), topic)
}

/// Units in which the depth of an image is counted.
pub(super) fn units_per_metre(image: &ImageMessage<'_>) -> f64 {
    let is_metres = match &image.form {
        ImageForm::Raw { encoding, .. } => encoding == "32FC1",
        ImageForm::File { format } => format.starts_with("32FC1"),
    };
    if is_metres { UNITS_OF_METRES } else { UNITS_OF_MILLIMETRES }
}

/// Reads the camera of the colour images; its units mean nothing.
pub(super) fn of_colour(
    chunks: &Chunks,
    spot: &Spot,
    (images, size): (&str, (u32, u32)),
    topic: &str,
) -> Result<RecordedCamera, RecordingError> {
    read(chunks, spot, UNITS_OF_MILLIMETRES, (images.contains("rect"), Some(size)), topic)
}

/// Columns and rows of a depth image, where they can be seen.
pub(super) fn image_size(image: &ImageMessage<'_>) -> Option<(u32, u32)> {
    match &image.form {
        ImageForm::Raw { width, height, .. } => Some((*width, *height)),
        ImageForm::File { .. } => decode::size(pixels::picture_of_depth(&image.data)).ok(),
    }
}

fn first(problem: MessageError, topic: &str) -> RecordingError {
    RecordingError::Message { topic: topic.to_owned(), number: 1, problem }
}

fn read(
    chunks: &Chunks,
    spot: &Spot,
    units_per_metre: f64,
    images: (bool, Option<(u32, u32)>),
    topic: &str,
) -> Result<RecordedCamera, RecordingError> {
    let data = chunks.read(spot)?;
    let said = messages::camera(spot.kind, &data).map_err(|problem| first(problem, topic))?;
    let recorded = convert(&said, units_per_metre, images, topic)?;
    let frame = match recorded.frame.is_empty() {
        true => librealsense::stream_of(topic).unwrap_or_default(),
        false => recorded.frame.clone(),
    };
    Ok(RecordedCamera { frame, ..recorded })
}

/// Our camera. The images of a rectified topic have the projection's numbers and no distortion; images of the
/// camera's own size were neither binned nor cut, whatever the message states.
pub(super) fn convert(
    said: &CameraMessage,
    units_per_metre: f64,
    (is_rectified, size): (bool, Option<(u32, u32)>),
    topic: &str,
) -> Result<RecordedCamera, RecordingError> {
    let number = |from: &[f64], at: usize| from.get(at).copied().unwrap_or(f64::NAN);
    let has_projection = number(&said.projection, 0) > 0.0;
    let (fx, fy, cx, cy) = if is_rectified && has_projection {
        let p = &said.projection;
        (number(p, 0), number(p, 5), number(p, 2), number(p, 6))
    } else {
        let k = &said.intrinsics;
        (number(k, 0), number(k, 4), number(k, 2), number(k, 5))
    };
    let whole = (said.width, said.height);
    let (sent, intrinsics) = match size == Some(whole) {
        true => (whole, [fx, fy, cx, cy]),
        false => said.window.of(whole, [fx, fy, cx, cy]),
    };
    if let Some(found) = size.filter(|found| sent != whole && *found != sent) {
        return Err(RecordingError::Window { topic: topic.to_owned(), found, whole, sent });
    }
    let camera = Camera::pinhole(sent, intrinsics, units_per_metre);
    let recorded = |camera: Camera, lens: Option<OtherLens>| {
        // Images of a colour camera may be larger than those of depth; they are never stored.
        let small =
            Camera { width: camera.width.min(1920), height: camera.height.min(1080), ..camera.clone() };
        let checked = if topic.contains("depth") { &camera } else { &small };
        checked.check().map_err(|source| RecordingError::Camera { topic: topic.to_owned(), source })?;
        Ok(RecordedCamera { camera, lens, frame: said.frame.trim_start_matches('/').to_owned() })
    };
    let camera = recorded(camera, None)?.camera;
    let is_distorted = said.distortion.iter().any(|&d| d != 0.0);
    if !is_distorted || (is_rectified && has_projection) {
        return recorded(camera, None);
    }
    match StatedLens::of_model(&said.model, &said.distortion) {
        Some(StatedLens::Plain(distortion)) => recorded(Camera { distortion, ..camera }, None),
        Some(StatedLens::Other(lens)) if lens.is_usable(&camera) => recorded(camera, Some(lens)),
        _ => Err(RecordingError::Distortion {
            topic: topic.to_owned(),
            model: said.model.clone(),
            found: said.distortion.clone(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_frames::SentWindow;

    fn said(model: &str, distortion: &[f64]) -> CameraMessage {
        CameraMessage {
            frame: "/camera".into(),
            width: 64,
            height: 48,
            model: model.into(),
            distortion: distortion.to_vec(),
            intrinsics: vec![60.0, 0.0, 31.5, 0.0, 61.0, 23.5, 0.0, 0.0, 1.0],
            window: SentWindow::default(),
            projection: vec![58.0, 0.0, 31.0, 0.0, 0.0, 59.0, 23.0, 0.0, 0.0, 0.0, 1.0, 0.0],
        }
    }

    #[test]
    fn a_rectified_image_has_the_projection_and_no_distortion() {
        let said = said("plumb_bob", &[0.1, -0.2, 0.0, 0.0, 0.3]);
        let raw = convert(&said, 1000.0, (false, None), "t").unwrap().camera;
        assert_eq!((raw.fx, raw.fy, raw.cx, raw.cy), (60.0, 61.0, 31.5, 23.5));
        assert_eq!(raw.distortion, [0.1, -0.2, 0.0, 0.0, 0.3]);
        let rectified = convert(&said, 1000.0, (true, None), "t").unwrap().camera;
        assert_eq!((rectified.fx, rectified.cy, rectified.is_distorted()), (58.0, 23.0, false));
    }

    #[test]
    fn models_that_are_not_known_are_refused_unless_they_distort_nothing() {
        let plain = [0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert!(convert(&said("rational_polynomial", &plain), 1e3, (false, None), "t").is_ok());
        assert!(convert(&said("equidistant", &[0.0; 4]), 1e3, (false, None), "t").is_ok());
        for (model, k) in [("rational_polynomial", [0.0, 0.0, 0.0, 0.0, 0.0, 0.5]), ("equidistant", [0.1; 6])]
        {
            let words = convert(&said(model, &k), 1e3, (false, None), "t").unwrap_err().to_string();
            assert!(words.contains(model) && words.contains("expected plumb_bob"), "{words}");
        }
        // A lens of an Azure Kinect is used as it is: the camera has none, and images are undistorted.
        let eight = [0.51, -2.65, 0.0, 0.0, 1.52, 0.39, -2.46, 1.45];
        let azure = convert(&said("rational_polynomial", &eight), 1e3, (false, None), "t").unwrap();
        assert_eq!((azure.camera.is_distorted(), azure.lens), (false, Some(OtherLens::Rational(eight))));
        assert_eq!(azure.frame, "camera");
        let fisheye = convert(&said("equidistant", &[0.1, 0.01, 0.0, 0.0]), 1e3, (false, None), "t").unwrap();
        assert_eq!(fisheye.lens, Some(OtherLens::Equidistant([0.1, 0.01, 0.0, 0.0])));
        let folding = [0.0, 0.0, 0.0, 0.0, 0.0, -9.0, 0.0, 0.1];
        let words =
            convert(&said("rational_polynomial", &folding), 1e3, (false, None), "t").unwrap_err().to_string();
        assert!(words.contains("do not fold the image"), "{words}");
        let without = CameraMessage { intrinsics: Vec::new(), ..said("", &[]) };
        assert!(convert(&without, 1e3, (false, None), "t").unwrap_err().to_string().contains("fx is NaN"));
    }

    #[test]
    fn binning_and_region_are_applied_where_the_images_are_a_part() {
        let of = |binning, first, size, image| {
            let window = SentWindow { binning, first, size };
            convert(&CameraMessage { window, ..said("", &[]) }, 1e3, (false, image), "t")
        };
        let numbers = |camera: Camera| (camera.width, camera.height, camera.fx, camera.cx, camera.cy);
        let halved = of([2, 2], [0, 0], [0, 0], Some((32, 24))).unwrap().camera;
        assert_eq!(numbers(halved), (32, 24, 30.0, 15.5, 11.5));
        let cut = of([0, 0], [16, 8], [32, 24], None).unwrap().camera;
        assert_eq!(numbers(cut), (32, 24, 60.0, 15.5, 15.5));
        // A driver whose images are whole all the same.
        let whole = of([2, 2], [16, 8], [32, 24], Some((64, 48))).unwrap().camera;
        assert_eq!(numbers(whole), (64, 48, 60.0, 31.5, 23.5));
        let words = of([2, 2], [0, 0], [0, 0], Some((21, 16))).unwrap_err().to_string();
        assert!(words.contains("binning and roi leave 32x24 px, expected 21x16 px"), "{words}");
    }
}
