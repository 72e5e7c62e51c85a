//! TUM RGB-D: `depth.txt`, `rgb.txt`, images, `groundtruth.txt`.
//!
//! A raw download says which of the three cameras it was in the name of its folder,
//! `rgbd_dataset_freiburg1_xyz`, and in the line `# file: '...bag'` of its lists.

use super::super::list::{self, ImageList, ListEntry};
use super::asked::ChosenCamera;
use super::files::{find, names, number_nanos};
use super::{Asked, FoundLayout};
use crate::SourceError;
use std::path::Path;
use tessera_evaluation::plain_text;
use tessera_frames::cameras::named_camera;
use tessera_frames::judge::{FocalEvidence, UnitsEvidence, judge_focal, judge_units};
use tessera_geometry::Camera;

pub(super) const NAME: &str = "TUM RGB-D (depth.txt, rgb.txt)";

/// Cameras of the benchmark: built in under these names.
const CAMERAS: [&str; 3] = ["freiburg1", "freiburg2", "freiburg3"];
/// Depth units of the benchmark, and so of the layout, a metre.
pub(super) const UNITS_PER_METRE: f64 = 5000.0;
/// Lines of a list that are looked through for its origin.
const HEAD_LINES: usize = 5;

pub(super) fn is(folder: &Path) -> bool {
    find(folder, "depth.txt").is_file() || find(folder, "rgb.txt").is_file()
}

pub(super) fn read(folder: &Path, asked: &Asked) -> Result<FoundLayout, SourceError> {
    let depth = list::read(&find(folder, "depth.txt"))?;
    let (mut warnings, mut no_colour) = (Vec::new(), None);
    let colour = colour(&find(folder, "rgb.txt"), &mut no_colour)?;
    let chosen =
        asked.camera_or_beside(folder, &depth.entries, UNITS_PER_METRE, || camera_by_name(folder))?;
    let is_numbered = depth.is_numbered && (colour.is_numbered || colour.entries.is_empty());
    let (fps, words) = asked.rate(chosen.fps);
    let at_rate = |list: ImageList| at_rate(list, is_numbered.then_some(fps));
    let (depth, colour, sentences) =
        list::in_order(at_rate(depth), at_rate(colour), ["depth.txt", "rgb.txt"]);
    warnings.extend(sentences);
    warnings.extend(unlisted(folder, "depth.txt", &depth));
    let doubt = doubt(folder, &chosen.camera)?;
    let mut found = FoundLayout { no_colour, ..FoundLayout::new(NAME, chosen, depth, colour) };
    if is_numbered {
        warnings.push(format!("the stamps of depth.txt are frame numbers; times: {words}"));
        found.notes.push(("times", words));
    }
    found.take_tum_truth(&find(folder, "groundtruth.txt"));
    found.warnings.extend(warnings);
    found.doubts.extend(doubt);
    Ok(found)
}

/// Frame numbers, which the list holds as seconds, at a rate.
fn at_rate(list: ImageList, fps: Option<f64>) -> Vec<ListEntry> {
    const SECOND: i64 = 1_000_000_000;
    let Some(fps) = fps else { return list.entries };
    let time = |nanos: i64| number_nanos((nanos / SECOND).unsigned_abs(), fps);
    let entry = |entry: ListEntry| ListEntry { stamp_nanos: time(entry.stamp_nanos), ..entry };
    list.entries.into_iter().map(entry).collect()
}

/// A sentence where the folder of the listed images holds many more: the list may have been cut.
fn unlisted(folder: &Path, list: &str, listed: &[ListEntry]) -> Option<String> {
    const MOST_LISTED: f64 = 0.9;
    let first = &listed.first()?.file;
    let (inside, end) = (first.parent()?, first.extension()?);
    let files = names(&folder.join(inside));
    let n_files = files.iter().filter(|name| Path::new(name).extension() == Some(end)).count();
    let n = listed.iter().filter(|entry| entry.file.parent() == Some(inside)).count();
    let is_own = !inside.as_os_str().is_empty() && n.saturating_add(1) < n_files;
    (is_own && (n as f64) < MOST_LISTED * n_files as f64)
        .then(|| format!("{list} lists {n} of the {n_files} images in {}/", inside.display()))
}

/// A recording may be of depth alone: without `rgb.txt`, or with one that names nothing.
fn colour(list: &Path, no_colour: &mut Option<String>) -> Result<ImageList, SourceError> {
    if !list.exists() {
        *no_colour = Some("there is no rgb.txt".to_owned());
        return Ok(ImageList::default());
    }
    match list::read(list) {
        Err(error @ SourceError::EmptyList { .. }) => {
            *no_colour = Some(error.to_string());
            Ok(ImageList::default())
        }
        list => list,
    }
}

/// The camera that the folder's name or the head of its lists names.
pub(super) fn camera_by_name(folder: &Path) -> Result<Option<ChosenCamera>, SourceError> {
    Ok(named(folder)?.map(|(camera, from)| ChosenCamera::assumed(camera, from)))
}

fn named(folder: &Path) -> Result<Option<(Camera, String)>, SourceError> {
    let absolute = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let mut texts = vec![(
        "the folder's name".to_owned(),
        absolute.file_name().map(|name| name.to_string_lossy().into()),
    )];
    for list in ["depth.txt", "rgb.txt", "groundtruth.txt"] {
        let head = std::fs::read(find(folder, list)).ok().map(|bytes| head(&plain_text(&bytes)));
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
    let Some((named, from)) = named(folder)? else { return Ok(None) };
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
