//! The layouts of folders of images: each file knows one, by what lies in it.
//!
//! To add a layout, write its file with `is` and `read` and add a row to [`LAYOUTS`].

mod files;
mod icl_nuim;
mod open3d;
mod pose;
mod record3d;
mod replica;
mod scannet;
mod seven_scenes;
mod stray_scanner;
mod tum;
mod unread;

use super::codec::DepthCodec;
use super::list::ListEntry;
use crate::{COLOUR_NONE, SourceError, SourceOptions};
use std::path::{Path, PathBuf};
use tessera_evaluation::Trajectory;
use tessera_frames::{CameraFile, ColourCamera};
use tessera_geometry::Camera;

/// Frames a second where neither the files nor `--fps` say.
const USUAL_FPS: f64 = 30.0;
/// Frames a second that are believed.
const POSSIBLE_FPS: std::ops::RangeInclusive<f64> = 0.01..=10_000.0;
/// Entries of a folder that a message names.
const MOST_NAMED: usize = 8;

/// What was asked for beside the folder.
#[derive(Clone, Debug)]
pub(super) struct Asked {
    camera: Option<(CameraFile, String)>,
    fps: Option<f64>,
    pub(super) is_without_colour: bool,
}

impl Asked {
    pub(super) fn new(options: &SourceOptions) -> Result<Self, SourceError> {
        let given = options.camera.as_deref();
        let camera = given.map(|name| Ok::<_, SourceError>((CameraFile::named(name)?, name.to_owned())));
        if let Some(fps) = options.fps
            && !POSSIBLE_FPS.contains(&fps)
        {
            let rule = "frames a second from 0.01 to 10000";
            return Err(SourceError::Option { name: "--fps", value: fps.to_string(), rule });
        }
        let is_without_colour = options.color_topic.as_deref() == Some(COLOUR_NONE);
        Ok(Self { camera: camera.transpose()?, fps: options.fps, is_without_colour })
    }

    /// The camera given, else that of `camera.toml`, else what the layout says of itself, with where
    /// it is from.
    fn camera(
        &self,
        folder: &Path,
        own: impl FnOnce() -> Result<Option<(Camera, String)>, SourceError>,
    ) -> Result<(Camera, String), SourceError> {
        if let Some((file, from)) = self.camera_file(folder)? {
            return Ok((file.camera, from));
        }
        own()?.ok_or_else(|| SourceError::NoCamera { folder: folder.to_owned() })
    }

    /// The camera file given, else `camera.toml`, with where it is from.
    pub(super) fn camera_file(&self, folder: &Path) -> Result<Option<(CameraFile, String)>, SourceError> {
        if let Some(given) = &self.camera {
            return Ok(Some(given.clone()));
        }
        let file = folder.join("camera.toml");
        Ok(if file.exists() { Some((CameraFile::load(&file)?, "camera.toml".to_owned())) } else { None })
    }

    /// Frames a second for frames that have only a number, and what is said of it.
    fn rate(&self) -> (f64, String) {
        match self.fps {
            Some(fps) => (fps, format!("none: {fps} frames a second, as given by --fps")),
            None => (USUAL_FPS, format!("none: {USUAL_FPS} frames a second are assumed (--fps)")),
        }
    }
}

/// What a folder holds.
#[derive(Clone, Debug)]
pub(super) struct FoundLayout {
    pub(super) layout: &'static str,
    pub(super) camera: Camera,
    /// Where the camera is from, for people.
    pub(super) camera_from: String,
    pub(super) depth: Vec<ListEntry>,
    pub(super) colour: Vec<ListEntry>,
    /// `None`: colour of the size of depth is registered to it.
    pub(super) colour_camera: Option<ColourCamera>,
    /// The form of depth and confidence images.
    pub(super) codec: DepthCodec,
    /// For each depth image, or empty.
    pub(super) confidence: Vec<PathBuf>,
    pub(super) ground_truth: Option<Trajectory>,
    /// Further facts, for people.
    pub(super) notes: Vec<(&'static str, String)>,
    pub(super) warnings: Vec<String>,
    /// What speaks against the camera.
    pub(super) doubts: Vec<String>,
}

impl FoundLayout {
    fn new(
        layout: &'static str,
        (camera, camera_from): (Camera, String),
        depth: Vec<ListEntry>,
        colour: Vec<ListEntry>,
    ) -> Self {
        Self {
            layout,
            camera,
            camera_from,
            depth,
            colour,
            colour_camera: None,
            codec: DepthCodec::Png,
            confidence: Vec::new(),
            ground_truth: None,
            notes: Vec::new(),
            warnings: Vec::new(),
            doubts: Vec::new(),
        }
    }
}

/// A layout: its name, how it is recognised, and its reader.
struct FolderLayout {
    name: &'static str,
    is: fn(&Path) -> bool,
    read: fn(&Path, &Asked) -> Result<FoundLayout, SourceError>,
}

/// The more telling first: several have folders `depth` and `color`.
const LAYOUTS: [FolderLayout; 8] = [
    FolderLayout { name: tum::NAME, is: tum::is, read: tum::read },
    FolderLayout { name: icl_nuim::NAME, is: icl_nuim::is, read: icl_nuim::read },
    FolderLayout { name: seven_scenes::NAME, is: seven_scenes::is, read: seven_scenes::read },
    FolderLayout { name: replica::NAME, is: replica::is, read: replica::read },
    FolderLayout { name: stray_scanner::NAME, is: stray_scanner::is, read: stray_scanner::read },
    FolderLayout { name: record3d::NAME, is: record3d::is, read: record3d::read },
    FolderLayout { name: scannet::NAME, is: scannet::is, read: scannet::read },
    FolderLayout { name: open3d::NAME, is: open3d::is, read: open3d::read },
];

/// Whether the folder has a layout that is read.
pub(crate) fn is_known(folder: &Path) -> bool {
    LAYOUTS.iter().any(|layout| (layout.is)(folder))
}

/// Recognises a folder and reads all but its images.
///
/// # Errors
/// The layout is not known, or one of its files is not as it says.
pub(super) fn read(folder: &Path, asked: &Asked) -> Result<FoundLayout, SourceError> {
    match LAYOUTS.iter().find(|layout| (layout.is)(folder)) {
        Some(layout) => (layout.read)(folder, asked),
        None => Err(unread::folder(folder).unwrap_or_else(|| unknown(folder))),
    }
}

fn unknown(folder: &Path) -> SourceError {
    let names = files::names(folder);
    let mut there_are = names.iter().take(MOST_NAMED).cloned().collect::<Vec<String>>().join(", ");
    match names.len() {
        0 => there_are.push_str("nothing"),
        n if n > MOST_NAMED => there_are.push_str(&format!(" and {} more", n - MOST_NAMED)),
        _ => {}
    }
    let inside = names.iter().map(|name| folder.join(name)).find(|path| path.is_dir() && is_known(path));
    let hint = inside.map_or(String::new(), |path| format!("; did you mean {}?", path.display()));
    let expected = LAYOUTS.iter().map(|layout| layout.name).collect::<Vec<&str>>().join(", ");
    SourceError::NoLayout { folder: folder.to_owned(), expected, there_are, hint }
}

#[cfg(test)]
mod tests;
