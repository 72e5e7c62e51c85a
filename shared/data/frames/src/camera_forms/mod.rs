//! Camera files of other programs: Open3D, ROS, ORB-SLAM, COLMAP, BundleFusion, 3DMatch, ETH3D, nerfstudio.
//!
//! Each form knows its own keys; none is an error as long as another form may know the file.

mod json;
mod text;
mod yaml;

use crate::{OtherLens, SourceError};
use std::path::Path;
use tessera_evaluation::plain_text;
use tessera_geometry::Camera;

/// A camera as some file states it; what it does not state is absent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StatedCamera {
    /// The form of the file, for people.
    pub form: &'static str,
    /// Columns and rows.
    pub size: Option<(u32, u32)>,
    /// `fx fy cx cy`, pixels, with the middle of the first pixel at 0.
    pub intrinsics: [f64; 4],
    /// `k1 k2 p1 p2 k3`.
    pub distortion: [f64; 5],
    /// A lens that these do not describe.
    pub lens: Option<OtherLens>,
    /// Raw depth of a metre.
    pub units_per_metre: Option<f64>,
    /// Frames a second.
    pub fps: Option<f64>,
}

impl StatedCamera {
    /// Our camera, with a size and units where the file has none.
    ///
    /// # Errors
    /// A number cannot be.
    pub fn camera(&self, size: (u32, u32), units_per_metre: f64, file: &str) -> Result<Camera, SourceError> {
        let units = self.units_per_metre.unwrap_or(units_per_metre);
        let camera = Camera::pinhole(self.size.unwrap_or(size), self.intrinsics, units);
        let camera = Camera { distortion: self.distortion, ..camera };
        crate::large::check_camera(&camera)
            .map_err(|source| SourceError::CameraValue { file: file.to_owned(), source })?;
        check_lens(self.lens.as_ref(), &camera, file)?;
        Ok(camera)
    }

    /// The same camera at another size of the same shape.
    pub fn scaled_to(&self, size: (u32, u32)) -> Option<Self> {
        let (width, height) = self.size?;
        let (sx, sy) = (f64::from(size.0) / f64::from(width), f64::from(size.1) / f64::from(height));
        const SAME_SHAPE: f64 = 0.02;
        if !((sx / sy - 1.0).abs() < SAME_SHAPE) {
            return None;
        }
        let [fx, fy, cx, cy] = self.intrinsics;
        // The middle of the first pixel is at 0, so its edge is at -0.5.
        let intrinsics = [fx * sx, fy * sy, (cx + 0.5) * sx - 0.5, (cy + 0.5) * sy - 0.5];
        Some(Self { size: Some(size), intrinsics, ..self.clone() })
    }
}

/// Refuses a lens that folds the image.
pub(crate) fn check_lens(lens: Option<&OtherLens>, camera: &Camera, file: &str) -> Result<(), SourceError> {
    match lens.filter(|lens| !lens.is_usable(camera)) {
        None => Ok(()),
        Some(lens) => Err(SourceError::CameraFile {
            file: file.to_owned(),
            message: format!(
                "the lens {lens:?} folds the image, expected a radius that grows up to its corners"
            ),
        }),
    }
}

/// Reads a camera of another program; `None`: the file is of no form that is known.
///
/// # Errors
/// The form is known, and a value of it cannot be used.
pub fn read_stated(path: &Path) -> Result<Option<StatedCamera>, SourceError> {
    const MOST_BYTES: u64 = 64 << 20;
    let io = |source| SourceError::Io { path: path.to_owned(), source };
    if std::fs::metadata(path).map_err(io)?.len() > MOST_BYTES {
        return Ok(None);
    }
    let bytes = std::fs::read(path).map_err(io)?;
    let name = path.file_name().map(|name| name.to_string_lossy().to_lowercase()).unwrap_or_default();
    parse_stated(&plain_text(&bytes), &name)
        .map_err(|message| SourceError::CameraFile { file: path.display().to_string(), message })
}

/// The depth scale, units a metre, of a JSON file that may have no camera.
pub fn read_scale(path: &Path) -> Option<f64> {
    json::scale_alone(&plain_text(&std::fs::read(path).ok()?)).ok()?
}

/// The side of an image, pixels; `None` of what cannot be one.
#[expect(clippy::cast_possible_truncation, reason = "a number from 1 to 65535")]
fn side(side: f64) -> Option<u32> {
    (1.0..=65_535.0).contains(&side).then_some(side as u32)
}

/// The text of a file of that name, in small letters.
pub(crate) fn parse_stated(text: &str, name: &str) -> Result<Option<StatedCamera>, String> {
    let stated = if name.ends_with(".json") {
        json::parse(text)
    } else if name.ends_with(".yaml") || name.ends_with(".yml") {
        yaml::parse(text)
    } else {
        text::parse(text)
    }?;
    let Some(stated) = stated else { return Ok(None) };
    for (name, value) in ["fx", "fy", "cx", "cy"].into_iter().zip(stated.intrinsics) {
        if !value.is_finite() {
            return Err(format!("{name} is {value}, expected a finite number"));
        }
    }
    Ok(Some(stated))
}

/// A depth scale as files write it: units a metre (1000), or metres a unit (0.001).
fn units_of_scale(scale: f64) -> Result<Option<f64>, String> {
    match scale {
        1.0 => Ok(None),
        scale if scale > 1.0 && scale <= 1e6 => Ok(Some(scale)),
        // As RealSense writes them: 0.00025 is a 32-bit float.
        scale if (1e-6..1.0).contains(&scale) => {
            let units = 1.0 / scale;
            let whole = units.round();
            Ok(Some(if (units - whole).abs() < 1e-5 * units { whole } else { units }))
        }
        _ => Err(format!(
            "the depth scale is {scale}, expected units a metre as 1000, or metres a unit as 0.001"
        )),
    }
}

#[cfg(test)]
mod tests;
