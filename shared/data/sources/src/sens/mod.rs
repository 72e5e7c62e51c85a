//! ScanNet's `.sens`: one file with the frames, cameras and poses of a scan.

mod file;

use crate::folder::pose_of_matrix;
use crate::stored;
use crate::{ImageError, SourceError, SourceOptions};
use file::{SensDepth, SensFrame, SensHead};
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use tessera_evaluation::Trajectory;
use tessera_frames::{
    CameraFile, ColourCamera, ColourWarp, FrameBuffers, FrameInfo, Pairing, RayLengths, Source, TakenColour,
    Undistortion, decode, large,
};
use tessera_geometry::{Camera, Pose};

/// End of the file's name.
const END: &str = "sens";
/// How far an extrinsic matrix may be from none.
const SAME_PLACE: f32 = 1e-4;

/// Frames of one file.
pub(crate) struct SensSource {
    path: PathBuf,
    file: File,
    head: SensHead,
    frames: Vec<SensFrame>,
    stamps: Vec<i64>,
    camera: Camera,
    lens: Option<Undistortion>,
    rays: Option<RayLengths>,
    warp: Option<ColourWarp>,
    ground_truth: Option<Trajectory>,
    description: Vec<(&'static str, String)>,
    warnings: Vec<String>,
}

/// Whether a file is one by its name.
pub(crate) fn is(path: &Path) -> bool {
    path.extension().is_some_and(|end| end.eq_ignore_ascii_case(END))
}

/// The only one in a folder, as ScanNet's scenes lie.
pub(crate) fn inside(folder: &Path) -> Option<PathBuf> {
    let files = std::fs::read_dir(folder).ok()?.flatten().map(|entry| entry.path());
    let mut found = files.filter(|path| is(path) && path.is_file());
    let first = found.next();
    first.filter(|_| found.next().is_none())
}

impl SensSource {
    /// Opens a file: reads its head, and where its images lie.
    ///
    /// # Errors
    /// Names the file and the byte where it is wrong.
    pub(crate) fn open(
        path: &Path,
        options: &SourceOptions,
        frames: Option<u64>,
    ) -> Result<Self, SourceError> {
        let (head, mut found, cut) = file::read(path)?;
        if found.is_empty() {
            let reason = "no whole frame, expected a recording of ScanNet".to_owned();
            return Err(SourceError::Layout { path: path.to_owned(), reason });
        }
        let mut warnings: Vec<String> = cut.into_iter().collect();
        found.truncate(frames.and_then(|n| usize::try_from(n).ok()).unwrap_or(usize::MAX));
        let micros: Vec<Option<i64>> =
            found.iter().map(|frame| i64::try_from(frame.depth_micros).ok()).collect();
        let (stamps, times) = stored::stamps(&micros, options.fps);
        let given = options.camera.as_deref().map(CameraFile::named).transpose()?;
        let mut is_distance = false;
        let mut lens = None;
        let (camera, from) = match (given, &options.camera) {
            (Some(given), Some(name)) => {
                warnings.extend(given.assumed);
                is_distance = given.is_distance;
                lens = given.lens.map(|lens| Undistortion::new(&lens, &given.camera));
                (given.camera, name.clone())
            }
            _ => (own_camera(&head, path)?, format!("{} in the file", head.sensor)),
        };
        let is_wanted = options.color_topic.as_deref() != Some(crate::COLOUR_NONE);
        let warp = is_wanted.then(|| colour_warp(&head, &camera)).transpose().unwrap_or_else(|why| {
            warnings.push(format!("no frame has colour: {why}; depth alone is used"));
            None
        });
        let colour = match &warp {
            Some(warp) => format!("{}x{} px, warped to depth by both cameras", warp.size.0, warp.size.1),
            None => "left out".to_owned(),
        };
        let rays = is_distance.then(|| RayLengths::new(&camera));
        let ground_truth = poses(&found, &stamps, path, &mut warnings);
        let file = File::open(path).map_err(|source| SourceError::Io { path: path.to_owned(), source })?;
        let description = vec![
            ("layout", "ScanNet's .sens".to_owned()),
            ("camera", from),
            ("colour", colour),
            ("times", times),
        ];
        Ok(Self {
            path: path.to_owned(),
            file,
            head,
            frames: found,
            stamps,
            camera,
            lens,
            rays,
            warp,
            ground_truth,
            description,
            warnings,
        })
    }

    fn frame(&self, index: u64) -> Result<(usize, &SensFrame), SourceError> {
        let at = usize::try_from(index).ok();
        at.and_then(|at| Some((at, self.frames.get(at)?)))
            .ok_or(SourceError::NoFrame { frame: index, last: (self.frames.len() as u64).saturating_sub(1) })
    }

    fn bytes(&self, (begin, length): (u64, usize)) -> Result<Vec<u8>, ImageError> {
        let mut bytes = vec![0; length];
        self.file.read_exact_at(&mut bytes, begin).map_err(ImageError::Io)?;
        Ok(bytes)
    }

    fn depth(&self, frame: &SensFrame, depth_raw: &mut [u16]) -> Result<(), ImageError> {
        let (is_zlib, size) = (self.head.depth == SensDepth::Zlib, (self.camera.width, self.camera.height));
        stored::depth(&self.bytes(frame.depth)?, is_zlib, size, depth_raw)
    }

