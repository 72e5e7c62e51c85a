//! The file: a head with both cameras, then frame by frame pose, times, and the compressed images.

use crate::SourceError;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// The only version there is.
const VERSION: u32 = 4;
/// Bytes that an image may take.
const MOST_IMAGE: u64 = 64 << 20;
/// Characters of the sensor's name.
const MOST_NAME: u64 = 4096;

/// How depth is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SensDepth {
    Raw,
    Zlib,
}

/// What the file states of all frames.
#[derive(Clone, Debug)]
pub(super) struct SensHead {
    pub(super) sensor: String,
    /// 4x4 matrices, row by row: intrinsics and extrinsics of colour, then of depth.
    pub(super) matrices: [[f32; 16]; 4],
    pub(super) depth: SensDepth,
    pub(super) colour_size: (u32, u32),
    pub(super) depth_size: (u32, u32),
    pub(super) units_per_metre: f32,
}

/// A frame, and where its images lie.
#[derive(Clone, Debug)]
pub(super) struct SensFrame {
    pub(super) world_from_camera: [f32; 16],
    /// Microseconds; 0 where it is not set.
    pub(super) depth_micros: u64,
    /// First byte and length.
    pub(super) colour: (u64, usize),
    pub(super) depth: (u64, usize),
}

struct SensReader<'a> {
    file: BufReader<File>,
    at: u64,
    path: &'a Path,
}

impl SensReader<'_> {
    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], SourceError> {
        let mut bytes = [0; N];
        self.file
            .read_exact(&mut bytes)
            .map_err(|error| self.wrong(&format!("{error}, expected {N} more bytes")))?;
        self.at = self.at.saturating_add(N as u64);
        Ok(bytes)
    }

    fn u32(&mut self) -> Result<u32, SourceError> {
        Ok(u32::from_le_bytes(self.bytes()?))
    }

    fn u64(&mut self) -> Result<u64, SourceError> {
        Ok(u64::from_le_bytes(self.bytes()?))
    }

    fn f32(&mut self) -> Result<f32, SourceError> {
        Ok(f32::from_le_bytes(self.bytes()?))
    }

    fn matrix(&mut self) -> Result<[f32; 16], SourceError> {
        let mut matrix = [0.0; 16];
        for value in &mut matrix {
            *value = self.f32()?;
        }
        Ok(matrix)
    }

    fn skip(&mut self, n_bytes: u64) -> Result<u64, SourceError> {
        let begin = self.at;
        let n = i64::try_from(n_bytes).map_err(|_| self.wrong("a length beyond the file"))?;
        self.file.seek_relative(n).map_err(|error| self.wrong(&error.to_string()))?;
        self.at = begin.saturating_add(n_bytes);
        Ok(begin)
    }

    fn wrong(&self, reason: &str) -> SourceError {
        SourceError::Layout {
            path: self.path.to_owned(),
            reason: format!("at byte {}: {reason} of a .sens file", self.at),
        }
    }

    fn head(&mut self) -> Result<SensHead, SourceError> {
        let version = self.u32()?;
        if version != VERSION {
            return Err(self.wrong(&format!("version {version}, expected {VERSION}")));
        }
        let n_name = self.u64()?;
        if n_name > MOST_NAME {
            return Err(self.wrong(&format!("a name of {n_name} bytes, expected at most {MOST_NAME}")));
        }
        let mut name = Vec::new();
        (&mut self.file)
            .take(n_name)
            .read_to_end(&mut name)
            .map_err(|error| self.wrong(&error.to_string()))?;
        self.at = self.at.saturating_add(n_name);
        let matrices = [self.matrix()?, self.matrix()?, self.matrix()?, self.matrix()?];
        let (_colour, depth) = (self.u32()?, self.u32()?);
        let depth = match depth {
            0 => SensDepth::Raw,
            1 => SensDepth::Zlib,
            other => {
                return Err(self.wrong(&format!("depth compression {other}, expected 0 (raw) or 1 (zlib)")));
            }
        };
        let colour_size = (self.u32()?, self.u32()?);
        let depth_size = (self.u32()?, self.u32()?);
        let units_per_metre = self.f32()?;
        let sensor = String::from_utf8_lossy(&name).into_owned();
        Ok(SensHead { sensor, matrices, depth, colour_size, depth_size, units_per_metre })
    }

    fn frame(&mut self) -> Result<SensFrame, SourceError> {
        let world_from_camera = self.matrix()?;
        let (_colour_micros, depth_micros) = (self.u64()?, self.u64()?);
        let (n_colour, n_depth) = (self.u64()?, self.u64()?);
        let length = |n: u64| usize::try_from(n).ok().filter(|_| n <= MOST_IMAGE);
        let lengths = length(n_colour).zip(length(n_depth));
        let (n_colour_bytes, n_depth_bytes) =
            lengths.ok_or_else(|| self.wrong(&format!("images of {n_colour} and {n_depth} bytes")))?;
        let colour = (self.skip(n_colour)?, n_colour_bytes);
        let depth = (self.skip(n_depth)?, n_depth_bytes);
        Ok(SensFrame { world_from_camera, depth_micros, colour, depth })
    }
}

/// The head and the frames that are whole; a sentence where the file was cut.
pub(super) fn read(path: &Path) -> Result<(SensHead, Vec<SensFrame>, Option<String>), SourceError> {
    let io = |source| SourceError::Io { path: path.to_owned(), source };
    let mut file = File::open(path).map_err(io)?;
    let n_bytes = file.seek(SeekFrom::End(0)).map_err(io)?;
    file.rewind().map_err(io)?;
    let mut reader = SensReader { file: BufReader::new(file), at: 0, path };
    let head = reader.head()?;
    let n_frames = reader.u64()?;
    let mut frames = Vec::new();
    for at in 0..n_frames {
        match reader.frame() {
            Ok(frame) if reader.at <= n_bytes => frames.push(frame),
            Ok(_) | Err(_) => {
                return Ok((
                    head,
                    frames,
                    Some(format!("cut behind frame {at} of {n_frames}: read up to there")),
                ));
            }
        }
    }
    Ok((head, frames, None))
}
