//! A folder of images: one source for all layouts, which differ in where things lie.

mod codec;
mod colour;
mod files;
mod layouts;
mod list;
mod lzfse;
mod names;
mod pairs;
mod video;
mod zip;

use crate::{ImageError, SourceError, SourceOptions};
use codec::DepthCodec;
use colour::ColourImages;
use files::Files;
use layouts::{Asked, FoundLayout};
pub(crate) use layouts::{is_known, pose_of_matrix};
use list::ListEntry;
pub(crate) use list::is_inside;
pub(crate) use names::nanos_of;
use std::path::{Path, PathBuf};
use tessera_evaluation::Trajectory;
use tessera_frames::imu::{self, ImuRecording};
use tessera_frames::pairing::{pair, uncoloured};
use tessera_frames::timeline::long_pause;
use tessera_frames::{FrameBuffers, FrameInfo, Pairing, RayLengths, Source, TakenColour, Undistortion};
use tessera_geometry::{Camera, InertialRotation};
pub(crate) use zip::begins as is_zip;

/// Confidence of a pixel below which its depth is left out: 0 low, 1 medium, 2 high.
const LEAST_CONFIDENCE: u8 = 1;

/// Frames of a folder, in the order of its depth images. Stamps are those of depth.
#[derive(Clone, Debug)]
pub struct FolderSource {
    files: Files,
    camera: Camera,
    depth: Vec<ListEntry>,
    /// For each depth image its colour image, if there is one near enough.
    colour: Vec<Option<ListEntry>>,
    /// How colour comes to the pixels of depth.
    colour_images: ColourImages,
    /// The form of depth and confidence images.
    codec: DepthCodec,
    /// For each depth image the confidence of its pixels, where the layout has it.
    confidence: Vec<Option<PathBuf>>,
    /// A lens that is taken out of depth, and of colour that is registered to it.
    lens: Option<Undistortion>,
    /// Where depth images hold distances along the ray.
    rays: Option<RayLengths>,
    ground_truth: Option<Trajectory>,
    /// For each depth image, where there is an `imu.txt`.
    rotations: Vec<InertialRotation>,
    imu: ImuRecording,
    pairing: Pairing,
    description: Vec<(&'static str, String)>,
    warnings: Vec<String>,
    doubts: Vec<String>,
}

impl FolderSource {
    /// Opens a folder: recognises its layout, reads the lists, the camera and the ground truth, and
    /// the head of one colour image.
    ///
    /// The camera is `camera` (a built-in name or a file) if given, else `camera.toml` inside, else
    /// what the layout says. At most `frames` depth images are used.
    ///
    /// # Errors
    /// Names the file and line of the first thing that is wrong.
    pub fn open(folder: &Path, camera: Option<&str>, frames: Option<u64>) -> Result<Self, SourceError> {
        let options = SourceOptions { camera: camera.map(str::to_owned), frames, ..SourceOptions::default() };
        Self::open_with(folder, &options)
    }

    /// As [`Self::open`], with a rate for frames without times, and without colour where that is asked for.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_with(folder: &Path, options: &SourceOptions) -> Result<Self, SourceError> {
        if !folder.is_dir() {
            return Err(SourceError::NoFolder { path: folder.to_owned() });
        }
        let asked = Asked::new(options)?;
        let mut found = layouts::read(folder, &asked)?;
        let files = Files::folder(folder).with_video(found.video.take());
        Self::new(files, found, &asked, options.frames)
    }

