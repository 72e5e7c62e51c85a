//! nerfstudio, NeRFCapture and what exports as they do: `transforms.json` with the camera of colour, and
//! for each frame `file_path`, `depth_file_path` and `transform_matrix`, camera to world with y up and z
//! backward.

use super::super::list::{ListEntry, is_inside};
use super::super::names::{NameMeaning, nanos_of, understand};
use super::asked::ChosenCamera;
use super::files::{json, number_nanos, size_of, some_depth, wrong};
use super::pose::{Poses, from_matrix, y_down};
use super::{Asked, FoundLayout};
use crate::SourceError;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use tessera_frames::ColourCamera;
use tessera_frames::camera_forms::{StatedCamera, read_stated};
use tessera_geometry::Pose;

pub(super) const NAME: &str = "nerfstudio (transforms.json with depth)";

const FILE: &str = "transforms.json";
/// Depth units where the file does not state them, a metre.
const UNITS_PER_METRE: f64 = 1000.0;

/// What is used of `transforms.json` beside its camera.
#[derive(Deserialize)]
struct NerfTransforms {
    frames: Vec<NerfFrame>,
}

#[derive(Deserialize)]
struct NerfFrame {
    #[serde(default)]
    file_path: String,
    #[serde(alias = "depth_path")]
    depth_file_path: Option<String>,
    #[serde(default)]
    transform_matrix: Vec<Vec<f64>>,
    /// Seconds.
    timestamp: Option<f64>,
}

pub(super) fn is(folder: &Path) -> bool {
    let text = std::fs::read(folder.join(FILE)).unwrap_or_default();
    String::from_utf8_lossy(&text).contains("\"depth_file_path\"")
        || String::from_utf8_lossy(&text).contains("\"depth_path\"")
}

pub(super) fn read(folder: &Path, asked: &Asked) -> Result<FoundLayout, SourceError> {
    let path = folder.join(FILE);
    let mut frames = json::<NerfTransforms>(&path)?.frames;
    frames.retain(|frame| frame.depth_file_path.is_some());
    let stated = read_stated(&path)?;
    let (fps, words) = asked.rate(stated.as_ref().and_then(|camera| camera.fps));
    let (times, words) = times(&frames, asked, fps, words, &path)?;
    let mut rows: Vec<(i64, NerfFrame)> = times.into_iter().zip(frames).collect();
    rows.sort_by_key(|(stamp, _)| *stamp);
    let n = rows.len();
    rows.dedup_by_key(|(stamp, _)| *stamp);
    let (mut depth, mut colour, mut poses) = (Vec::new(), Vec::new(), Poses::default());
    let mut wrong_pose = None;
    for (stamp_nanos, frame) in &rows {
        let entry = |file: &str| {
            Ok::<_, SourceError>(ListEntry { stamp_nanos: *stamp_nanos, file: inside(file, &path)? })
        };
        depth.push(entry(frame.depth_file_path.as_deref().unwrap_or_default())?);
        if !frame.file_path.is_empty() {
            colour.push(entry(&frame.file_path)?);
        }
        let numbers: Vec<f64> = frame.transform_matrix.iter().flatten().copied().collect();
        if !numbers.is_empty() {
            match from_matrix(&numbers, &path) {
                Ok(pose) => poses.push(*stamp_nanos, pose.map(|pose| y_down(&pose))),
                Err(error) => wrong_pose = wrong_pose.or(Some(error)),
            }
        }
    }
    let depth = some_depth(depth, folder, "frames with depth_file_path in transforms.json")?;
    let chosen = asked.camera(folder, || {
        let stated = stated.clone().ok_or_else(|| {
            wrong(&path, "no fl_x, fl_y, cx, cy for all frames, expected one camera; put a camera.toml beside it")
        })?;
        let size = size_of(folder, &depth)?;
        let scaled = scaled_to_depth(&stated, size, &path)?;
        let camera = scaled.camera(size, UNITS_PER_METRE, &path.display().to_string())?;
        let mut chosen = ChosenCamera::stated(camera, "transforms.json, scaled to depth");
        chosen.lens = scaled.lens;
        if stated.units_per_metre.is_none() {
            chosen.assumed.push(format!("{FILE} states no depth units: {UNITS_PER_METRE} a metre are assumed (units_per_metre in a camera.toml)"));
        }
        Ok(chosen)
    })?;
    let mut found = FoundLayout::new(NAME, chosen, depth, colour);
    // Of a fisheye only images of the size of depth are straightened, with it.
    if let Some(size) = stated.as_ref().filter(|camera| camera.lens.is_none()).and_then(|camera| camera.size)
    {
        let camera = stated.map(|camera| camera.camera(size, UNITS_PER_METRE, FILE)).transpose()?;
        // Depth of such exports is rendered or registered to colour: one camera at two sizes.
        found.colour_camera =
            camera.map(|camera| ColourCamera { camera, colour_from_depth: Pose::identity() });
    }
    found.take_truth(wrong_pose.map_or(Ok(poses.finish()), Err));
    if n > rows.len() {
        found.warnings.push(format!(
            "{} frames of {FILE} repeat the time of another and are left out",
            n.saturating_sub(rows.len())
        ));
    }
    found.notes.push(("times", words));
    Ok(found)
}