    fn colour(&self, frame: &SensFrame, warp: &ColourWarp) -> Result<Vec<u8>, ImageError> {
        let n_pixels = (warp.size.0 as usize).saturating_mul(warp.size.1 as usize);
        let mut rgb = vec![0; n_pixels.saturating_mul(3)];
        decode::colour(&self.bytes(frame.colour)?, warp.size, &mut rgb)?;
        Ok(rgb)
    }

    fn named(&self, frame: u64) -> impl FnOnce(ImageError) -> SourceError + '_ {
        move |source| SourceError::Image { frame, path: self.path.clone(), source }
    }
}

fn own_camera(head: &SensHead, path: &Path) -> Result<Camera, SourceError> {
    let [_, _, intrinsics, _] = &head.matrices;
    let camera = pinhole(head.depth_size, intrinsics, f64::from(head.units_per_metre));
    large::check_camera(&camera)
        .map_err(|source| SourceError::CameraValue { file: path.display().to_string(), source })?;
    Ok(camera)
}

fn pinhole(size: (u32, u32), matrix: &[f32; 16], units_per_metre: f64) -> Camera {
    let &[fx, _, cx, _, _, fy, cy, ..] = matrix;
    Camera::pinhole(size, [fx, fy, cx, cy].map(f64::from), units_per_metre)
}

/// Colour is larger than depth and seen from the same place.
fn colour_warp(head: &SensHead, depth: &Camera) -> Result<ColourWarp, String> {
    let [intrinsics, of_colour, _, of_depth] = &head.matrices;
    if of_colour.iter().zip(of_depth).any(|(a, b)| !((a - b).abs() <= SAME_PLACE)) {
        return Err("its camera is at another place than that of depth, which is not read".to_owned());
    }
    let camera = pinhole(head.colour_size, intrinsics, 1000.0);
    let colour = ColourCamera { camera, colour_from_depth: Pose::identity() };
    ColourWarp::new(depth, &colour.camera, colour.colour_from_depth)
        .ok_or_else(|| format!("the numbers of its camera cannot be: {intrinsics:?}"))
}

/// Poses that are known; those of frames that were not placed are not finite.
fn poses(
    frames: &[SensFrame],
    stamps: &[i64],
    path: &Path,
    warnings: &mut Vec<String>,
) -> Option<Trajectory> {
    let mut poses = Trajectory::default();
    for (frame, stamp) in frames.iter().zip(stamps) {
        match pose_of_matrix(&frame.world_from_camera.map(f64::from), path) {
            Ok(Some(pose)) => {
                // Stamps rise.
                let _ = poses.push(*stamp, pose);
            }
            Ok(None) => {}
            Err(error) => {
                warnings.push(format!("no ground truth: {error}"));
                return None;
            }
        }
    }
    (!poses.poses.is_empty()).then_some(poses)
}

impl Source for SensSource {
    fn camera(&self) -> &Camera {
        &self.camera
    }

    fn n_frames(&self) -> Option<u64> {
        Some(self.frames.len() as u64)
    }

    fn stamp_nanos(&self, index: u64) -> Option<i64> {
        self.stamps.get(usize::try_from(index).ok()?).copied()
    }

    fn read(&self, index: u64, buffers: &mut FrameBuffers<'_>) -> Result<FrameInfo, SourceError> {
        buffers.check(&self.camera)?;
        let (at, frame) = self.frame(index)?;
        self.depth(frame, buffers.depth).map_err(self.named(index))?;
        if let Some(lens) = &self.lens {
            lens.straighten(1, buffers.depth);
        }
        if let Some(rays) = &self.rays {
            rays.to_depth(buffers.depth);
        }
        match &self.warp {
            Some(warp) => {
                let taken = self.colour(frame, warp).map_err(self.named(index));
                let taken = taken.map_err(|error| SourceError::Colour(Box::new(error)))?;
                warp.apply(buffers.depth, &taken, buffers.colour);
            }
            None => buffers.colour.fill(0),
        }
        let stamp_nanos = self.stamps.get(at).copied().unwrap_or_default();
        Ok(FrameInfo { stamp_nanos, has_colour: self.warp.is_some(), rotation: None, up: None })
    }

    fn colour_as_taken(&self, index: u64) -> Result<Option<TakenColour>, SourceError> {
        let (_, frame) = self.frame(index)?;
        let Some(warp) = &self.warp else { return Ok(None) };
        let rgb = self.colour(frame, warp).map_err(self.named(index))?;
        Ok(Some(TakenColour { camera: warp.colour_camera(), rgb, file: None }))
    }

    fn ground_truth(&self) -> Option<&Trajectory> {
        self.ground_truth.as_ref()
    }

    fn pairing(&self) -> Pairing {
        let n = self.stamps.len();
        let n_colour = if self.warp.is_some() { n } else { 0 };
        Pairing { n_depth: n, n_colour, n_pairs: n_colour, ..Pairing::default() }
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }

    fn description(&self) -> Vec<(&'static str, String)> {
        self.description.clone()
    }
}

#[cfg(test)]
mod tests;
