//! The camera of a recording, from its CameraInfo or CameraCalibration.

use crate::UNITS_OF_METRES;
use crate::chunks::{Chunks, Spot};
use crate::error::{MessageError, RecordingError};
use crate::librealsense;
use crate::messages::{self, CameraMessage, ImageForm, ImageMessage};
use crate::topics::Topics;
use tessera_frames::{OtherLens, StatedLens};
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
    read(chunks, spot, units, topics.depth.contains("rect"), topic)
}

/// Units in which the depth of an image is counted.
pub(super) fn units_per_metre(image: &ImageMessage<'_>) -> f64 {
    let is_metres = match &image.form {
        ImageForm::Raw { encoding, .. } => encoding == "32FC1",
        ImageForm::File { format } => format.starts_with("32FC1"),
    };
    if is_metres { UNITS_OF_METRES } else { UNITS_OF_MILLIMETRES }
}

/// Reads the camera of the colour images; its units say nothing.
pub(super) fn of_colour(
    chunks: &Chunks,
    spot: &Spot,
    images: &str,
    topic: &str,
) -> Result<RecordedCamera, RecordingError> {
    read(chunks, spot, UNITS_OF_MILLIMETRES, images.contains("rect"), topic)
}

fn first(problem: MessageError, topic: &str) -> RecordingError {
    RecordingError::Message { topic: topic.to_owned(), number: 1, problem }
}

fn read(
    chunks: &Chunks,
    spot: &Spot,
    units_per_metre: f64,
    is_rectified: bool,
    topic: &str,
) -> Result<RecordedCamera, RecordingError> {
    let data = chunks.read(spot)?;
    let said = messages::camera(spot.kind, &data).map_err(|problem| first(problem, topic))?;
    let recorded = convert(&said, units_per_metre, is_rectified, topic)?;
    let frame = match recorded.frame.is_empty() {
        true => librealsense::stream_of(topic).unwrap_or_default(),
        false => recorded.frame.clone(),
    };
    Ok(RecordedCamera { frame, ..recorded })
}

/// Our camera. The images of a rectified topic have the projection's numbers and no distortion.
pub(super) fn convert(
    said: &CameraMessage,
    units_per_metre: f64,
    is_rectified: bool,
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
    let camera = Camera::pinhole((said.width, said.height), [fx, fy, cx, cy], units_per_metre);
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

    fn said(model: &str, distortion: &[f64]) -> CameraMessage {
        CameraMessage {
            frame: "/camera".into(),
            width: 64,
            height: 48,
            model: model.into(),
            distortion: distortion.to_vec(),
            intrinsics: vec![60.0, 0.0, 31.5, 0.0, 61.0, 23.5, 0.0, 0.0, 1.0],
            projection: vec![58.0, 0.0, 31.0, 0.0, 0.0, 59.0, 23.0, 0.0, 0.0, 0.0, 1.0, 0.0],
        }
    }

    #[test]
    fn a_rectified_image_has_the_projection_and_no_distortion() {
        let said = said("plumb_bob", &[0.1, -0.2, 0.0, 0.0, 0.3]);
        let raw = convert(&said, 1000.0, false, "t").unwrap().camera;
        assert_eq!((raw.fx, raw.fy, raw.cx, raw.cy), (60.0, 61.0, 31.5, 23.5));
        assert_eq!(raw.distortion, [0.1, -0.2, 0.0, 0.0, 0.3]);
        let rectified = convert(&said, 1000.0, true, "t").unwrap().camera;
        assert_eq!((rectified.fx, rectified.cy, rectified.is_distorted()), (58.0, 23.0, false));
    }

    #[test]
    fn models_that_are_not_known_are_refused_unless_they_distort_nothing() {
        let plain = [0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert!(convert(&said("rational_polynomial", &plain), 1e3, false, "t").is_ok());
        assert!(convert(&said("equidistant", &[0.0; 4]), 1e3, false, "t").is_ok());
        for (model, k) in [("rational_polynomial", [0.0, 0.0, 0.0, 0.0, 0.0, 0.5]), ("equidistant", [0.1; 6])]
        {
            let words = convert(&said(model, &k), 1e3, false, "t").unwrap_err().to_string();
            assert!(words.contains(model) && words.contains("expected plumb_bob"), "{words}");
        }
        // A lens of an Azure Kinect is used as it is: the camera has none, and images are undistorted.
        let eight = [0.51, -2.65, 0.0, 0.0, 1.52, 0.39, -2.46, 1.45];
        let azure = convert(&said("rational_polynomial", &eight), 1e3, false, "t").unwrap();
        assert_eq!((azure.camera.is_distorted(), azure.lens), (false, Some(OtherLens::Rational(eight))));
        assert_eq!(azure.frame, "camera");
        let fisheye = convert(&said("equidistant", &[0.1, 0.01, 0.0, 0.0]), 1e3, false, "t").unwrap();
        assert_eq!(fisheye.lens, Some(OtherLens::Equidistant([0.1, 0.01, 0.0, 0.0])));
        let folding = [0.0, 0.0, 0.0, 0.0, 0.0, -9.0, 0.0, 0.1];
        let words = convert(&said("rational_polynomial", &folding), 1e3, false, "t").unwrap_err().to_string();
        assert!(words.contains("do not fold the image"), "{words}");
        let without = CameraMessage { intrinsics: Vec::new(), ..said("", &[]) };
        assert!(convert(&without, 1e3, false, "t").unwrap_err().to_string().contains("fx is NaN"));
    }
}
