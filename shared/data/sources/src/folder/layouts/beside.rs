//! A camera file of another program that lies beside the images: found by its name, chosen by the size
//! of the depth images.

use super::asked::ChosenCamera;
use super::files::{find, names, size_of, wrong};
use crate::SourceError;
use crate::folder::list::ListEntry;
use std::path::Path;
use tessera_frames::CameraFile;
use tessera_frames::camera_forms::{StatedCamera, read_scale, read_stated};

/// The camera file of our own form.
const OWN: &str = "camera.toml";
/// Words in the names of text files that may hold a camera.
const WORDS: [&str; 4] = ["intrinsic", "calib", "camera", "info"];
/// Focal lengths and principal points within this are the same camera, pixels.
const SAME_PX: f64 = 0.05;
/// Where a principal point lies in its image, as a share of the side.
const MIDDLE: std::ops::RangeInclusive<f64> = 0.2..=0.8;

/// `camera.toml` of a folder.
pub(super) fn camera_file_of(folder: &Path) -> Result<Option<(CameraFile, String)>, SourceError> {
    let file = find(folder, OWN);
    Ok(if file.exists() { Some((CameraFile::load(&file)?, OWN.to_owned())) } else { None })
}

fn may_hold_a_camera(name: &str) -> bool {
    let name = name.to_lowercase();
    let Some((stem, end)) = name.rsplit_once('.') else { return false };
    match end {
        "json" | "yaml" | "yml" => name != "metadata.yaml",
        "txt" => stem == "k" || WORDS.iter().any(|word| stem.contains(word)),
        _ => false,
    }
}

/// The files beside the images that may hold a camera and are of no form that is known, for people.
pub(super) fn not_understood(folder: &Path) -> Option<String> {
    let is_it = |name: &String| {
        let path = folder.join(name);
        may_hold_a_camera(name) && path.is_file() && matches!(read_stated(&path), Ok(None))
    };
    let names: Vec<String> = names(folder).into_iter().filter(is_it).collect();
    (!names.is_empty()).then(|| format!(", and no camera of a known form in {}", names.join(", ")))
}

/// The camera of the one file beside the images that fits the depth images; `None`: there is no
/// camera file.
///
/// # Errors
/// None fits, or several do and are not the same.
pub(super) fn camera_beside(
    folder: &Path,
    depth: &[ListEntry],
    units: f64,
) -> Result<Option<ChosenCamera>, SourceError> {
    camera_in(folder, folder, depth, units)
}

/// The same of the folder above, for sequences of one scene.
pub(super) fn camera_above(
    folder: &Path,
    depth: &[ListEntry],
    units: f64,
) -> Result<Option<ChosenCamera>, SourceError> {
    let absolute = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let Some(above) = absolute.parent() else { return Ok(None) };
    if let Some((file, from)) = camera_file_of(above)? {
        let assumed = file.assumed.into_iter().collect();
        let chosen = ChosenCamera::stated(file.camera, format!("../{from}"));
        return Ok(Some(ChosenCamera { assumed, lens: file.lens, ..chosen }));
    }
    let found = camera_in(above, folder, depth, units)?;
    Ok(found.map(|chosen| ChosenCamera { from: format!("../{}", chosen.from), ..chosen }))
}

/// A camera file in the folder above that fits, with the option that takes it, for people.
pub(super) fn hint_above(folder: &Path, depth: &[ListEntry], units: f64) -> Option<String> {
    let size = size_of(folder, depth).ok()?;
    let chosen = camera_above(folder, depth, units).ok()??;
    let file = chosen.from.trim_start_matches("../").split(" (").next()?;
    let is_it = (chosen.camera.width, chosen.camera.height) == size;
    let path = folder.join("..").join(file);
    is_it.then(|| format!(", but one in the folder above that fits (--camera '{}')", path.display()))
}

