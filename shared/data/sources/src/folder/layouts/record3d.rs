//! Record3D (iPhone), a `.r3d` as it is or unpacked: `metadata` in JSON, and in `rgbd/` for each frame
//! `0.depth` (metres, LZFSE), `0.conf` (0, 1, 2, LZFSE) and `0.jpg`. Its other export has the same in
//! `metadata.json`, `depth/0.exr` and `rgb/0.jpg`.
//!
//! `K` is by columns and of the size of colour, as are the intrinsics of each frame, which follow the
//! autofocus. ARKit registers depth to colour: both are one camera at two sizes.
//! Poses are ARKit's, `[qx qy qz qw x y z]`, of a camera with y up and z backward.

use super::super::codec::DepthCodec;
use super::super::files::Files;
use super::super::list::ListEntry;
use super::super::lzfse;
use super::super::names::nanos_of;
use super::asked::{ChosenCamera, POSSIBLE_FPS, USUAL_FPS};
use super::files::{self, Numbered, number_nanos, numbered_of, pinhole, some_depth, wrong};
use super::intrinsics::Intrinsics;
use super::pose::{Poses, y_down};
use super::{Asked, FoundLayout};
use crate::SourceError;
use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;
use tessera_frames::ColourCamera;
use tessera_geometry::{Camera, Pose};

pub(super) const NAME: &str = "Record3D (metadata, rgbd/)";

