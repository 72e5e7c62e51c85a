//! TUM RGB-D: `depth.txt`, `rgb.txt`, images, `groundtruth.txt`.
//!
//! A raw download says which of the three cameras it was in the name of its folder,
//! `rgbd_dataset_freiburg1_xyz`, and in the line `# file: '...bag'` of its lists.

use super::super::list::{self, ListEntry};
use super::{Asked, FoundLayout};
use crate::SourceError;
use std::path::Path;
use tessera_evaluation::read_tum;
use tessera_frames::cameras::named_camera;
use tessera_frames::judge::{FocalEvidence, UnitsEvidence, judge_focal, judge_units};
use tessera_geometry::Camera;

pub(super) const NAME: &str = "TUM RGB-D (depth.txt, rgb.txt)";

/// Cameras of the benchmark: built in under these names.
const CAMERAS: [&str; 3] = ["freiburg1", "freiburg2", "freiburg3"];
/// Lines of a list that are looked through for its origin.
const HEAD_LINES: usize = 5;

pub(super) fn is(folder: &Path) -> bool {
    folder.join("depth.txt").is_file() || folder.join("rgb.txt").is_file()
}

pub(super) fn read(folder: &Path, asked: &Asked) -> Result<FoundLayout, SourceError> {
    let depth = list::read(&folder.join("depth.txt"))?;
    let mut warnings = Vec::new();
    let colour = colour(&folder.join("rgb.txt"), &mut warnings)?;
    let camera = asked.camera(folder, || camera_by_name(folder))?;
    let truth = folder.join("groundtruth.txt");
    let ground_truth = if truth.exists() { Some(read_tum(&truth)?) } else { None };
    let doubts = doubt(folder, &camera.0)?.into_iter().collect();
    Ok(FoundLayout { ground_truth, warnings, doubts, ..FoundLayout::new(NAME, camera, depth, colour) })
}

/// A recording may be of depth alone: without `rgb.txt`, or with one that names nothing.
fn colour(list: &Path, warnings: &mut Vec<String>) -> Result<Vec<ListEntry>, SourceError> {
    if !list.exists() {
        return Ok(Vec::new());
    }
    match list::read(list) {
        Err(error @ SourceError::EmptyList { .. }) => {
            warnings.push(format!("{error}: depth alone"));
            Ok(Vec::new())
        }
        list => list,
    }
}

/// The camera that the folder's name or the head of its lists names.
pub(super) fn camera_by_name(folder: &Path) -> Result<Option<(Camera, String)>, SourceError> {
    let absolute = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let mut texts = vec![(
        "the folder's name".to_owned(),
        absolute.file_name().map(|name| name.to_string_lossy().into()),
    )];
    for list in ["depth.txt", "rgb.txt", "groundtruth.txt"] {
        let head = std::fs::read(folder.join(list)).ok().map(|bytes| head(&String::from_utf8_lossy(&bytes)));
        texts.push((format!("the head of {list}"), head));
    }
    for (from, text) in texts {
        let text: String = text.unwrap_or_default();
        if let Some(name) = CAMERAS.into_iter().find(|name| text.contains(name)) {
            return Ok(Some((named_camera(name)?, format!("{name}, from {from}"))));
        }
    }
    Ok(None)
}

/// Whether the camera used is another one than the recording's name says.
fn doubt(folder: &Path, used: &Camera) -> Result<Option<String>, SourceError> {
    let Some((named, from)) = camera_by_name(folder)? else { return Ok(None) };
    // The judge of both: a camera of this name has these units, and about this focal length.
    let focal = judge_focal(&[FocalEvidence::name(named.fx / used.fx)]).is_some_and(|found| found.is_wrong);
    let scale = used.units_per_metre / named.units_per_metre;
    let evidence =
        UnitsEvidence { stated: used.units_per_metre, true_scale: Some(scale), ..UnitsEvidence::default() };
    let units = judge_units(&evidence).is_some_and(|found| found.is_wrong);
    Ok((focal || units).then(|| {
        format!(
            "the camera has fx = {}, units_per_metre = {}; that of {from} has fx = {}, units_per_metre = {}",
            used.fx, used.units_per_metre, named.fx, named.units_per_metre
        )
    }))
}

/// The comments at the head of a list.
fn head(text: &str) -> String {
    text.lines().take(HEAD_LINES).filter(|line| line.starts_with('#')).collect::<Vec<&str>>().join("\n")
}