/// The camera of a file in `place` for the depth images of `folder`.
fn camera_in(
    place: &Path,
    folder: &Path,
    depth: &[ListEntry],
    units: f64,
) -> Result<Option<ChosenCamera>, SourceError> {
    let names: Vec<String> = names(place).into_iter().filter(|name| may_hold_a_camera(name)).collect();
    let (mut stated, mut unreadable) = (Vec::new(), None);
    for name in names.iter().filter(|name| place.join(name).is_file()) {
        match read_stated(&place.join(name)) {
            Ok(Some(camera)) => stated.push((name.clone(), camera)),
            Ok(None) => {}
            Err(error) => unreadable = unreadable.or(Some(error)),
        }
    }
    if stated.is_empty() {
        return unreadable.map_or(Ok(None), Err);
    }
    let size = size_of(folder, depth)?;
    let (fitting, others): (Vec<_>, Vec<_>) = stated.into_iter().partition(|(_, camera)| fits(camera, size));
    let Some((name, camera)) = one_of(place, &fitting)? else {
        let Some((name, camera)) = others.first() else { return Ok(None) };
        let found = match camera.size {
            Some((width, height)) => format!("is {width}x{height} px"),
            None => format!("has its middle at {}, {}", camera.intrinsics[2], camera.intrinsics[3]),
        };
        let reason = format!(
            "the camera {found}, the depth images {}x{}; expected a file for the depth images, or --camera FILE",
            size.0, size.1
        );
        return Err(wrong(&place.join(name), reason));
    };
    let mut camera = camera.clone();
    let mut assumed = Vec::new();
    if camera.units_per_metre.is_none() {
        let scales = names.iter().filter(|other| *other != name && other.ends_with(".json"));
        let beside = scales.filter_map(|other| Some((other, read_scale(&place.join(other))?))).next();
        camera.units_per_metre = beside.as_ref().map(|(_, scale)| *scale);
        if beside.is_none() {
            assumed.push(format!(
                "{name} states no depth units: {units} a metre are assumed (units_per_metre in a camera.toml)"
            ));
        }
    }
    let from = format!("{name} ({})", camera.form);
    let file = place.join(name).display().to_string();
    let chosen = ChosenCamera::stated(camera.camera(size, units, &file)?, from);
    let mut doubts = Vec::new();
    if camera.intrinsics[0] * camera.intrinsics[1] < 0.0 {
        doubts.push(format!(
            "{name}: fx is {}, fy {}: with one of them negative the map is mirrored, unless the images are (as those of ICL-NUIM); write a camera.toml with the right sign",
            camera.intrinsics[0], camera.intrinsics[1]
        ));
    }
    if !is_in_the_middle(&camera.intrinsics, size) {
        let [_, _, cx, cy] = camera.intrinsics;
        doubts.push(format!(
            "{name}: the principal point is {cx}, {cy}, far from the middle of {}x{} px",
            size.0, size.1
        ));
    }
    Ok(Some(ChosenCamera { lens: camera.lens, fps: camera.fps, assumed, doubts, ..chosen }))
}

/// Whether a camera may be that of images of a size.
fn fits(camera: &StatedCamera, size: (u32, u32)) -> bool {
    camera.size.map_or_else(|| is_in_the_middle(&camera.intrinsics, size), |stated| stated == size)
}

fn is_in_the_middle(&[_, _, cx, cy]: &[f64; 4], size: (u32, u32)) -> bool {
    let is_middle = |c: f64, side: u32| MIDDLE.contains(&(c / f64::from(side)));
    is_middle(cx, size.0) && is_middle(cy, size.1)
}

/// The one camera among several files: all the same, or only one of depth by its name.
fn one_of<'a>(
    folder: &Path,
    fitting: &'a [(String, StatedCamera)],
) -> Result<Option<&'a (String, StatedCamera)>, SourceError> {
    let is_same = |a: &StatedCamera, b: &StatedCamera| {
        a.intrinsics.iter().zip(&b.intrinsics).all(|(a, b)| (a - b).abs() < SAME_PX)
            && a.units_per_metre.zip(b.units_per_metre).is_none_or(|(a, b)| (a - b).abs() < 1e-3 * b)
    };
    let Some(first) = fitting.first() else { return Ok(None) };
    if fitting.iter().all(|(_, camera)| is_same(camera, &first.1)) {
        // The one that states most.
        return Ok(fitting.iter().find(|(_, camera)| camera.units_per_metre.is_some()).or(Some(first)));
    }
    let of_depth: Vec<_> = fitting.iter().filter(|(name, _)| name.to_lowercase().contains("depth")).collect();
    match of_depth[..] {
        [one] => Ok(Some(one)),
        _ => {
            let names: Vec<&str> = fitting.iter().map(|(name, _)| name.as_str()).collect();
            Err(wrong(
                folder,
                format!(
                    "several camera files that differ: {}; expected one, or --camera FILE",
                    names.join(", ")
                ),
            ))
        }
    }
}