/// Where things lie in a recording.
struct Parts {
    metadata: &'static str,
    /// Folder and end of the name.
    depth: (&'static str, &'static str),
    colour: (&'static str, &'static [&'static str]),
    codec: DepthCodec,
}

/// Of a `.r3d`, and of the export with depth as OpenEXR.
const PARTS: [Parts; 2] = [
    Parts {
        metadata: "metadata",
        depth: ("rgbd", ".depth"),
        colour: ("rgbd", &[".jpg"]),
        codec: DepthCodec::Lzfse,
    },
    Parts {
        metadata: "metadata.json",
        depth: ("depth", ".exr"),
        colour: ("rgb", &[".jpg", ".png"]),
        codec: DepthCodec::Png,
    },
];

/// As recordings count depth in metres: 0.2 mm, up to 13.1 m.
const UNITS_PER_METRE: f64 = 5000.0;
/// Seconds that a time may have: in nanoseconds they fit 64 bits.
const MOST_SECONDS: f64 = 1e9;

/// What is used of `metadata`.
#[derive(Deserialize)]
struct Record3dMetadata {
    /// Columns and rows of colour.
    w: u32,
    h: u32,
    /// Columns and rows of depth; older recordings do not say.
    dw: Option<u32>,
    dh: Option<u32>,
    /// By columns, pixels of colour.
    #[serde(rename = "K")]
    k: [f64; 9],
    fps: Option<f64>,
    #[serde(default)]
    poses: Vec<[f64; 7]>,
    /// `fx fy cx cy` of each frame, pixels of colour.
    #[serde(default, rename = "perFrameIntrinsicCoeffs")]
    intrinsics: Vec<[f64; 4]>,
    /// Seconds.
    #[serde(default, rename = "frameTimestamps")]
    times: Vec<f64>,
}

pub(super) fn is(folder: &Path) -> bool {
    let has_images = folder.join("rgbd").is_dir() && folder.join("metadata").is_file();
    has_images || parts(&Files::folder(folder)).is_some()
}

pub(super) fn read(folder: &Path, asked: &Asked) -> Result<FoundLayout, SourceError> {
    read_files(&Files::folder(folder), asked)
}

/// The parts of a recording that is one.
fn parts(files: &Files) -> Option<&'static Parts> {
    PARTS.iter().find(|parts| {
        let (folder, end) = parts.depth;
        let has_metadata = files.is_file(Path::new(parts.metadata));
        has_metadata && files.names(folder).iter().any(|name| name.ends_with(end))
    })
}

/// Whether a zip file is a recording.
pub(in crate::folder) fn is_recording(files: &Files) -> bool {
    parts(files).is_some()
}

/// Reads all but the images.
///
/// # Errors
/// What is wrong with the metadata, or that there is no depth.
pub(in crate::folder) fn read_files(files: &Files, asked: &Asked) -> Result<FoundLayout, SourceError> {
    let [of_r3d, _] = &PARTS;
    let parts = parts(files).unwrap_or(of_r3d);
    let (folder, path) = (files.root(), files.path(Path::new(parts.metadata)));
    let named = |error: crate::ImageError| wrong(&path, error.to_string());
    let text = files.read(Path::new(parts.metadata)).map_err(named)?;
    let metadata: Record3dMetadata =
        serde_json::from_slice(&text).map_err(|error| wrong(&path, error.to_string()))?;
    let of = |(folder, ends): (&str, &[&str])| numbered_of(&files.names(folder), folder, "", ends);
    let images = of((parts.depth.0, &[parts.depth.1]));
    let (stamps, times) = stamps(&metadata, &images, asked.fps, &path)?;
    let entries = |images: &[Numbered]| -> Vec<ListEntry> {
        let entry = |image: &Numbered| {
            let stamp_nanos = *stamps.get(&image.number)?;
            Some(ListEntry { stamp_nanos, file: image.file.clone() })
        };
        images.iter().filter_map(entry).collect()
    };
    let depth = some_depth(entries(&images), folder, "rgbd/NUMBER.depth with times in metadata")?;
    let colour = entries(&of(parts.colour));
    let intrinsics = intrinsics(&metadata);
    let camera = asked.camera(folder, || {
        let size = depth_size(files, parts, &metadata, &depth)?;
        let camera = pinhole(size, intrinsics.at(size), UNITS_PER_METRE, &path)?;
        Ok(ChosenCamera::stated(camera, format!("{}, scaled to depth", parts.metadata)))
    })?;
    let mut found = FoundLayout::new(NAME, camera, depth, colour);
    found.codec = parts.codec;
    let size = (metadata.w, metadata.h);
    let of_colour = Camera::pinhole(size, intrinsics.at(size), UNITS_PER_METRE);
    found.colour_camera = Some(ColourCamera { camera: of_colour, colour_from_depth: Pose::identity() });
    let confidence: Vec<_> = found.depth.iter().map(|entry| entry.file.with_extension("conf")).collect();
    if confidence.iter().any(|file| files.is_file(file)) {
        found.confidence = confidence;
        found.notes.push(("confidence", "pixels of low confidence are left out".to_owned()));
    }
    found.ground_truth = poses(&metadata, &stamps, &path)?.finish();
    if found.ground_truth.is_some() {
        found.notes.push(("ground truth of", "ARKit (metadata): an estimate too".to_owned()));
    }
    found.notes.push(("times", times));
    found.warnings.extend(intrinsics.warning());
    if metadata.times.is_empty() && asked.fps.is_none() {
        found
            .warnings
            .push(format!("{} has no frameTimestamps: times are those of its rate (--fps)", parts.metadata));
    }
    let n_without = images.len().saturating_sub(found.depth.len());
    if n_without > 0 {
        found
            .warnings
            .push(format!("{n_without} depth images have no time of their own in metadata and are left out"));
    }
    Ok(found)
}

/// Time of each frame by its number, nanoseconds, and where the times are from. A frame whose time does
/// not rise has none.
fn stamps(
    metadata: &Record3dMetadata,
    images: &[Numbered],
    asked_fps: Option<f64>,
    path: &Path,
) -> Result<(BTreeMap<u64, i64>, String), SourceError> {
    let fps = asked_fps.or(metadata.fps).unwrap_or(USUAL_FPS);
    if !POSSIBLE_FPS.contains(&fps) {
        return Err(wrong(path, format!("fps is {fps}, expected 0.01 to 10000")));
    }
    let is_timed = asked_fps.is_none() && !metadata.times.is_empty();
    let mut stamps = BTreeMap::new();
    let mut last = i64::MIN;
    for image in images {
        let stamp = match is_timed {
            true => match usize::try_from(image.number).ok().and_then(|at| metadata.times.get(at)) {
                Some(seconds) if seconds.abs() < MOST_SECONDS => nanos_of(*seconds),
                _ => continue,
            },
            false => number_nanos(image.number, fps),
        };
        if stamp > last {
            stamps.insert(image.number, stamp);
            last = stamp;
        }
    }
    let words = match is_timed {
        true => "frameTimestamps of metadata".to_owned(),
        false => format!("none: {fps} frames a second"),
    };
    Ok((stamps, words))
}

/// ARKit's poses as `world_from_camera` with y down and z forward.
fn poses(
    metadata: &Record3dMetadata,
    stamps: &BTreeMap<u64, i64>,
    path: &Path,
) -> Result<Poses, SourceError> {
    let mut poses = Poses::default();
    for (number, stamp) in stamps {
        let Some(pose) = usize::try_from(*number).ok().and_then(|at| metadata.poses.get(at)) else {
            continue;
        };
        let [qx, qy, qz, qw, x, y, z] = *pose;
        let quaternion = Quaternion::new(qw, qx, qy, qz);
        if !((0.9..1.1).contains(&quaternion.norm()) && [x, y, z].iter().all(|value| value.is_finite())) {
            let reason =
                format!("pose {number} is {pose:?}, expected qx qy qz qw x y z of a unit quaternion");
            return Err(wrong(path, reason));
        }
        let rotation = UnitQuaternion::from_quaternion(quaternion);
        let pose = Pose::from_parts(Translation3::new(x, y, z), rotation);
        poses.push(*stamp, Some(y_down(&pose)));
    }
    Ok(poses)
}

/// Columns and rows of depth: as in `metadata`, else by what the first images hold, and of LZFSE the
/// shape of colour.
fn depth_size(
    files: &Files,
    parts: &Parts,
    metadata: &Record3dMetadata,
    depth: &[ListEntry],
) -> Result<(u32, u32), SourceError> {
    if parts.codec == DepthCodec::Png {
        return files::size_in(files, depth);
    }
    if let (Some(width), Some(height)) = (metadata.dw, metadata.dh) {
        return Ok((width, height));
    }
    let (w, h) = (metadata.w as usize, metadata.h as usize);
    let n_pixels =
        |entry: &ListEntry| lzfse::n_pixels(&files.read(&entry.file).ok()?, w.saturating_mul(h)).ok()?;
    let found = depth.iter().take(5).find_map(n_pixels);
    let n = found
        .ok_or_else(|| wrong(files.root(), "none of the first depth images can be read, expected LZFSE"))?;
    let width = (n as f64 * w as f64 / h as f64).sqrt().round();
    let width = files::count(width).filter(|width| n.is_multiple_of(*width));
    let height = width.and_then(|width| n.checked_div(width));
    let side = |side: Option<usize>| u32::try_from(side?).ok();
    match side(width).zip(side(height)) {
        Some(size) => Ok(size),
        None => Err(wrong(
            &files.path(Path::new(parts.metadata)),
            format!("no dw and dh, and depth images of {n} pixels do not have the shape of colour, {w}x{h}"),
        )),
    }
}

/// Those of the frames, else of all of them.
fn intrinsics(metadata: &Record3dMetadata) -> Intrinsics {
    let (k, size) = (&metadata.k, (metadata.w, metadata.h));
    match metadata.intrinsics.is_empty() {
        true => Intrinsics::of([([k[0], k[4], k[6], k[7]], size)]),
        false => Intrinsics::of(metadata.intrinsics.iter().map(|of_frame| (*of_frame, size))),
    }
}
