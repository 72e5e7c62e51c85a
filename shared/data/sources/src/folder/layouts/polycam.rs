//! Polycam's raw data (iPhone, developer mode): `keyframes/depth/TIME.png` in millimetres,
//! `keyframes/images/TIME.jpg`, `keyframes/cameras/TIME.json` and, where its optimisation ran,
//! `keyframes/corrected_cameras/TIME.json`; names are times in microseconds.
//!
//! `corrected_images` are undistorted and have another camera than depth: they are used where there
//! are no others. Poses are camera to world of a camera with y up and z backward.

use super::super::list::ListEntry;
use super::asked::ChosenCamera;
use super::files::{Numbered, json, names, number_nanos, numbered, pinhole, size_of, some_depth, wrong};
use super::intrinsics::Intrinsics;
use super::pose::{Poses, from_matrix, y_down};
use super::{Asked, FoundLayout};
use crate::SourceError;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tessera_evaluation::Trajectory;
use tessera_frames::ColourCamera;
use tessera_geometry::Pose;

pub(super) const NAME: &str = "Polycam (keyframes/depth, keyframes/cameras)";

const KEYFRAMES: &str = "keyframes";
/// Folders of cameras, beside those of the images that they are of.
const CAMERAS: [(&str, &str); 2] = [("cameras", "images"), ("corrected_cameras", "corrected_images")];
const UNITS_PER_METRE: f64 = 1000.0;
/// Microseconds between two keyframes, at the least: what is nearer is no time.
const LEAST_STEP: u64 = 1_000;

/// What is used of a frame's camera; pixels of colour.
#[derive(Deserialize)]
struct PolycamCamera {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    width: u32,
    height: u32,
    #[serde(flatten)]
    pose: PolycamPose,
}

/// The first three rows of the pose's matrix.
#[derive(Deserialize)]
struct PolycamPose {
    t_00: f64,
    t_01: f64,
    t_02: f64,
    t_03: f64,
    t_10: f64,
    t_11: f64,
    t_12: f64,
    t_13: f64,
    t_20: f64,
    t_21: f64,
    t_22: f64,
    t_23: f64,
}

impl PolycamPose {
    fn matrix(&self) -> [f64; 16] {
        let p = self;
        [
            p.t_00, p.t_01, p.t_02, p.t_03, p.t_10, p.t_11, p.t_12, p.t_13, p.t_20, p.t_21, p.t_22, p.t_23,
            0.0, 0.0, 0.0, 1.0,
        ]
    }
}

/// The cameras of one folder.
struct CaptureCameras {
    of_frames: Vec<(u64, PolycamCamera)>,
    /// Files that cannot be read.
    n_wrong: usize,
}

impl CaptureCameras {
    /// # Errors
    /// Why the first cannot be read, where none can.
    fn read(folder: &Path, sub: &str) -> Result<Self, SourceError> {
        let (mut of_frames, mut n_wrong, mut first) = (Vec::new(), 0_usize, None);
        for Numbered { number, file } in numbered(folder, sub, "", &[".json"]) {
            match json(&folder.join(file)) {
                Ok(camera) => of_frames.push((number, camera)),
                Err(error) => {
                    n_wrong = n_wrong.saturating_add(1);
                    first = first.or(Some(error));
                }
            }
        }
        match first {
            Some(error) if of_frames.is_empty() => Err(error),
            _ => Ok(Self { of_frames, n_wrong }),
        }
    }

    fn intrinsics(&self) -> Intrinsics {
        let of_frame = |(_, camera): &(u64, PolycamCamera)| {
            ([camera.fx, camera.fy, camera.cx, camera.cy], (camera.width, camera.height))
        };
        Intrinsics::of(self.of_frames.iter().map(of_frame))
    }

    /// The poses of the frames that have depth.
    fn poses(&self, stamps: &BTreeMap<u64, i64>, path: &Path) -> Result<Option<Trajectory>, SourceError> {
        let mut poses = Poses::default();
        for (number, camera) in &self.of_frames {
            if let Some(stamp) = stamps.get(number) {
                poses.push(*stamp, from_matrix(&camera.pose.matrix(), path)?.map(|pose| y_down(&pose)));
            }
        }
        Ok(poses.finish())
    }
}

/// The folder that is, or has, `keyframes`.
fn keyframes(folder: &Path) -> Option<PathBuf> {
    let is_json = |name: &String| name.ends_with(".json");
    let has_both = |folder: &PathBuf| {
        folder.join("depth").is_dir()
            && CAMERAS.iter().any(|(cameras, _)| names(&folder.join(cameras)).iter().any(is_json))
    };
    [folder.join(KEYFRAMES), folder.to_owned()].into_iter().find(has_both)
}

