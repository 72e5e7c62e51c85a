//! Stray Scanner (iPhone): `depth/000000.png` in millimetres, `confidence/000000.png` (0, 1, 2),
//! `camera_matrix.csv` of the video, `odometry.csv` with times and poses of ARKit, `rgb.mp4`, read
//! by ffmpeg where that is there, and its images where they were written to `rgb/000000.jpg`.

use super::super::list::ListEntry;
use super::super::names::nanos_of;
use super::super::video::Video;
use super::asked::ChosenCamera;
use super::files::{self, numbered, numbers, pinhole, size_of, some_depth, text, wrong};
use super::pose::Poses;
use super::{Asked, FoundLayout};
use crate::SourceError;
use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tessera_frames::ColourCamera;
use tessera_geometry::{Camera, Pose};

pub(super) const NAME: &str = "Stray Scanner (depth/, camera_matrix.csv, odometry.csv)";

/// Columns and rows of the video, which the camera matrix is of.
const VIDEO: (f64, f64) = (1920.0, 1440.0);
/// Folder of the video's images, where they were written.
const VIDEO_IMAGES: &str = "rgb";
/// Writes them: one for each frame of the video. Without `-fps_mode` ffmpeg makes its uneven times even, by
/// images that it repeats and drops.
const WRITE_IMAGES: &str = "ffmpeg -i rgb.mp4 -fps_mode passthrough -start_number 0 rgb/%06d.jpg";
const VIDEO_FILE: &str = "rgb.mp4";
const UNITS_PER_METRE: f64 = 1000.0;

pub(super) fn is(folder: &Path) -> bool {
    ["camera_matrix.csv", "odometry.csv"].iter().all(|file| folder.join(file).is_file())
}

pub(super) fn read(folder: &Path, asked: &Asked) -> Result<FoundLayout, SourceError> {
    let odometry = odometry(&folder.join("odometry.csv"))?;
    let images = numbered(folder, "depth", "", &[".png"]);
    let (mut depth, mut confidence, mut poses) = (Vec::new(), Vec::new(), Poses::default());
    for image in &images {
        // A frame without a row has no time.
        let Some((stamp_nanos, pose)) = odometry.get(&image.number).copied() else { continue };
        if depth.last().is_some_and(|last: &ListEntry| stamp_nanos <= last.stamp_nanos) {
            continue;
        }
        poses.push(stamp_nanos, Some(pose));
        confidence.push(PathBuf::from("confidence").join(image.file.file_name().unwrap_or_default()));
        depth.push(ListEntry { stamp_nanos, file: image.file.clone() });
    }
    let n_without = images.len().saturating_sub(depth.len());
    let depth = some_depth(depth, folder, "depth/NUMBER.png with rows in odometry.csv")?;
    let camera = asked.camera(folder, || {
        let camera = camera_of(&folder.join("camera_matrix.csv"), size_of(folder, &depth)?)?;
        Ok(ChosenCamera::stated(camera, "camera_matrix.csv, scaled to depth"))
    })?;
    let of_video = |image: &files::Numbered| {
        let (stamp_nanos, _) = odometry.get(&image.number).copied()?;
        Some(ListEntry { stamp_nanos, file: image.file.clone() })
    };
    let video_images = numbered(folder, VIDEO_IMAGES, "", &[".jpg", ".png"]);
    let n_beyond = video_images.iter().filter(|image| !odometry.contains_key(&image.number)).count();
    let mut colour: Vec<ListEntry> = video_images.iter().filter_map(of_video).collect();
    let is_asked = colour.is_empty() && !asked.is_without_colour && folder.join(VIDEO_FILE).is_file();
    let video = is_asked.then(|| Video::open(folder, VIDEO_FILE));
    if let Some(Ok(video)) = &video {
        colour = frames_of(video, &odometry);
    }
    colour.sort_by_key(|entry| entry.stamp_nanos);
    let colour_camera = match colour.is_empty() {
        true => None,
        false => {
            let size = match &video {
                Some(Ok(video)) => video.size,
                _ => size_of(folder, &colour)?,
            };
            Some(camera_of(&folder.join("camera_matrix.csv"), size)?)
        }
    };
    let mut found = FoundLayout::new(NAME, camera, depth, colour);
    // ARKit registers depth to colour: one camera at two sizes.
    found.colour_camera =
        colour_camera.map(|camera| ColourCamera { camera, colour_from_depth: Pose::identity() });
    if folder.join("confidence").is_dir() {
        found.confidence = confidence;
        found.notes.push(("confidence", "pixels of low confidence are left out".to_owned()));
    }
    found.ground_truth = poses.finish();
    found.notes.push(("ground truth of", "ARKit (odometry.csv): an estimate too".to_owned()));
    if let Some(video) = video {
        found.take_video(video, odometry.len());
    }
    if n_beyond > 0 {
        found.warnings.push(format!(
            "{n_beyond} of {} images in rgb/ have no row in odometry.csv: colour may be of other frames than depth; write them again: {WRITE_IMAGES}",
            video_images.len()
        ));
    }
    if n_without > 0 {
        found.warnings.push(format!(
            "{n_without} depth images have no time of their own in odometry.csv and are left out"
        ));
    }
    Ok(found)
}

