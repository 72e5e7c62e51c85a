//! Camera files, and the cameras that are built in.

use crate::camera_forms::{check_lens, read_stated};
use crate::colour_camera::{ColourCamera, ColourTable};
use crate::large::check_camera;
use crate::{OtherLens, SourceError};
use serde::Deserialize;
use std::path::Path;
use tessera_evaluation::plain_text;
use tessera_geometry::Camera;

/// Names that `--camera` understands beside files.
pub const CAMERA_NAMES: [&str; 6] = ["freiburg1", "freiburg2", "freiburg3", "icl", "7scenes", "primesense"];

const TEXTS: [&str; 6] = [
    include_str!("../../../../config/cameras/freiburg1.toml"),
    include_str!("../../../../config/cameras/freiburg2.toml"),
    include_str!("../../../../config/cameras/freiburg3.toml"),
    include_str!("../../../../config/cameras/icl.toml"),
    include_str!("../../../../config/cameras/7scenes.toml"),
    include_str!("../../../../config/cameras/primesense.toml"),
];

/// What a camera file says.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraFile {
    /// The depth camera.
    pub camera: Camera,
    /// The colour camera, where the file says that it is another one.
    pub colour: Option<ColourCamera>,
    /// A lens that is to be taken out of the images (`fisheye = [k1, k2, k3, k4]`).
    pub lens: Option<OtherLens>,
    /// Whether depth images hold distances along the ray (`depth = "distance"`).
    pub is_distance: bool,
    /// What the file does not state and is assumed, as a sentence.
    pub assumed: Option<String>,
}

/// Units of depth where a camera file of another program has none: millimetres.
pub const USUAL_UNITS_PER_METRE: f64 = 1000.0;

impl CameraFile {
    /// A built-in camera by name, or a camera file.
    ///
    /// # Errors
    /// No such name or file, or a file that is not a camera.
    pub fn named(name_or_file: &str) -> Result<Self, SourceError> {
        let known = CAMERA_NAMES.iter().zip(TEXTS).find(|(name, _)| **name == name_or_file);
        if let Some((_, text)) = known {
            return Self::parse(text, name_or_file);
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
        let is_ours = path.extension().is_none_or(|end| end.eq_ignore_ascii_case("toml"));
        if !is_ours {
            return Self::load_other(path);
        }
        let bytes =
            std::fs::read(path).map_err(|source| SourceError::Io { path: path.to_owned(), source })?;
        Self::parse(&plain_text(&bytes), &path.display().to_string())
    }

    /// A camera file of another program.
    fn load_other(path: &Path) -> Result<Self, SourceError> {
        let file = path.display().to_string();
        let wrong =
            |message: &str| SourceError::CameraFile { file: file.clone(), message: message.to_owned() };
        let stated = read_stated(path)?.ok_or_else(|| {
            wrong("no camera in it, expected camera.toml, ROS camera_info, ORB-SLAM settings, Open3D JSON or COLMAP cameras.txt")
        })?;
        let Some(size) = stated.size else {
            return Err(wrong(
                "it states no image size: write a camera.toml with width, height, fx, fy, cx, cy, units_per_metre",
            ));
        };
        let camera = stated.camera(size, USUAL_UNITS_PER_METRE, &file)?;
        let assumed = stated.units_per_metre.is_none().then(|| {
            format!("{file} states no depth units: {USUAL_UNITS_PER_METRE} a metre are assumed (units_per_metre in a camera.toml)")
        });
        Ok(Self { camera, colour: None, lens: stated.lens, is_distance: false, assumed })
    }

    fn parse(text: &str, file: &str) -> Result<Self, SourceError> {
        let wrong = |error: toml::de::Error| SourceError::CameraFile {
            file: file.to_owned(),
            message: error.to_string().trim_end().to_owned(),
        };
        let tables: CameraFileTables = toml::from_str(text).map_err(wrong)?;
        let camera: Camera = match (&tables.colour, &tables.depth, &tables.fisheye) {
            (None, None, None) => toml::from_str(text).map_err(wrong)?,
            _ => {
                let mut keys: toml::Table = toml::from_str(text).map_err(wrong)?;
                keys.remove("colour");
                keys.remove("depth");
                keys.remove("fisheye");
                Camera::deserialize(keys).map_err(wrong)?
            }
        };
        check_camera(&camera).map_err(|source| SourceError::CameraValue { file: file.to_owned(), source })?;
        let lens = tables.fisheye.map(OtherLens::Equidistant);
        if lens.is_some() && camera.is_distorted() {
            let message = "distortion and fisheye, expected one lens".to_owned();
            return Err(SourceError::CameraFile { file: file.to_owned(), message });
        }
        check_lens(lens.as_ref(), &camera, file)?;
        let colour = tables.colour.map(|table| table.camera(file)).transpose()?;
        let is_distance = matches!(tables.depth, Some(DepthMeaning::Distance));
        Ok(Self { camera, colour, lens, is_distance, assumed: None })
    }

    /// The same for frames that are taken as they come: not reduced, and with depth along the optical axis.
    ///
    /// # Errors
    /// The images are too large, or depth is the distance along the ray.
    pub fn as_it_is(self, file: &str) -> Result<Self, SourceError> {
        self.camera.check().map_err(|source| SourceError::CameraValue { file: file.to_owned(), source })?;
        let message = match (self.is_distance, &self.lens) {
            (true, _) => "depth is \"distance\", expected \"z\" here",
            (false, Some(_)) => "the lens is one that is taken out of images, expected rectified images here",
            (false, None) => return Ok(self),
        };
        let message = format!("{message}: only folders and recordings are converted");
        Err(SourceError::CameraFile { file: file.to_owned(), message })
    }
}

/// The tables of a camera file beside its own keys.
#[derive(Deserialize)]
struct CameraFileTables {
    colour: Option<ColourTable>,
    depth: Option<DepthMeaning>,
    /// After Kannala and Brandt.
    fisheye: Option<[f64; 4]>,
}

/// What the values of depth images are: the key `depth`.
#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum DepthMeaning {
    /// Along the optical axis.
    Z,
    /// Along the ray of the pixel.
    Distance,
}

