//! ScanNet as its exporter writes it: `depth/0.png` in millimetres, `color/0.jpg`, `pose/0.txt`
//! (camera to world, `-inf` where it is not known), `intrinsic/intrinsic_depth.txt` and
//! `intrinsic_color.txt`. Colour is larger than depth and seen from the same place.

use super::asked::ChosenCamera;
use super::files::{numbered, numbers, pinhole, size_of, some_depth, text};
use super::times::FrameTimes;
use super::{Asked, FoundLayout, pose};
use crate::SourceError;
use std::path::Path;
use tessera_frames::ColourCamera;
use tessera_geometry::{Camera, Pose};

pub(super) const NAME: &str = "ScanNet (depth/, pose/, intrinsic/)";

const DEPTH_CAMERA: &str = "intrinsic/intrinsic_depth.txt";
const COLOUR_CAMERA: &str = "intrinsic/intrinsic_color.txt";
const UNITS_PER_METRE: f64 = 1000.0;

pub(super) fn is(folder: &Path) -> bool {
    folder.join("depth").is_dir() && folder.join(DEPTH_CAMERA).is_file()
}

pub(super) fn read(folder: &Path, asked: &Asked) -> Result<FoundLayout, SourceError> {
    let images = numbered(folder, "depth", "", &[".png"]);
    let times = FrameTimes::of(&images, asked, None, folder)?;
    let depth = some_depth(times.entries(&images), folder, "depth/NUMBER.png")?;
    let colour = times.entries(&numbered(folder, "color", "", &[".jpg", ".png"]));
    let camera = asked.camera(folder, || {
        let camera = intrinsics(&folder.join(DEPTH_CAMERA), size_of(folder, &depth)?)?;
        Ok(ChosenCamera::stated(camera, DEPTH_CAMERA))
    })?;
    let file = |number: u64| folder.join(format!("pose/{number}.txt"));
    let mut found = FoundLayout::new(NAME, camera, depth, colour);
    found.take_truth(pose::of_files(images.iter().map(|image| image.number), &times, file));
    let colour_file = folder.join(COLOUR_CAMERA);
    if colour_file.is_file() {
        // Its size is that of the images.
        let camera = intrinsics(&colour_file, (1296, 968))?;
        found.colour_camera = Some(ColourCamera { camera, colour_from_depth: Pose::identity() });
    }
    found.notes.push(("times", times.words));
    Ok(found)
}

/// A camera from a 4x4 matrix whose upper left is the intrinsic matrix.
fn intrinsics(path: &Path, size: (u32, u32)) -> Result<Camera, SourceError> {
    let m = numbers(&text(path)?, path)?;
    let &[fx, _, cx, _, _, fy, cy, ..] = pose::matrix(&m, path)?;
    pinhole(size, [fx, fy, cx, cy], UNITS_PER_METRE, path)
}
