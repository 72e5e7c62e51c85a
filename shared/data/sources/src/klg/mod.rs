//! Logs of ElasticFusion and Kintinuous (`.klg`): a count, then for each frame its time in microseconds, the
//! lengths of both images and the images: depth in millimetres, as it is or by zlib, colour as red, green,
//! blue or JPEG. Neither size nor camera are in the file.

use crate::stored;
use crate::{ImageError, SourceError, SourceOptions};
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use tessera_frames::{
    CameraFile, FrameBuffers, FrameInfo, Pairing, RayLengths, Source, Undistortion, decode,
};
use tessera_geometry::Camera;

/// End of the file's name.
const END: &str = "klg";
/// Raw depth of a metre.
const UNITS_PER_METRE: f64 = 1000.0;
/// Bytes of the count of frames, and of a frame's head.
const COUNT: usize = 4;
const HEAD: usize = 16;

/// A frame, and where its images lie.
#[derive(Clone, Debug)]
struct KlgFrame {
    micros: i64,
    /// First byte and length.
    depth: (u64, usize),
    colour: (u64, usize),
}

/// Frames of one file.
pub(crate) struct KlgSource {
    path: PathBuf,
    file: File,
    frames: Vec<KlgFrame>,
    stamps: Vec<i64>,
    camera: Camera,
    lens: Option<Undistortion>,
    rays: Option<RayLengths>,
    is_colour_wanted: bool,
    description: Vec<(&'static str, String)>,
    warnings: Vec<String>,
}

/// Whether a file is one by its name.
pub(crate) fn is(path: &Path) -> bool {
    path.extension().is_some_and(|end| end.eq_ignore_ascii_case(END))
}

impl KlgSource {
    /// Opens a file: reads where its images lie.
    ///
    /// # Errors
    /// Names the file, what was found and what was expected.
    pub(crate) fn open(path: &Path, options: &SourceOptions, most: Option<u64>) -> Result<Self, SourceError> {
        let io = |source| SourceError::Io { path: path.to_owned(), source };
        let wrong = |reason: String| SourceError::Layout { path: path.to_owned(), reason };
        let file = File::open(path).map_err(io)?;
        let (mut frames, cut) = frames(&file, file.metadata().map_err(io)?.len());
        if frames.is_empty() {
            return Err(wrong("no whole frame, expected a log of ElasticFusion".to_owned()));
        }
        let name = options.camera.as_deref().ok_or_else(|| {
            wrong("a .klg has no camera in it, expected --camera FILE, or --camera primesense for an Xtion or a Kinect of the first kind".to_owned())
        })?;
        let given = CameraFile::named(name)?;
        let mut warnings: Vec<String> = cut.into_iter().chain(given.assumed).collect();
        if given.camera.units_per_metre != UNITS_PER_METRE {
            warnings.push(format!(
                "depth of a .klg is in millimetres, and {name} has units_per_metre = {}: lengths are by the camera file",
                given.camera.units_per_metre
            ));
        }
        frames.truncate(most.and_then(|n| usize::try_from(n).ok()).unwrap_or(usize::MAX));
        let micros: Vec<Option<i64>> = frames.iter().map(|frame| Some(frame.micros)).collect();
        let (stamps, times) = stored::stamps(&micros, options.fps);
        let is_colour_wanted = options.color_topic.as_deref() != Some(crate::COLOUR_NONE);
        let description = vec![
            ("layout", "ElasticFusion's .klg".to_owned()),
            ("camera", name.to_owned()),
            ("colour", if is_colour_wanted { "taken as registered to depth" } else { "left out" }.to_owned()),
            ("times", times),
        ];
        Ok(Self {
            path: path.to_owned(),
            file,
            frames,
            stamps,
            lens: given.lens.map(|lens| Undistortion::new(&lens, &given.camera)),
            rays: given.is_distance.then(|| RayLengths::new(&given.camera)),
            camera: given.camera,
            is_colour_wanted,
            description,
            warnings,
        })
    }

    fn bytes(&self, (begin, length): (u64, usize)) -> Result<Vec<u8>, ImageError> {
        let mut bytes = vec![0; length];
        self.file.read_exact_at(&mut bytes, begin).map_err(ImageError::Io)?;
        Ok(bytes)
    }

