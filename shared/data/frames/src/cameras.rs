//! Camera files, and the cameras that are built in.

use crate::SourceError;
use crate::colour_camera::{ColourCamera, ColourTable};
use serde::Deserialize;
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

/// What a camera file says.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraFile {
    /// The depth camera.
    pub camera: Camera,
    /// The colour camera, where the file says that it is another one.
    pub colour: Option<ColourCamera>,
}

impl CameraFile {
    /// A built-in camera by name, or a camera file.
    ///
    /// # Errors
    /// No such name or file, or a file that is not a camera.
    pub fn named(name_or_file: &str) -> Result<Self, SourceError> {
        if let Some(at) = CAMERA_NAMES.iter().position(|name| *name == name_or_file) {
            return Self::parse(TEXTS[at], name_or_file);
        }
        let path = Path::new(name_or_file);
        if !path.is_file() {
            return Err(SourceError::UnknownCamera { found: name_or_file.to_owned() });
        }
        Self::load(path)
    }

    /// Reads and checks a camera file.
    ///
    /// # Errors
    /// Names the file and the key, what was found and expected.
    pub fn load(path: &Path) -> Result<Self, SourceError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| SourceError::Io { path: path.to_owned(), source })?;
        Self::parse(&text, &path.display().to_string())
    }

    fn parse(text: &str, file: &str) -> Result<Self, SourceError> {
        let wrong = |error: toml::de::Error| SourceError::CameraFile {
            file: file.to_owned(),
            message: error.to_string().trim_end().to_owned(),
        };
        let tables: CameraFileTables = toml::from_str(text).map_err(wrong)?;
        let camera: Camera = match &tables.colour {
            None => toml::from_str(text).map_err(wrong)?,
            Some(_) => {
                let mut keys: toml::Table = toml::from_str(text).map_err(wrong)?;
                keys.remove("colour");
                Camera::deserialize(keys).map_err(wrong)?
            }
        };
        camera.check().map_err(|source| SourceError::CameraValue { file: file.to_owned(), source })?;
        let colour = tables.colour.map(|table| table.camera(file)).transpose()?;
        Ok(Self { camera, colour })
    }
}

/// The tables of a camera file beside its own keys.
#[derive(Deserialize)]
struct CameraFileTables {
    colour: Option<ColourTable>,
}

/// The depth camera of [`CameraFile::named`].
///
/// # Errors
/// As there.
pub fn named_camera(name_or_file: &str) -> Result<Camera, SourceError> {
    Ok(CameraFile::named(name_or_file)?.camera)
}

/// The depth camera of [`CameraFile::load`].
///
/// # Errors
/// As there.
pub fn load_camera(path: &Path) -> Result<Camera, SourceError> {
    Ok(CameraFile::load(path)?.camera)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &str) -> String {
        CameraFile::parse(text, "camera.toml").unwrap_err().to_string()
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

    #[test]
    fn the_colour_camera_is_a_table_of_its_own() {
        let depth = TEXTS[2];
        let lens = "[colour]\nwidth = 1280\nheight = 720\nfx = 900.0\nfy = 901.0\ncx = 640.0\ncy = 360.0\n";
        let place = "colour_from_depth = [0.015, 0.0, -0.001, 0.0, 0.0, 0.7071068, 0.7071068]";
        let file = CameraFile::parse(&format!("{depth}\n{lens}{place}"), "camera.toml").unwrap();
        assert_eq!(file.camera, CameraFile::parse(depth, "camera.toml").unwrap().camera);
        let colour = file.colour.unwrap();
        assert_eq!((colour.camera.width, colour.camera.fy), (1280, 901.0));
        let seen = colour.colour_from_depth * nalgebra::Point3::new(1.0, 0.0, 2.0);
        assert!((seen - nalgebra::Point3::new(0.015, 1.0, 1.999)).norm() < 1e-6, "{seen}");
        let file = CameraFile::parse(&format!("{depth}\n{lens}"), "camera.toml").unwrap();
        assert_eq!(file.colour.unwrap().colour_from_depth, tessera_geometry::Pose::identity());
        let table = [
            (lens.replace("fx = 900.0\n", ""), "missing field `fx`"),
            (lens.replace("fx = 900.0", "fx = 0.0"), "camera.toml, [colour]: focal length fx is 0"),
            (format!("{lens}focal = 1.0"), "unknown field `focal`"),
            (format!("{lens}{}", place.replace("0.7071068]", "0.9]")), "quaternion of length 1.1446"),
            (format!("{lens}{}", place.replace("[0.015", "[15.0")), "15.000 m apart, expected at most 1 m"),
        ];
        for (colour, expected) in table {
            let found = message(&format!("{depth}\n{colour}"));
            assert!(found.starts_with("camera.toml") && found.contains(expected), "{found}");
        }
        // What is wrong with the depth camera is said as well.
        let found = message(&format!("{}\n{lens}", depth.replace("fx = 535.4", "fx = 0.0")));
        assert!(found.contains("camera.toml: focal length fx is 0"), "{found}");
    }
}