/// The depth camera of [`CameraFile::named`].
///
/// # Errors
/// As there.
pub fn named_camera(name_or_file: &str) -> Result<Camera, SourceError> {
    Ok(CameraFile::named(name_or_file)?.as_it_is(name_or_file)?.camera)
}

/// The depth camera of [`CameraFile::load`].
///
/// # Errors
/// As there.
pub fn load_camera(path: &Path) -> Result<Camera, SourceError> {
    Ok(CameraFile::load(path)?.as_it_is(&path.display().to_string())?.camera)
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
            (good.replace("width = 640", "width = 16400"), "image size is 16400x480 px"),
            (format!("{good}\ndepth = \"radial\""), "unknown variant `radial`"),
        ];
        for (text, expected) in table {
            let found = message(&text);
            assert!(found.starts_with("camera.toml: ") && found.contains(expected), "{found}");
        }
    }

    #[test]
    fn depth_may_be_the_distance_along_the_ray() {
        let parse = |depth: &str| CameraFile::parse(&format!("{depth}{}", TEXTS[2]), "camera.toml").unwrap();
        let file = parse("depth = \"distance\"\n");
        assert!(file.is_distance && !parse("depth = \"z\"\n").is_distance && !parse("").is_distance);
        assert!(file.as_it_is("a").unwrap_err().to_string().contains("depth is \"distance\""));
    }

    #[test]
    fn a_fisheye_is_four_coefficients() {
        let parse = |line: &str| CameraFile::parse(&format!("{line}{}", TEXTS[2]), "camera.toml");
        let file = parse("fisheye = [0.1, 0.02, 0.0, 0.0]\n").unwrap();
        assert_eq!(file.lens, Some(OtherLens::Equidistant([0.1, 0.02, 0.0, 0.0])));
        assert!(file.as_it_is("a").unwrap_err().to_string().contains("expected rectified images here"));
        let message = parse("fisheye = [-9.0, 0.0, 0.0, 0.0]\n").unwrap_err().to_string();
        assert!(message.contains("folds the image"), "{message}");
        let message = parse("fisheye = [0.1, 0.0, 0.0, 0.0]\ndistortion = [0.1, 0.0, 0.0, 0.0, 0.0]\n");
        assert!(message.unwrap_err().to_string().contains("distortion and fisheye, expected one lens"));
    }

    #[test]
    fn camera_files_of_other_programs_are_read_with_what_they_do_not_state() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cameras.txt");
        std::fs::write(&path, "1 PINHOLE 2048 1536 1500 1500 1024 768\n").unwrap();
        let file = CameraFile::named(&path.display().to_string()).unwrap();
        assert_eq!((file.camera.fx, file.camera.cx, file.camera.units_per_metre), (1500.0, 1023.5, 1000.0));
        assert!(file.assumed.unwrap().contains("states no depth units: 1000 a metre are assumed"));
        let message = load_camera(&path).unwrap_err().to_string();
        assert!(message.contains("image size is 2048x1536 px"), "{message}");
        for (text, expected) in
            [("615 0 321 0 616 244 0 0 1", "states no image size"), ("words", "no camera in it")]
        {
            std::fs::write(&path, text).unwrap();
            let message = CameraFile::load(&path).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
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