/// The frames of the video that have a row.
fn frames_of(video: &Video, odometry: &BTreeMap<u64, (i64, Pose)>) -> Vec<ListEntry> {
    let entry = |(number, (stamp_nanos, _)): (&u64, &(i64, Pose))| ListEntry {
        stamp_nanos: *stamp_nanos,
        file: video.name_of(*number),
    };
    odometry.iter().filter(|(number, _)| **number < video.n_frames).map(entry).collect()
}

impl FoundLayout {
    /// Colour is in the video, or why it is not; whether it has as many frames as there are rows is stated.
    fn take_video(&mut self, video: Result<Video, String>, n_rows: usize) {
        let video = match video {
            Ok(video) => video,
            Err(reason) => {
                self.no_colour = Some(format!(
                    "it is a video ({VIDEO_FILE}), and {reason}; its images are read too: in the folder mkdir rgb && {WRITE_IMAGES}"
                ));
                return;
            }
        };
        let n = video.n_frames;
        self.notes.push(("video", format!("{VIDEO_FILE}, {n} frames, decoded by ffmpeg")));
        if n != n_rows as u64 {
            self.warnings.push(format!(
                "{VIDEO_FILE} has {n} frames, odometry.csv {n_rows} rows: colour may be of other frames than depth"
            ));
        }
        self.video = Some(video);
    }
}

/// Time and pose of each frame: columns `timestamp, frame, x, y, z, qx, qy, qz, qw`, and more.
fn odometry(path: &Path) -> Result<BTreeMap<u64, (i64, Pose)>, SourceError> {
    let mut rows = BTreeMap::new();
    for line in text(path)?.lines().skip(1).filter(|line| !line.trim().is_empty()) {
        let row = numbers(line, path)?;
        let bad =
            || wrong(path, format!("found '{line}', expected: timestamp, frame, x, y, z, qx, qy, qz, qw"));
        let &[time, frame, x, y, z, qx, qy, qz, qw, ..] = row.as_slice() else { return Err(bad()) };
        let quaternion = Quaternion::new(qw, qx, qy, qz);
        let is_pose =
            row.iter().take(9).all(|value| value.is_finite()) && (0.9..1.1).contains(&quaternion.norm());
        if !(is_pose && time.abs() < 9e9 && frame >= 0.0) {
            return Err(bad());
        }
        let pose = Pose::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_quaternion(quaternion));
        let frame = files::count(frame).ok_or_else(bad)? as u64;
        rows.insert(frame, (nanos_of(time), pose));
    }
    Ok(rows)
}

/// The camera of the video at the size of other images of it.
fn camera_of(path: &Path, size: (u32, u32)) -> Result<Camera, SourceError> {
    let k = numbers(&text(path)?, path)?;
    let [fx, _, cx, _, fy, cy, _, _, _] = k[..] else {
        return Err(wrong(path, format!("{} numbers, expected the 9 of a 3x3 matrix", k.len())));
    };
    let (sx, sy) = (f64::from(size.0) / VIDEO.0, f64::from(size.1) / VIDEO.1);
    pinhole(size, [fx * sx, fy * sy, cx * sx, cy * sy], UNITS_PER_METRE, path)
}