    /// Opens a zip file that is a recording of Record3D (`.r3d`); `None`: it is another one.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub(crate) fn open_zip(file: &Path, options: &SourceOptions) -> Result<Option<Self>, SourceError> {
        let files = Files::zip(file)?;
        if !layouts::is_recording(&files) {
            return Ok(None);
        }
        let asked = Asked::new(options)?;
        let found = layouts::read_record3d(&files, &asked)?;
        Self::new(files, found, &asked, options.frames).map(Some)
    }

    fn new(
        files: Files,
        found: FoundLayout,
        asked: &Asked,
        frames: Option<u64>,
    ) -> Result<Self, SourceError> {
        let FoundLayout { layout, mut camera, mut camera_from, mut depth, colour, colour_camera, .. } = found;
        let mut warnings = found.warnings;
        let file = asked.camera_file(files.root())?.map(|(file, _)| file);
        let is_distance = file.as_ref().is_some_and(|file| file.is_distance);
        let stated = file.and_then(|file| file.colour);
        let n_listed = colour.len();
        let colour = pairs::that_are_there(&files, colour, &mut warnings);
        camera.colour_registered |= stated.is_some() && !asked.is_without_colour; // Once it is warped.
        let colour_images = match &stated {
            _ if asked.is_without_colour => ColourImages::without("left out, as asked for"),
            Some(stated) => ColourImages::of_stated(&files, &colour, &camera, stated),
            None => ColourImages::choose(&files, &colour, &camera, colour_camera.as_ref()),
        };
        warnings.extend(colour_images.warning.clone());
        let colour = if colour_images.is_used { colour } else { Vec::new() };
        let (stamps, colour_stamps) = (stamps_of(&depth), stamps_of(&colour));
        warnings.extend(long_pause(&stamps).into_iter().chain(pairs::listed_twice(&depth)));
        let mut pairs = pair(&stamps, &colour_stamps);
        depth.truncate(frames.map_or(usize::MAX, |n| usize::try_from(n).unwrap_or(usize::MAX)));
        pairs.truncate(depth.len());
        let stamps = stamps.get(..depth.len()).unwrap_or_default();
        let pairing = pairs.summarise(stamps, &colour_stamps);
        if !asked.is_without_colour && colour_images.warning.is_none() {
            let reason = match n_listed {
                0 => found.no_colour,
                _ => colour.is_empty().then(|| "no colour image is there".to_owned()),
            };
            warnings.extend(uncoloured(stamps, &colour_stamps, &pairs.partners, reason.as_deref()));
        }
        let confidence = pairs::confidence(&files, found.confidence, depth.len(), &mut warnings);
        if let Some(lens) = &found.lens {
            camera_from = format!("{camera_from}, {}", lens.words());
        }
        let lens = found.lens.map(|lens| Undistortion::new(&lens, &camera));
        let rays = is_distance.then(|| RayLengths::new(&camera));
        let imu = imu::load(files.root())?.unwrap_or_default();
        depth.iter_mut().zip(&pairs.taken_nanos).for_each(|(entry, taken)| entry.stamp_nanos = *taken);
        let rotations = imu.rotations(&stamps_of(&depth));
        let colour = pairs.partners.iter().map(|partner| colour.get((*partner)?).cloned()).collect();
        let along_rays = is_distance.then(|| "distances along the ray, as the camera file says".to_owned());
        let mut description = vec![("layout", layout.to_owned()), ("camera", camera_from)];
        description.push(("colour", colour_images.words.clone()));
        description.extend(along_rays.map(|words| ("depth", words)));
        description.extend(imu.words().map(|words| ("imu", words.to_owned())));
        description.extend(found.notes);
        Ok(Self {
            files,
            camera,
            depth,
            colour,
            colour_images,
            codec: found.codec,
            confidence,
            lens,
            rays,
            ground_truth: found.ground_truth,
            rotations,
            imu,
            pairing,
            description,
            warnings,
            doubts: found.doubts,
        })
    }

    fn entry(&self, index: u64) -> Result<(usize, &ListEntry), SourceError> {
        let at = usize::try_from(index).ok();
        at.and_then(|at| Some((at, self.depth.get(at)?)))
            .ok_or(SourceError::NoFrame { frame: index, last: (self.depth.len() as u64).saturating_sub(1) })
    }

    fn colour_of(&self, at: usize) -> Option<&ListEntry> {
        self.colour.get(at)?.as_ref()
    }

    /// Names an image of frame `index` where something fails with it.
    fn named<T>(&self, index: u64, file: &Path, done: Result<T, ImageError>) -> Result<T, SourceError> {
        done.map_err(|source| SourceError::Image { frame: index, path: self.files.path(file), source })
    }

    /// Reads an image of frame `index`.
    fn image<T>(
        &self,
        index: u64,
        file: &Path,
        read: impl FnOnce(&[u8]) -> Result<T, ImageError>,
    ) -> Result<T, SourceError> {
        self.named(index, file, self.files.read(file).and_then(|bytes| read(&bytes)))
    }

    /// Leaves out depth of low confidence; `scratch` holds three bytes a pixel.
    fn leave_out_doubtful(
        &self,
        index: u64,
        at: usize,
        depth_raw: &mut [u16],
        scratch: &mut [u8],
    ) -> Result<(), SourceError> {
        let Some(Some(file)) = self.confidence.get(at) else { return Ok(()) };
        let size = (self.camera.width, self.camera.height);
        self.image(index, file, |bytes| self.codec.confidence(bytes, size, scratch))?;
        for (raw, confidence) in depth_raw.iter_mut().zip(scratch.as_chunks::<3>().0) {
            if confidence[0] < LEAST_CONFIDENCE {
                *raw = 0;
            }
        }
        Ok(())
    }
}

