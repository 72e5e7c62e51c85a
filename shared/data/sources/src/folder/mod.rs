//! A folder in the TUM RGB-D layout: `rgb.txt`, `depth.txt`, images, `groundtruth.txt` and `imu.txt` if there.

mod list;

use crate::{ImageError, SourceError};
use list::ListEntry;
use std::path::{Path, PathBuf};
use tessera_evaluation::{Trajectory, read_tum};
use tessera_frames::cameras::{load_camera, named_camera};
use tessera_frames::decode;
use tessera_frames::imu;
use tessera_frames::pairing::{pair, summarise};
use tessera_frames::{FrameBuffers, FrameInfo, Pairing, Source};
use tessera_geometry::{Camera, InertialRotation};

/// Frames of a folder, in the order of `depth.txt`. Stamps are those of depth.
#[derive(Clone, Debug)]
pub struct FolderSource {
    folder: PathBuf,
    camera: Camera,
    depth: Vec<ListEntry>,
    /// For each depth image its colour image, if there is one near enough.
    colour: Vec<Option<ListEntry>>,
    ground_truth: Option<Trajectory>,
    /// For each depth image, where there is an `imu.txt`.
    rotations: Vec<InertialRotation>,
    pairing: Pairing,
}

impl FolderSource {
    /// Opens a folder: reads the lists, the camera and the ground truth, no image yet.
    ///
    /// The camera is `camera` (a built-in name or a file) if given, else `camera.toml` inside.
    /// At most `frames` depth images are used.
    ///
    /// # Errors
    /// Names the file and line of the first thing that is wrong.
    pub fn open(folder: &Path, camera: Option<&str>, frames: Option<u64>) -> Result<Self, SourceError> {
        if !folder.is_dir() {
            return Err(SourceError::NoFolder { path: folder.to_owned() });
        }
        let mut depth = list::read(&folder.join("depth.txt"))?;
        let colour = list::read(&folder.join("rgb.txt"))?;
        let camera = match camera {
            Some(name) => named_camera(name)?,
            None => load_own_camera(folder)?,
        };
        let truth_file = folder.join("groundtruth.txt");
        let ground_truth = if truth_file.exists() { Some(read_tum(&truth_file)?) } else { None };
        let times = |list: &[ListEntry]| list.iter().map(|entry| entry.stamp_nanos).collect::<Vec<i64>>();
        let (mut stamps, colour_stamps) = (times(&depth), times(&colour));
        let mut partners = pair(&stamps, &colour_stamps);
        if let Some(frames) = frames {
            let kept = usize::try_from(frames).unwrap_or(usize::MAX).min(depth.len());
            depth.truncate(kept);
            stamps.truncate(kept);
            partners.truncate(kept);
        }
        let pairing = summarise(&stamps, &colour_stamps, &partners);
        let rotations = imu::load(folder)?
            .map_or(Vec::new(), |(gyroscope, samples)| imu::rotations(&gyroscope, &samples, &stamps));
        let colour = partners.iter().map(|partner| partner.map(|at| colour[at].clone())).collect();
        Ok(Self { folder: folder.to_owned(), camera, depth, colour, ground_truth, rotations, pairing })
    }

    fn entry(&self, index: u64) -> Option<(usize, &ListEntry)> {
        let at = usize::try_from(index).ok()?;
        Some((at, self.depth.get(at)?))
    }
}

fn load(path: &Path) -> Result<Vec<u8>, ImageError> {
    std::fs::read(path).map_err(ImageError::Io)
}

fn load_own_camera(folder: &Path) -> Result<Camera, SourceError> {
    let file = folder.join("camera.toml");
    if !file.exists() {
        return Err(SourceError::NoCamera { folder: folder.to_owned() });
    }
    load_camera(&file)
}

impl Source for FolderSource {
    fn camera(&self) -> &Camera {
        &self.camera
    }

    fn n_frames(&self) -> Option<u64> {
        Some(self.depth.len() as u64)
    }

    fn stamp_nanos(&self, index: u64) -> Option<i64> {
        self.entry(index).map(|(_, entry)| entry.stamp_nanos)
    }

    fn read(&self, index: u64, buffers: &mut FrameBuffers<'_>) -> Result<FrameInfo, SourceError> {
        buffers.check(&self.camera)?;
        let (at, depth) = self.entry(index).ok_or(SourceError::NoFrame {
            frame: index,
            last: (self.depth.len() as u64).saturating_sub(1),
        })?;
        let size = (self.camera.width, self.camera.height);
        let located = |entry: &ListEntry| {
            let path = self.folder.join(&entry.file);
            (path.clone(), move |source: ImageError| SourceError::Image { frame: index, path, source })
        };
        let (path, failed) = located(depth);
        load(&path).and_then(|bytes| decode::depth(&bytes, size, buffers.depth)).map_err(failed)?;
        match &self.colour[at] {
            Some(colour) => {
                let (path, failed) = located(colour);
                load(&path).and_then(|bytes| decode::colour(&bytes, size, buffers.colour)).map_err(failed)?;
            }
            None => buffers.colour.fill(0),
        }
        Ok(FrameInfo {
            stamp_nanos: depth.stamp_nanos,
            has_colour: self.colour[at].is_some(),
            rotation: self.rotations.get(at).copied(),
        })
    }

    fn ground_truth(&self) -> Option<&Trajectory> {
        self.ground_truth.as_ref()
    }

    fn pairing(&self) -> Pairing {
        self.pairing
    }
}

#[cfg(test)]
mod tests;