pub(super) fn is(folder: &Path) -> bool {
    keyframes(folder).is_some()
}

pub(super) fn read(folder: &Path, asked: &Asked) -> Result<FoundLayout, SourceError> {
    let base = keyframes(folder).filter(|base| base != folder).map_or("", |_| KEYFRAMES);
    let sub = |name: &str| Path::new(base).join(name).display().to_string();
    let images = numbered(folder, &sub("depth"), "", &[".png"]);
    let stamps = stamps(&images, asked.fps, &folder.join(sub("depth")))?;
    let entries = |images: &[Numbered]| -> Vec<ListEntry> {
        let entry = |image: &Numbered| {
            Some(ListEntry { stamp_nanos: *stamps.get(&image.number)?, file: image.file.clone() })
        };
        images.iter().filter_map(entry).collect()
    };
    let depth = some_depth(entries(&images), folder, "keyframes/depth/TIME.png")?;
    let [own, corrected] = CAMERAS;
    let is_there = |name: &str| folder.join(sub(name)).is_dir();
    let (cameras_in, images_in) = if is_there(own.0) { own } else { corrected };
    let cameras = CaptureCameras::read(folder, &sub(cameras_in))?;
    let (intrinsics, path) = (cameras.intrinsics(), folder.join(sub(cameras_in)));
    let at = |size: (u32, u32)| pinhole(size, intrinsics.at(size), UNITS_PER_METRE, &path);
    let chosen = asked.camera(folder, || {
        let camera = at(size_of(folder, &depth)?)?;
        Ok(ChosenCamera::stated(camera, format!("{}, scaled to depth", sub(cameras_in))))
    })?;
    let colour = entries(&numbered(folder, &sub(images_in), "", &[".jpg", ".png"]));
    let colour_camera = match colour.is_empty() {
        true => None,
        false => Some(at(size_of(folder, &colour)?)?),
    };
    let mut found = FoundLayout::new(NAME, chosen, depth, colour);
    // ARKit registers depth to colour: one camera at two sizes.
    found.colour_camera =
        colour_camera.map(|camera| ColourCamera { camera, colour_from_depth: Pose::identity() });
    if is_there("confidence") {
        let file = |entry: &ListEntry| {
            Path::new(&sub("confidence")).join(entry.file.file_name().unwrap_or_default())
        };
        found.confidence = found.depth.iter().map(file).collect();
        found.notes.push(("confidence", "pixels of low confidence are left out".to_owned()));
    }
    let (best, by) = match CaptureCameras::read(folder, &sub(corrected.0)) {
        Ok(optimised) if !optimised.of_frames.is_empty() => (optimised, "Polycam (corrected_cameras)"),
        _ => (cameras, "ARKit (cameras)"),
    };
    if best.n_wrong > 0 {
        found.warnings.push(format!("{} camera files cannot be read and are left out", best.n_wrong));
    }
    found.take_truth(best.poses(&stamps, &path));
    found.notes.push(("ground truth of", format!("{by}: an estimate too")));
    found.notes.push((
        "times",
        asked.fps.map_or("microseconds in the names of the images".to_owned(), |fps| {
            format!("none: {fps} frames a second, as given by --fps")
        }),
    ));
    found.warnings.extend(intrinsics.warning());
    Ok(found)
}

/// Times of the images by the number in their names: microseconds, unless a rate was given.
fn stamps(
    images: &[Numbered],
    asked_fps: Option<f64>,
    folder: &Path,
) -> Result<BTreeMap<u64, i64>, SourceError> {
    let numbers = images.iter().map(|image| image.number);
    if let Some(fps) = asked_fps {
        return Ok(numbers.zip(0..).map(|(number, at)| (number, number_nanos(at, fps))).collect());
    }
    check_times(images, folder)?;
    let nanos = |number: u64| Some((number, i64::try_from(number).ok()?.checked_mul(1_000)?));
    Ok(numbers.filter_map(nanos).collect())
}

/// Names that count frames are no times.
fn check_times(images: &[Numbered], folder: &Path) -> Result<(), SourceError> {
    let numbers: Vec<u64> = images.iter().map(|image| image.number).collect();
    let mut steps: Vec<u64> = numbers
        .iter()
        .zip(numbers.iter().skip(1))
        .map(|(before, after)| after.saturating_sub(*before))
        .collect();
    steps.sort_unstable();
    match steps.get(steps.len() / 2) {
        Some(step) if *step < LEAST_STEP => Err(wrong(
            folder,
            format!(
                "names that step by {step}, expected times in microseconds, as Polycam exports them; give --fps"
            ),
        )),
        _ => Ok(()),
    }
}