impl Source for FolderSource {
    fn camera(&self) -> &Camera {
        &self.camera
    }

    fn n_frames(&self) -> Option<u64> {
        Some(self.depth.len() as u64)
    }

    fn stamp_nanos(&self, index: u64) -> Option<i64> {
        self.entry(index).ok().map(|(_, entry)| entry.stamp_nanos)
    }

    fn read(&self, index: u64, buffers: &mut FrameBuffers<'_>) -> Result<FrameInfo, SourceError> {
        buffers.check(&self.camera)?;
        let (at, depth) = self.entry(index)?;
        let size = (self.camera.width, self.camera.height);
        self.image(index, &depth.file, |bytes| self.codec.depth(bytes, &self.camera, buffers.depth))?;
        self.leave_out_doubtful(index, at, buffers.depth, buffers.colour)?;
        if let Some(lens) = &self.lens {
            lens.straighten(1, buffers.depth);
        }
        if let Some(rays) = &self.rays {
            rays.to_depth(buffers.depth);
        }
        let colour = self.colour_of(at);
        match colour {
            Some(colour) => self
                .image(index, &colour.file, |bytes| {
                    self.colour_images.read(bytes, size, self.lens.as_ref(), buffers)
                })
                .map_err(|error| SourceError::Colour(Box::new(error)))?,
            None => buffers.colour.fill(0),
        }
        Ok(FrameInfo {
            stamp_nanos: depth.stamp_nanos,
            has_colour: colour.is_some(),
            rotation: self.rotations.get(at).copied(),
            up: self.imu.up_at(depth.stamp_nanos),
        })
    }

    fn colour_as_taken(&self, index: u64) -> Result<Option<TakenColour>, SourceError> {
        let (at, _) = self.entry(index)?;
        let Some(colour) = self.colour_of(at) else { return Ok(None) };
        let own = self.files.own_path(&colour.file);
        self.image(index, &colour.file, |bytes| self.colour_images.as_taken(bytes, own))
    }

    fn go_to(&self, index: u64, alive: &mut dyn FnMut()) {
        let at = usize::try_from(index).ok();
        if let Some(image) = at.and_then(|at| self.colour.get(at..)?.iter().flatten().next()) {
            self.files.go_to(&image.file, alive);
        }
    }

    fn ground_truth(&self) -> Option<&Trajectory> {
        self.ground_truth.as_ref()
    }

    fn pairing(&self) -> Pairing {
        self.pairing
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }

    fn doubts(&self) -> &[String] {
        &self.doubts
    }

    fn inspect(&self, index: u64) -> Result<(), SourceError> {
        let (at, depth) = self.entry(index)?;
        self.named(index, &depth.file, self.files.inspect(&depth.file, Some(self.codec)))?;
        if let Some(Some(file)) = self.confidence.get(at) {
            self.named(index, file, self.files.inspect(file, Some(self.codec)))?;
        }
        match self.colour_of(at) {
            Some(colour) => self.named(index, &colour.file, self.files.inspect(&colour.file, None)),
            None => Ok(()),
        }
    }

    fn description(&self) -> Vec<(&'static str, String)> {
        self.description.clone()
    }
}

fn stamps_of(list: &[ListEntry]) -> Vec<i64> {
    list.iter().map(|entry| entry.stamp_nanos).collect()
}

#[cfg(test)]
mod tests;