    fn depth(&self, frame: &KlgFrame, depth_raw: &mut [u16]) -> Result<(), ImageError> {
        let (_, length) = frame.depth;
        let is_zlib = length != depth_raw.len().saturating_mul(2);
        stored::depth(&self.bytes(frame.depth)?, is_zlib, (self.camera.width, self.camera.height), depth_raw)
    }

    fn colour(&self, frame: &KlgFrame, rgb: &mut [u8]) -> Result<(), ImageError> {
        let bytes = self.bytes(frame.colour)?;
        if bytes.len() == rgb.len() {
            rgb.copy_from_slice(&bytes);
            return Ok(());
        }
        decode::colour(&bytes, (self.camera.width, self.camera.height), rgb)
    }

    fn named(&self, frame: u64) -> impl FnOnce(ImageError) -> SourceError + '_ {
        move |source| SourceError::Image { frame, path: self.path.clone(), source }
    }
}

/// The frames that are whole; a sentence where they are not as many as the count, or more bytes follow.
fn frames(file: &File, n_bytes: u64) -> (Vec<KlgFrame>, Option<String>) {
    let mut count = [0; COUNT];
    let mut found = Vec::new();
    if file.read_exact_at(&mut count, 0).is_err() {
        return (found, None);
    }
    let mut at = COUNT as u64;
    while let Some((frame, end)) = frame(file, at).filter(|(_, end)| *end <= n_bytes) {
        found.push(frame);
        at = end;
    }
    let count = i32::from_le_bytes(count);
    let is_whole = at == n_bytes && usize::try_from(count).is_ok_and(|count| count == found.len());
    let cut = (!is_whole).then(|| {
        format!(
            "the file states {count} frames; {} are whole, and {} bytes follow them",
            found.len(),
            n_bytes.saturating_sub(at)
        )
    });
    (found, cut)
}

/// The frame that begins at a byte, and where the next one does.
fn frame(file: &File, at: u64) -> Option<(KlgFrame, u64)> {
    let mut head = [0; HEAD];
    file.read_exact_at(&mut head, at).ok()?;
    let [micros @ .., _, _, _, _, _, _, _, _] = head;
    let [_, _, _, _, _, _, _, _, depth @ .., _, _, _, _] = head;
    let [.., a, b, c, d] = head;
    let (n_depth, n_colour) = (i32::from_le_bytes(depth), i32::from_le_bytes([a, b, c, d]));
    let (n_depth, n_colour) = (usize::try_from(n_depth).ok()?, usize::try_from(n_colour).ok()?);
    let of_depth = at.checked_add(HEAD as u64)?;
    let of_colour = of_depth.checked_add(n_depth as u64)?;
    let frame = KlgFrame {
        micros: i64::from_le_bytes(micros),
        depth: (of_depth, n_depth),
        colour: (of_colour, n_colour),
    };
    (n_depth > 0).then_some((frame, of_colour.checked_add(n_colour as u64)?))
}

impl Source for KlgSource {
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
        let last = (self.frames.len() as u64).saturating_sub(1);
        let frame = usize::try_from(index).ok().and_then(|at| self.frames.get(at));
        let frame = frame.ok_or(SourceError::NoFrame { frame: index, last })?;
        self.depth(frame, buffers.depth).map_err(self.named(index))?;
        let has_colour = self.is_colour_wanted && frame.colour.1 > 0;
        match has_colour {
            true => {
                let taken = self.colour(frame, buffers.colour).map_err(self.named(index));
                taken.map_err(|error| SourceError::Colour(Box::new(error)))?;
            }
            false => buffers.colour.fill(0),
        }
        if let Some(lens) = &self.lens {
            lens.straighten(1, buffers.depth);
            lens.straighten(3, buffers.colour);
        }
        if let Some(rays) = &self.rays {
            rays.to_depth(buffers.depth);
        }
        let stamp_nanos = self.stamp_nanos(index).unwrap_or_default();
        Ok(FrameInfo { stamp_nanos, has_colour, rotation: None, up: None })
    }

    fn pairing(&self) -> Pairing {
        let n_colour = self.frames.iter().filter(|frame| self.is_colour_wanted && frame.colour.1 > 0).count();
        Pairing { n_depth: self.frames.len(), n_colour, n_pairs: n_colour, ..Pairing::default() }
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
