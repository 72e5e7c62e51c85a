//! Open3D and Redwood: `depth/` in millimetres, `color/`, `image/` or `rgb/`, a pinhole camera in
//! JSON, poses in a `.log`. Redwood's names hold times, `000012-000000400000.png`, microseconds.

use super::super::list::ListEntry;
use super::files::{names, number_nanos, pinhole, size_of, some_depth, text, wrong};
use super::{Asked, FoundLayout, pose};
use crate::SourceError;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use tessera_geometry::Camera;

pub(super) const NAME: &str = "Open3D or Redwood (depth/, color/, camera JSON)";

const COLOUR_FOLDERS: [&str; 4] = ["color", "colour", "image", "rgb"];
const UNITS_PER_METRE: f64 = 1000.0;
/// The camera of Redwood's recordings, for 640x480 px: the factory default of the PrimeSense.
const PRIMESENSE: [f64; 4] = [525.0, 525.0, 319.5, 239.5];

/// A pinhole camera as Open3D writes it; the matrix is by columns.
#[derive(Deserialize)]
struct Intrinsic {
    width: u32,
    height: u32,
    intrinsic_matrix: [f64; 9],
}

pub(super) fn is(folder: &Path) -> bool {
    folder.join("depth").is_dir() && names(&folder.join("depth")).iter().any(|name| name.ends_with(".png"))
}

pub(super) fn read(folder: &Path, asked: &Asked) -> Result<FoundLayout, SourceError> {
    let depth = images(folder, "depth", &["png"]);
    let colour_folder = COLOUR_FOLDERS.into_iter().find(|name| folder.join(name).is_dir());
    let colour = colour_folder.map_or(Vec::new(), |name| images(folder, name, &["jpg", "jpeg", "png"]));
    let has_times = !depth.is_empty() && depth.iter().chain(&colour).all(|image| image.micros.is_some());
    let (fps, stamps) = asked.rate();
    let at = |images: Vec<IntrinsicImage>| entries(images, has_times && asked.fps.is_none(), fps);
    let (depth, colour) = (some_depth(at(depth), folder, "depth/NUMBER.png")?, at(colour));
    let logs: Vec<String> = names(folder).into_iter().filter(|name| name.ends_with(".log")).collect();
    let is_redwood = has_times || !logs.is_empty();
    let camera = asked.camera(folder, || own_camera(folder, &depth, is_redwood))?;
    let mut found = FoundLayout::new(NAME, camera, depth, colour);
    // Open3D's own sample has odometry.log beside trajectory.log: motions from frame to frame.
    if let Some(log) = logs.iter().find(|name| !name.contains("odometry")) {
        let times: Vec<i64> = found.depth.iter().map(|entry| entry.stamp_nanos).collect();
        found.ground_truth = pose::of_log(&folder.join(log), &times)?;
    }
    let from_names = "microseconds in the names of the images".to_owned();
    found.notes.push(("times", if has_times && asked.fps.is_none() { from_names } else { stamps }));
    Ok(found)
}

/// An image whose name ends in a number, or in a number and microseconds.
struct IntrinsicImage {
    number: u64,
    micros: Option<u64>,
    file: PathBuf,
}

fn images(folder: &Path, sub: &str, ends: &[&str]) -> Vec<IntrinsicImage> {
    let parse = |name: &str| -> Option<IntrinsicImage> {
        let (stem, end) = name.rsplit_once('.')?;
        if !ends.iter().any(|known| known.eq_ignore_ascii_case(end)) {
            return None;
        }
        let groups: Vec<&str> =
            stem.split(|c: char| !c.is_ascii_digit()).filter(|group| !group.is_empty()).collect();
        let file = Path::new(sub).join(name);
        match groups[..] {
            [number, micros] if stem.len() == number.len() + 1 + micros.len() => Some(IntrinsicImage {
                number: number.parse().ok()?,
                micros: Some(micros.parse().ok()?),
                file,
            }),
            [.., number] => Some(IntrinsicImage { number: number.parse().ok()?, micros: None, file }),
            [] => None,
        }
    };
    names(&folder.join(sub)).iter().filter_map(|name| parse(name)).collect()
}

/// Images by time; where two have the same, the first.
fn entries(images: Vec<IntrinsicImage>, has_times: bool, fps: f64) -> Vec<ListEntry> {
    let time = |image: &IntrinsicImage| match image.micros {
        Some(micros) if has_times => i64::try_from(micros).unwrap_or(i64::MAX).saturating_mul(1000),
        _ => number_nanos(image.number, fps),
    };
    let mut entries: Vec<ListEntry> =
        images.into_iter().map(|image| ListEntry { stamp_nanos: time(&image), file: image.file }).collect();
    entries.sort_by(|a, b| (a.stamp_nanos, &a.file).cmp(&(b.stamp_nanos, &b.file)));
    entries.dedup_by_key(|entry| entry.stamp_nanos);
    entries
}

/// The first JSON file with a pinhole camera; for Redwood without one the camera of its page.
fn own_camera(
    folder: &Path,
    depth: &[ListEntry],
    is_redwood: bool,
) -> Result<Option<(Camera, String)>, SourceError> {
    for name in names(folder).into_iter().filter(|name| name.ends_with(".json")) {
        let path = folder.join(&name);
        let Ok(found) = serde_json::from_str::<Intrinsic>(&text(&path)?) else { continue };
        let k = found.intrinsic_matrix;
        let camera = pinhole((found.width, found.height), [k[0], k[4], k[6], k[7]], UNITS_PER_METRE, &path)?;
        let size = size_of(folder, depth)?;
        if size != (camera.width, camera.height) {
            let reason = format!(
                "the camera is {}x{} px, the depth images {}x{}",
                camera.width, camera.height, size.0, size.1
            );
            return Err(wrong(&path, reason));
        }
        return Ok(Some((camera, name)));
    }
    if is_redwood && size_of(folder, depth)? == (640, 480) {
        let camera = pinhole((640, 480), PRIMESENSE, UNITS_PER_METRE, folder)?;
        return Ok(Some((camera, "the PrimeSense default of Redwood, 525 px".to_owned())));
    }
    Ok(None)
}
