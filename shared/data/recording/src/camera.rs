//! The camera of a recording, from its CameraInfo or CameraCalibration.

use crate::UNITS_OF_METRES;
use crate::chunks::{Chunks, Spot};
use crate::error::{MessageError, RecordingError};
use crate::messages::{self, CameraMessage, ImageForm};
use crate::rational::RationalLens;
use crate::topics::Topics;
use tessera_geometry::Camera;

/// Units of 16-bit depth in ROS: millimetres (REP 118).
const UNITS_OF_MILLIMETRES: f64 = 1000.0;

/// Reads the camera that belongs to the depth topic.
pub(super) fn read(
    chunks: &Chunks,
    topics: &Topics,
    camera_at: Option<&Spot>,
    first_depth: &Spot,
) -> Result<Camera, RecordingError> {
    let missing = || RecordingError::NoCamera { topic: topics.depth.clone() };
    let (spot, topic) = camera_at.zip(topics.camera.as_ref()).ok_or_else(missing)?;
    let message = |problem: MessageError, topic: &str| RecordingError::Message {
        topic: topic.to_owned(),
        number: 1,
        problem,
    };
    let data = chunks.read(spot)?;
    let said = messages::camera(spot.kind, &data).map_err(|problem| message(problem, topic))?;
    let data = chunks.read(first_depth)?;
    let image =
        messages::image(first_depth.kind, &data).map_err(|problem| message(problem, &topics.depth))?;
    let is_metres = match &image.form {
        ImageForm::Raw { encoding, .. } => encoding == "32FC1",
        ImageForm::File { format } => format.starts_with("32FC1"),
    };
    let units_per_metre = if is_metres { UNITS_OF_METRES } else { UNITS_OF_MILLIMETRES };
    convert(&said, units_per_metre, topics.depth.contains("rect"), topic)
}

/// Our camera. The images of a rectified topic have the projection's numbers and no distortion.
fn convert(
    said: &CameraMessage,
    units_per_metre: f64,
    is_rectified: bool,
    topic: &str,
) -> Result<Camera, RecordingError> {
    let number = |from: &[f64], at: usize| from.get(at).copied().unwrap_or(f64::NAN);
    let has_projection = number(&said.projection, 0) > 0.0;
    let (fx, fy, cx, cy) = if is_rectified && has_projection {
        let p = &said.projection;
        (number(p, 0), number(p, 5), number(p, 2), number(p, 6))
    } else {
        let k = &said.intrinsics;
        (number(k, 0), number(k, 4), number(k, 2), number(k, 5))
    };
    let camera = Camera {
        width: said.width,
        height: said.height,
        fx,
        fy,
        cx,
        cy,
        units_per_metre,
        distortion: [0.0; 5],
        readout_s: 0.0,
        depth_offset_m: 0.0,
        colour_registered: true,
    };
    let wrong = |source| RecordingError::Camera { topic: topic.to_owned(), source };
    camera.check().map_err(wrong)?;
    let is_distorted = said.distortion.iter().any(|&d| d != 0.0);
    if !is_distorted || (is_rectified && has_projection) {
        return Ok(camera);
    }
    let distortion = distortion(said, &camera, topic)?;
    let camera = Camera { distortion, ..camera };
    camera.check().map_err(wrong)?;
    Ok(camera)
}

/// The coefficients of the lens that a message has with the other numbers of `camera`.
fn distortion(said: &CameraMessage, camera: &Camera, topic: &str) -> Result<[f64; 5], RecordingError> {
    let is_known = matches!(said.model.as_str(), "plumb_bob" | "rational_polynomial" | "");
    // A rational polynomial whose denominator is 1 is the plain one.
    let has_more = said.distortion.iter().skip(5).any(|&d| d != 0.0);
    if !is_known || has_more {
        let eight = <[f64; 8]>::try_from(said.distortion.as_slice()).ok();
        let lens = eight.filter(|_| is_known).map(RationalLens);
        return Err(RecordingError::Distortion {
            topic: topic.to_owned(),
            model: said.model.clone(),
            found: said.distortion.clone(),
            fit: lens.and_then(|lens| lens.fit(camera)).map(Box::new),
        });
    }
    let mut distortion = [0.0; 5];
    for (to, from) in distortion.iter_mut().zip(&said.distortion) {
        *to = *from;
    }
    Ok(distortion)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(model: &str, distortion: &[f64]) -> CameraMessage {
        CameraMessage {
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
        let raw = convert(&said, 1000.0, false, "t").unwrap();
        assert_eq!((raw.fx, raw.fy, raw.cx, raw.cy), (60.0, 61.0, 31.5, 23.5));
        assert_eq!(raw.distortion, [0.1, -0.2, 0.0, 0.0, 0.3]);
        let rectified = convert(&said, 1000.0, true, "t").unwrap();
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
        // A colour camera of an Azure Kinect; five coefficients are not enough for it, and it says so.
        let eight = [0.51, -2.65, 0.0, 0.0, 1.52, 0.39, -2.46, 1.45];
        let words = convert(&said("rational_polynomial", &eight), 1e3, false, "t").unwrap_err().to_string();
        assert!(
            words.contains("with five of its own: the nearest, distortion = [0.")
                && words.contains(" px at most"),
            "{words}"
        );
        let without = CameraMessage { intrinsics: Vec::new(), ..said("", &[]) };
        assert!(convert(&without, 1e3, false, "t").unwrap_err().to_string().contains("fx is NaN"));
    }
}
