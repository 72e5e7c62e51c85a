//! The colour camera, where it is another one than that of depth: as a camera file describes it.

use crate::SourceError;
use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use serde::Deserialize;
use tessera_geometry::{Camera, Pose};

/// The camera of colour images beside that of depth.
#[derive(Clone, Debug, PartialEq)]
pub struct ColourCamera {
    /// Its lens and the size of its images; its units of depth mean nothing.
    pub camera: Camera,
    /// From points of the depth camera to the colour camera, metres.
    pub colour_from_depth: Pose,
}

/// The table `[colour]` of a camera file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ColourTable {
    width: u32,
    height: u32,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    #[serde(default)]
    distortion: [f64; 5],
    /// `tx ty tz qx qy qz qw`, metres and a unit quaternion.
    #[serde(default = "at_one_place")]
    colour_from_depth: [f64; 7],
}

fn at_one_place() -> [f64; 7] {
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
}

/// How far a quaternion's length may be from 1: files round.
const UNIT_TOLERANCE: f64 = 1e-3;
/// Distance of the two cameras at most, metres: beyond, it is in other units.
const MOST_APART_M: f64 = 1.0;

impl ColourTable {
    /// The camera that the table of `file` describes.
    ///
    /// # Errors
    /// Names the file, the key, what was found and expected.
    pub(crate) fn camera(&self, file: &str) -> Result<ColourCamera, SourceError> {
        let file = format!("{file}, [colour]");
        let Self { width, height, fx, fy, cx, cy, distortion, .. } = *self;
        let camera = Camera { distortion, ..Camera::pinhole((width, height), [fx, fy, cx, cy], 1000.0) };
        // Colour images may be larger than depth images may.
        let checked = Camera { width: width.min(1920), height: height.min(1080), ..camera.clone() };
        checked.check().map_err(|source| SourceError::CameraValue { file: file.clone(), source })?;
        let [x, y, z, qx, qy, qz, qw] = self.colour_from_depth;
        let (position_m, rotation) = (Translation3::new(x, y, z), Quaternion::new(qw, qx, qy, qz));
        let distance_m = position_m.vector.norm();
        let wrong = |found: String, expected: &str| {
            let message = format!("colour_from_depth {found}, expected {expected}");
            Err(SourceError::CameraFile { file: file.clone(), message })
        };
        if !((rotation.norm() - 1.0).abs() < UNIT_TOLERANCE) {
            return wrong(
                format!("ends in a quaternion of length {:.4}", rotation.norm()),
                "qx qy qz qw of length 1",
            );
        }
        if !(distance_m <= MOST_APART_M) {
            return wrong(
                format!("puts the cameras {distance_m:.3} m apart"),
                "at most 1 m (tx ty tz are metres)",
            );
        }
        let colour_from_depth = Pose::from_parts(position_m, UnitQuaternion::new_normalize(rotation));
        Ok(ColourCamera { camera, colour_from_depth })
    }
}
