//! 7-Scenes: `frame-000000.depth.png` (of 3RScan `.depth.pgm`) in millimetres (65535: no measurement), `.color.png` and
//! `.pose.txt`, a 4x4 camera-to-world matrix. BundleFusion and 3DMatch name their images so too, and put
//! their camera beside them (`info.txt`, `_info.txt`, `camera-intrinsics.txt`), or above the folders `seq-01` of a
//! scene; the camera of 7-Scenes is assumed in its own folders alone.

use super::asked::ChosenCamera;
use super::beside::camera_above;
use super::files::{numbered, size_of, some_depth};
use super::times::FrameTimes;
use super::{Asked, FoundLayout, pose};
use crate::SourceError;
use std::path::{Path, PathBuf};
use tessera_frames::cameras::named_camera;

pub(super) const NAME: &str = "7-Scenes (frame-000000.depth.png)";

const PREFIX: &str = "frame-";
const DEPTH: &[&str] = &[".depth.png", ".depth.pgm"];
const UNITS_PER_METRE: f64 = 1000.0;
/// Its scenes, which hold folders `seq-01`.
const SCENES: [&str; 7] = ["chess", "fire", "heads", "office", "pumpkin", "redkitchen", "stairs"];

pub(super) fn is(folder: &Path) -> bool {
    !numbered(folder, "", PREFIX, DEPTH).is_empty()
}

pub(super) fn read(folder: &Path, asked: &Asked) -> Result<FoundLayout, SourceError> {
    let images = numbered(folder, "", PREFIX, DEPTH);
    let unset = super::files::unset(&images);
    let chosen = asked.camera_or_beside(folder, &unset, UNITS_PER_METRE, || {
        if is_sequence(&absolute(folder))
            && let Some(chosen) = camera_above(folder, &unset, UNITS_PER_METRE)?
        {
            return Ok(Some(chosen));
        }
        let camera = named_camera("7scenes")?;
        let is_it = is_of_seven_scenes(folder) && size_of(folder, &unset)? == (camera.width, camera.height);
        Ok(is_it.then(|| ChosenCamera::assumed(camera, "that of 7-Scenes, 585 px")))
    })?;
    let times = FrameTimes::of(&images, asked, chosen.fps, folder)?;
    let depth = some_depth(times.entries(&images), folder, "frame-NUMBER.depth.png")?;
    let colour = times.entries(&numbered(folder, "", PREFIX, &[".color.png", ".color.jpg"]));
    let mut found = FoundLayout::new(NAME, chosen, depth, colour);
    let file = |number: u64| folder.join(format!("{PREFIX}{number:06}.pose.txt"));
    found.take_truth(pose::of_files(images.iter().map(|image| image.number), &times, file));
    found.notes.push(("times", times.words));
    Ok(found)
}

fn absolute(folder: &Path) -> PathBuf {
    std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned())
}

/// Whether the folder is `seq-01`.
fn is_sequence(folder: &Path) -> bool {
    folder.file_name().is_some_and(|name| {
        let name = name.to_string_lossy().to_lowercase();
        name.strip_prefix("seq-")
            .or(name.strip_prefix("seq"))
            .is_some_and(|number| number.parse::<u32>().is_ok())
    })
}

/// Whether the folder is `seq-01`, or in a folder with the name of one of the scenes.
fn is_of_seven_scenes(folder: &Path) -> bool {
    let absolute = absolute(folder);
    let is_scene = |path: &Path| {
        path.file_name().is_some_and(|name| SCENES.contains(&name.to_string_lossy().to_lowercase().as_str()))
    };
    is_sequence(&absolute) || is_scene(&absolute) || absolute.parent().is_some_and(is_scene)
}
