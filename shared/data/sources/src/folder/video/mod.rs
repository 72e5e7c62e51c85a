//! A video as images of a folder: `rgb.mp4/12` is its frame 12, counted from 0.
//!
//! Frames are decoded in their order. One that lies before the last is decoded from the beginning again: no frame is
//! found by its time, so that the same number is always the same image, after a restart too.

mod ffmpeg;

use crate::ImageError;
use ffmpeg::{Ffmpeg, FrameStream};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use tessera_frames::decode;

/// Frames that are kept when one behind them is asked for first, as threads do that read ahead.
const MOST_KEPT: usize = 16;

/// A video of a folder.
#[derive(Clone, Debug)]
pub(super) struct Video {
    /// Relative to the folder.
    file: PathBuf,
    path: PathBuf,
    ffmpeg: Ffmpeg,
    pub(super) n_frames: u64,
    /// Columns and rows.
    pub(super) size: (u32, u32),
    decoding: Arc<Mutex<Decoding>>,
}

/// How far it is decoded.
#[derive(Debug, Default)]
struct Decoding {
    stream: Option<FrameStream>,
    /// The next frame of the stream.
    next: u64,
    /// Frames that were passed over, and the one that was given last.
    kept: BTreeMap<u64, Vec<u8>>,
    last: u64,
    /// The first frame that cannot be had, and why.
    end: Option<(u64, String)>,
}

impl Video {
    /// Counts the frames of a video and decodes the first.
    ///
    /// # Errors
    /// A sentence: there is no ffmpeg on this machine, or its complaint about the file.
    pub(super) fn open(folder: &Path, file: &str) -> Result<Self, String> {
        Self::open_with(folder, file, "ffmpeg")
    }

    fn open_with(folder: &Path, file: &str, program: &str) -> Result<Self, String> {
        let path = folder.join(file);
        let ffmpeg = Ffmpeg::find(program, &path)?;
        let n_frames = ffmpeg.count(&path)?;
        let first = ffmpeg.decode(&path)?.next()?.ok_or("no frame")?;
        let size = decode::size(&first).map_err(|error| error.to_string())?;
        Ok(Self { file: file.into(), path, ffmpeg, n_frames, size, decoding: Arc::default() })
    }

    /// The name of a frame among the files of the folder.
    pub(super) fn name_of(&self, number: u64) -> PathBuf {
        self.file.join(number.to_string())
    }

    /// The number of a frame by its name; `None`: it is none of this video.
    pub(super) fn number_of(&self, file: &Path) -> Option<u64> {
        let number = file.strip_prefix(&self.file).ok()?.to_str()?.parse().ok()?;
        (number < self.n_frames).then_some(number)
    }

    /// A frame as an image.
    ///
    /// # Errors
    /// It cannot be decoded.
    pub(super) fn read(&self, number: u64) -> Result<Vec<u8>, ImageError> {
        let mut decoding = self.decoding.lock().unwrap_or_else(PoisonError::into_inner);
        while !decoding.kept.contains_key(&number) {
            let (at, image) = self.advance(&mut decoding, number)?;
            decoding.kept.insert(at, image);
            if decoding.kept.len() > MOST_KEPT {
                decoding.kept.pop_first();
            }
        }
        let before = std::mem::replace(&mut decoding.last, number);
        if before != number {
            decoding.kept.remove(&before);
        }
        Ok(decoding.kept.get(&number).cloned().unwrap_or_default())
    }

    /// Decodes what lies before a frame, with a sign of life for each.
    pub(super) fn go_to(&self, number: u64, alive: &mut dyn FnMut()) {
        let mut decoding = self.decoding.lock().unwrap_or_else(PoisonError::into_inner);
        if decoding.next > number && !decoding.kept.contains_key(&number) {
            *decoding = Decoding { end: decoding.end.take(), ..Decoding::default() };
        }
        while decoding.next < number && self.advance(&mut decoding, number).is_ok() {
            alive();
        }
    }

    /// The next frame of the stream, from the beginning where it is beyond that one.
    fn advance(&self, decoding: &mut Decoding, number: u64) -> Result<(u64, Vec<u8>), ImageError> {
        if let Some((_, reason)) = decoding.end.as_ref().filter(|(end, _)| number >= *end) {
            return Err(damaged(reason));
        }
        if decoding.next > number || decoding.stream.is_none() {
            decoding.stream = Some(self.ffmpeg.decode(&self.path).map_err(|reason| damaged(&reason))?);
            decoding.next = 0;
            // Later ones would push the one that is asked for out.
            decoding.kept.clear();
        }
        let at = decoding.next;
        let image = match decoding.stream.as_mut().map(FrameStream::next) {
            Some(Ok(Some(image))) => Ok(image),
            Some(Err(reason)) => Err(reason),
            _ => Err(format!("{at} frames were decoded, expected {}", self.n_frames)),
        };
        decoding.next = at.saturating_add(1);
        if image.is_err() || decoding.next >= self.n_frames {
            decoding.stream = None; // Which ends the program.
        }
        image.map(|image| (at, image)).map_err(|reason| {
            decoding.end = Some((at, reason.clone()));
            damaged(&reason)
        })
    }
}

fn damaged(message: &str) -> ImageError {
    ImageError::Damaged { format: "video", message: message.to_owned() }
}

#[cfg(test)]
pub(super) mod tests;
