//! nerfstudio, NeRFCapture and what exports as they do: `transforms.json` with the camera of colour, and
//! for each frame `file_path`, `depth_file_path` and `transform_matrix`, camera to world with y up and z
//! backward.

use super::super::list::{ListEntry, is_inside};
use super::super::names::{NameMeaning, nanos_of, understand};
use super::asked::ChosenCamera;
use super::files::{json, number_nanos, size_of, some_depth, wrong};
use super::intrinsics::Intrinsics;
use super::pose::{Poses, from_matrix, y_down};
use super::{Asked, FoundLayout};
use crate::SourceError;
use serde::Deserialize;
use serde_json::Value;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use tessera_frames::ColourCamera;
use tessera_frames::camera_forms::{StatedCamera, read_scale, read_stated};
use tessera_geometry::Pose;

pub(super) const NAME: &str = "nerfstudio (transforms.json with depth)";

const FILE: &str = "transforms.json";
/// Depth units where the file does not state them, a metre.
const UNITS_PER_METRE: f64 = 1000.0;

/// What is used of `transforms.json` beside its camera.
#[derive(Deserialize)]
struct NerfTransforms {
    #[serde(default)]
    camera_model: String,
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
    #[serde(flatten)]
    lens: HashMap<String, Value>,
}

impl NerfFrame {
    fn number(&self, name: &str) -> Option<f64> {
        self.lens.get(name).and_then(Value::as_f64)
    }

    /// `fl_x fl_y cx cy` and the size, where the frame has its own and its lens does not distort.
    fn own_camera(&self) -> Option<([f64; 4], (u32, u32))> {
        let is_plain =
            ["k1", "k2", "k3", "k4", "p1", "p2"].iter().all(|name| self.number(name).unwrap_or(0.0) == 0.0);
        let [fx, fy, cx, cy] = ["fl_x", "fl_y", "cx", "cy"].map(|name| self.number(name));
        let side = |name: &str| {
            self.lens.get(name).and_then(Value::as_u64).and_then(|side| u32::try_from(side).ok())
        };
        // There the middle of the first pixel is at 0.5.
        is_plain.then_some(([fx?, fy?, cx? - 0.5, cy? - 0.5], (side("w")?, side("h")?)))
    }
}

/// The median of the cameras that the frames have each, as converters of phones' recordings write them; `None`
/// unless all have one, of one size. With it a sentence where the focal length changes.
fn of_frames(frames: &[NerfFrame], path: &Path) -> Option<(StatedCamera, Option<String>)> {
    let cameras: Vec<([f64; 4], (u32, u32))> =
        frames.iter().map(NerfFrame::own_camera).collect::<Option<_>>()?;
    let size = cameras.first()?.1;
    if cameras.iter().any(|(_, other)| *other != size) {
        return None;
    }
    let median = Intrinsics::of(cameras);
    let stated = StatedCamera {
        form: "nerfstudio",
        size: Some(size),
        intrinsics: median.at(size),
        distortion: [0.0; 5],
        lens: None,
        units_per_metre: read_scale(path),
        fps: None,
    };
    Some((stated, median.warning()))
}

pub(super) fn is(folder: &Path) -> bool {
    let text = std::fs::read(folder.join(FILE)).unwrap_or_default();
    String::from_utf8_lossy(&text).contains("\"depth_file_path\"")
        || String::from_utf8_lossy(&text).contains("\"depth_path\"")
}

pub(super) fn read(folder: &Path, asked: &Asked) -> Result<FoundLayout, SourceError> {
    let path = folder.join(FILE);
    let NerfTransforms { camera_model, mut frames } = json::<NerfTransforms>(&path)?;
    frames.retain(|frame| frame.depth_file_path.is_some());
    let (stated, focus) = match read_stated(&path)? {
        Some(stated) => (Some(stated), None),
        None if camera_model.contains("FISHEYE") => (None, None),
        None => of_frames(&frames, &path).map_or((None, None), |(stated, focus)| (Some(stated), focus)),
    };
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
            wrong(&path, "no fl_x, fl_y, cx, cy for all frames, nor for each of one size without distortion, expected one camera; put a camera.toml beside it")
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
    found.warnings.extend(focus);
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