/// The stated camera at the size of the depth images.
fn scaled_to_depth(
    stated: &StatedCamera,
    size: (u32, u32),
    path: &Path,
) -> Result<StatedCamera, SourceError> {
    match stated.size {
        Some(stated_size) if stated_size != size => stated.scaled_to(size).ok_or_else(|| {
            let (w, h) = stated_size;
            wrong(
                path,
                format!("the camera is {w}x{h} px, the depth images {}x{}: not of one shape", size.0, size.1),
            )
        }),
        _ => Ok(stated.clone()),
    }
}

/// Time of each frame: stamps, or what the names of the images mean.
fn times(
    frames: &[NerfFrame],
    asked: &Asked,
    fps: f64,
    words: String,
    path: &Path,
) -> Result<(Vec<i64>, String), SourceError> {
    const MOST_SECONDS: f64 = 9e9;
    let stamps: Option<Vec<f64>> =
        frames.iter().map(|frame| frame.timestamp.filter(|seconds| seconds.abs() < MOST_SECONDS)).collect();
    if let Some(seconds) = stamps.filter(|_| asked.fps.is_none()) {
        let nanos = seconds.iter().map(|seconds| nanos_of(*seconds)).collect();
        return Ok((nanos, format!("timestamp of {FILE}")));
    }
    let files: Vec<&Path> =
        frames.iter().map(|frame| Path::new(frame.depth_file_path.as_deref().unwrap_or_default())).collect();
    let stems: Vec<String> = files
        .iter()
        .map(|file| file.file_stem().unwrap_or_default().to_string_lossy().into_owned())
        .collect();
    let stems: Vec<&str> = stems.iter().map(String::as_str).collect();
    let understood = understand(&stems, asked.fps.is_some()).map_err(|reason| wrong(path, reason))?;
    if understood.kept.len() != stems.len() {
        return Err(wrong(
            path,
            understood.warning.unwrap_or_else(|| "depth images without numbers".to_owned()),
        ));
    }
    Ok(match understood.meaning {
        NameMeaning::Numbers(numbers) => {
            (numbers.iter().map(|number| number_nanos(*number, fps)).collect(), words)
        }
        NameMeaning::Times(times, how) => (times, how),
    })
}

/// A file of the folder.
fn inside(file: &str, path: &Path) -> Result<PathBuf, SourceError> {
    let name = PathBuf::from(file);
    match is_inside(&name) {
        true => Ok(name),
        false => Err(wrong(path, format!("a frame's file is '{file}', expected a path inside the folder"))),
    }
}
