//! 7-Scenes: `frame-000000.depth.png` in millimetres (65535: no measurement), `.color.png` and
//! `.pose.txt`, a 4x4 camera-to-world matrix. The camera is that of its page: 585 px, middle 320, 240.

use super::files::{at_rate, numbered, pinhole, size_of, some_depth, wrong};
use super::{Asked, FoundLayout, pose};
use crate::SourceError;
use std::path::Path;
use tessera_geometry::Camera;

pub(super) const NAME: &str = "7-Scenes (frame-000000.depth.png)";

const PREFIX: &str = "frame-";
const DEPTH: &[&str] = &[".depth.png"];
/// Focal lengths and principal point, pixels.
const INTRINSICS: [f64; 4] = [585.0, 585.0, 320.0, 240.0];
/// Columns and rows.
const SIZE: (u32, u32) = (640, 480);
const UNITS_PER_METRE: f64 = 1000.0;

pub(super) fn is(folder: &Path) -> bool {
    !numbered(folder, "", PREFIX, DEPTH).is_empty()
}

pub(super) fn read(folder: &Path, asked: &Asked) -> Result<FoundLayout, SourceError> {
    let (fps, stamps) = asked.rate();
    let images = numbered(folder, "", PREFIX, DEPTH);
    let depth = some_depth(at_rate(&images, fps), folder, "frame-NUMBER.depth.png")?;
    let colour = at_rate(&numbered(folder, "", PREFIX, &[".color.png", ".color.jpg"]), fps);
    let camera = asked.camera(folder, || {
        let size = size_of(folder, &depth)?;
        if size != SIZE {
            let (width, height) = size;
            let reason =
                format!("depth is {width}x{height} px, that of 7-Scenes 640x480; give --camera FILE");
            return Err(wrong(folder, reason));
        }
        let camera = pinhole(size, INTRINSICS, UNITS_PER_METRE, folder)?;
        // The two cameras of the Kinect are a hand's breadth apart, and the images are as taken.
        let camera = Camera { colour_registered: false, ..camera };
        Ok(Some((camera, "that of 7-Scenes, 585 px".to_owned())))
    })?;
    let file = |number: u64| folder.join(format!("{PREFIX}{number:06}.pose.txt"));
    let ground_truth = pose::of_files(images.iter().map(|image| image.number), fps, file)?;
    let mut found = FoundLayout { ground_truth, ..FoundLayout::new(NAME, camera, depth, colour) };
    found.notes.push(("times", stamps));
    Ok(found)
}
