//! Camera files, and the cameras that are built in.

use crate::SourceError;
use std::path::Path;
use tessera_geometry::Camera;

/// Names that `--camera` understands beside files.
pub const CAMERA_NAMES: [&str; 4] = ["freiburg1", "freiburg2", "freiburg3", "icl"];

const TEXTS: [&str; 4] = [
    include_str!("../../../../config/cameras/freiburg1.toml"),
    include_str!("../../../../config/cameras/freiburg2.toml"),
    include_str!("../../../../config/cameras/freiburg3.toml"),
    include_str!("../../../../config/cameras/icl.toml"),
];

/// A built-in camera by name, or a camera file.
///
/// # Errors
/// No such name or file, or a file that is not a camera.
pub fn named_camera(name_or_file: &str) -> Result<Camera, SourceError> {
    if let Some(at) = CAMERA_NAMES.iter().position(|name| *name == name_or_file) {
        return parse_camera(TEXTS[at], name_or_file);
    }
    let path = Path::new(name_or_file);
    if !path.is_file() {
        return Err(SourceError::UnknownCamera { found: name_or_file.to_owned() });
    }
    load_camera(path)
}

/// Reads and checks a camera file.
///
/// # Errors
/// Names the file and the key, what was found and expected.
pub fn load_camera(path: &Path) -> Result<Camera, SourceError> {
    let text =
        std::fs::read_to_string(path).map_err(|source| SourceError::Io { path: path.to_owned(), source })?;
    parse_camera(&text, &path.display().to_string())
}

fn parse_camera(text: &str, file: &str) -> Result<Camera, SourceError> {
    let camera: Camera = toml::from_str(text).map_err(|error| SourceError::CameraFile {
        file: file.to_owned(),
        message: error.to_string().trim_end().to_owned(),
    })?;
    camera.check().map_err(|source| SourceError::CameraValue { file: file.to_owned(), source })?;
    Ok(camera)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &str) -> String {
        parse_camera(text, "camera.toml").unwrap_err().to_string()
    }

    #[test]
    fn every_built_in_camera_loads() {
        for name in CAMERA_NAMES {
            let camera = named_camera(name).unwrap();
            assert_eq!((camera.width, camera.height), (640, 480), "{name}");
        }
        assert!(named_camera("icl").unwrap().fy < 0.0);
        assert!(named_camera("freiburg1").unwrap().is_distorted());
    }

    #[test]
    fn a_camera_that_is_not_there_is_answered_with_what_there_is() {
        let message = named_camera("kinect").unwrap_err().to_string();
        assert!(message.contains("no camera 'kinect'") && message.contains("freiburg1"), "{message}");
    }

    #[test]
    fn a_bad_file_is_named_with_its_key() {
        let good = TEXTS[2];
        let table = [
            (good.replace("fx = 535.4", ""), "missing field `fx`"),
            (good.replace("fx = 535.4", "fx = 0.0"), "fx is 0, expected a finite number other than 0"),
            (good.replace("fx = 535.4", "fx = nan"), "fx is NaN"),
            (good.replace("fx = 535.4", "fx = \"wide\""), "invalid type: string \"wide\""),
            (format!("{good}\nfocal = 3.0"), "unknown field `focal`"),
            (good.replace("width = 640", "width = 6400"), "image size is 6400x480 px"),
        ];
        for (text, expected) in table {
            let found = message(&text);
            assert!(found.starts_with("camera.toml: ") && found.contains(expected), "{found}");
        }
    }
}
