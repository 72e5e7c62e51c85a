//! The layouts of folders of images: each file knows one, by what lies in it.
//!
//! To add a layout, write its file with `is` and `read` and add a row to [`LAYOUTS`].

mod asked;
mod beside;
mod files;
mod guess;
mod icl_nuim;
mod intrinsics;
mod nerf;
mod open3d;
mod polycam;
mod pose;
mod record3d;
mod replica;
mod scannet;
mod seven_scenes;
mod stray_scanner;
mod times;
mod truth;
mod tum;
mod unread;
mod video_beside;

use super::codec::DepthCodec;
use super::list::ListEntry;
use super::video::Video;
use crate::SourceError;
pub(super) use asked::Asked;
use asked::ChosenCamera;
pub(super) use files::{is_hidden, names};
pub(crate) use pose::from_matrix as pose_of_matrix;
pub(super) use record3d::{is_recording, read_files as read_record3d};
use std::path::{Path, PathBuf};
use tessera_evaluation::Trajectory;
use tessera_frames::{ColourCamera, OtherLens};
use tessera_geometry::Camera;

/// Entries of a folder that a message names.
const MOST_NAMED: usize = 8;

/// Entries of a folder that are looked into for one that is known.
const MOST_LOOKED_AT: usize = 64;

/// What a folder holds.
#[derive(Clone, Debug)]
pub(super) struct FoundLayout {
    pub(super) layout: &'static str,
    pub(super) camera: Camera,
    /// Where the camera is from, for people.
    pub(super) camera_from: String,
    /// A lens that is to be taken out of the images.
    pub(super) lens: Option<OtherLens>,
    pub(super) depth: Vec<ListEntry>,
    pub(super) colour: Vec<ListEntry>,
    /// The video that colour is in.
    pub(super) video: Option<Video>,
    /// Why there is no colour, where that is known.
    pub(super) no_colour: Option<String>,
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
        chosen: ChosenCamera,
        depth: Vec<ListEntry>,
        colour: Vec<ListEntry>,
    ) -> Self {
        Self {
            layout,
            camera: chosen.camera,
            camera_from: chosen.from,
            lens: chosen.lens,
            depth,
            colour,
            video: None,
            no_colour: None,
            colour_camera: None,
            codec: DepthCodec::Png,
            confidence: Vec::new(),
            ground_truth: None,
            notes: Vec::new(),
            warnings: chosen.assumed,
            doubts: chosen.doubts,
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
const LAYOUTS: [FolderLayout; 10] = [
    FolderLayout { name: tum::NAME, is: tum::is, read: tum::read },
    FolderLayout { name: icl_nuim::NAME, is: icl_nuim::is, read: icl_nuim::read },
    FolderLayout { name: seven_scenes::NAME, is: seven_scenes::is, read: seven_scenes::read },
    FolderLayout { name: replica::NAME, is: replica::is, read: replica::read },
    FolderLayout { name: stray_scanner::NAME, is: stray_scanner::is, read: stray_scanner::read },
    FolderLayout { name: record3d::NAME, is: record3d::is, read: record3d::read },
    FolderLayout { name: nerf::NAME, is: nerf::is, read: nerf::read },
    FolderLayout { name: polycam::NAME, is: polycam::is, read: polycam::read },
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
        n if n > MOST_NAMED => {
            there_are.push_str(&format!(" and {} more", n.saturating_sub(MOST_NAMED)));
        }
        _ => {}
    }
    let hint = match known_inside(folder) {
        Some(path) => format!("; did you mean {}?", path.display()),
        None => in_one_folder(folder, &names).unwrap_or_default(),
    };
    let expected = LAYOUTS.iter().map(|layout| layout.name).collect::<Vec<&str>>().join(", ");
    SourceError::NoLayout { folder: folder.to_owned(), expected, there_are, hint }
}

/// A folder inside whose layout is known, as far as two down.
fn known_inside(folder: &Path) -> Option<PathBuf> {
    let inside = |folder: &Path| -> Vec<PathBuf> {
        let names = files::names(folder).into_iter().take(MOST_LOOKED_AT);
        names.map(|name| folder.join(name)).filter(|path| path.is_dir()).collect()
    };
    let first = inside(folder);
    let second = first.iter().flat_map(|path| inside(path));
    first.iter().cloned().chain(second).find(|path| is_known(path))
}

/// The commands that list images of depth and colour which lie side by side.
fn in_one_folder(folder: &Path, names: &[String]) -> Option<String> {
    let pattern = |words: &[&str]| {
        let is_of = |name: &&String, word: &str| {
            let name = name.to_lowercase();
            name.contains(word)
                && [".png", ".jpg", ".tif", ".tiff", ".npy", ".pgm", ".exr"]
                    .iter()
                    .any(|end| name.ends_with(end))
        };
        words.iter().find_map(|word| {
            let name = names.iter().find(|name| is_of(name, word))?;
            let end = name.rsplit_once('.').map_or("", |(_, end)| end);
            let at = name.to_lowercase().find(word)?;
            Some(format!("*{}*.{end}", name.get(at..at.saturating_add(word.len()))?))
        })
    };
    let listed = |pattern: String, list: &str| {
        format!("ls -v {pattern} | awk '{{printf \"%.6f %s\\n\", (NR-1)/30, $0}}' > {list}")
    };
    let depth = listed(pattern(&["depth"])?, "depth.txt");
    let colour = pattern(&["color", "colour", "rgb"]).map(|pattern| listed(pattern, "rgb.txt"));
    let commands = std::iter::once(depth).chain(colour).collect::<Vec<String>>().join("; ");
    Some(format!(
        "; images of depth and colour in one folder are listed, at 30 a second, by: cd '{}' && {commands}",
        folder.display()
    ))
}

#[cfg(test)]
mod tests;
