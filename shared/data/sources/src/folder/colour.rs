//! How the colour images of a folder come to the pixels of depth: as they are, warped, or not at all.

use super::files::Files;
use super::list::ListEntry;
use crate::ImageError;
use std::path::PathBuf;
use tessera_frames::{ColourCamera, ColourWarp, FrameBuffers, TakenColour, Undistortion, decode};
use tessera_geometry::Camera;

/// What is done with colour images.
#[derive(Clone, Debug)]
pub(super) struct ColourImages {
    pub(super) is_used: bool,
    /// What is done, for people.
    pub(super) words: String,
    pub(super) warning: Option<String>,
    warp: Option<ColourWarp>,
}

impl ColourImages {
    /// No colour, and why.
    pub(super) fn without(words: &str) -> Self {
        Self { is_used: false, words: words.to_owned(), warning: None, warp: None }
    }

    /// Images of a form that is not read.
    fn unreadable(reason: &str) -> Self {
        let warning = format!("no frame has colour: {reason}; depth alone is used");
        Self { is_used: false, words: format!("left out: {reason}"), warning: Some(warning), warp: None }
    }

    /// Images of the camera that the camera file states for them; left out where none of the first has
    /// its size.
    pub(super) fn of_stated(
        files: &Files,
        images: &[ListEntry],
        depth: &Camera,
        stated: &ColourCamera,
    ) -> Self {
        let sizes = sizes(files, images);
        let size = (stated.camera.width, stated.camera.height);
        let Some(first) = sizes.first() else {
            return unreadable(files, images)
                .map_or(Self::without("none"), |reason| Self::unreadable(&reason));
        };
        let warp = ColourWarp::new(depth, &stated.camera, stated.colour_from_depth);
        let (width, height) = size;
        if let Some(warp) = warp.filter(|_| sizes.contains(&size)) {
            let words = format!("{width}x{height} px, warped to depth by both cameras");
            return Self { is_used: true, words, warning: None, warp: Some(warp) };
        }
        let (found, expected) = (format!("{}x{} px", first.0, first.1), format!("{width}x{height} px"));
        let warning =
            format!("colour is {found}, the camera file's [colour] says {expected}: colour is left out");
        let words = format!("left out: {found}, not {expected}");
        Self { is_used: false, words, warning: Some(warning), warp: None }
    }

    /// Looks at the first colour image that can be read: one of the size of depth is taken as
    /// registered, another one needs its own camera.
    pub(super) fn choose(
        files: &Files,
        images: &[ListEntry],
        depth: &Camera,
        colour: Option<&ColourCamera>,
    ) -> Self {
        if images.is_empty() {
            return Self::without("none");
        }
        let used = |words: &str, warp| Self { is_used: true, words: words.to_owned(), warning: None, warp };
        let sizes = sizes(files, images);
        if let (true, Some(reason)) = (sizes.is_empty(), unreadable(files, images)) {
            return Self::unreadable(&reason);
        }
        let depth_size = (depth.width, depth.height);
        // One odd image among those of the size of depth is a frame's problem.
        let Some(size) = sizes.first().copied().filter(|_| !sizes.contains(&depth_size)) else {
            let words = if depth.colour_registered {
                "registered to depth"
            } else {
                "of the size of depth, not registered"
            };
            return used(words, None);
        };
        let (width, height) = size;
        let warp = colour.and_then(|colour| {
            let camera = Camera { width, height, ..colour.camera.clone() };
            ColourWarp::new(depth, &camera, colour.colour_from_depth)
        });
        if warp.is_some() {
            return used(&format!("{width}x{height} px, warped to depth by both cameras"), warp);
        }
        let warning = format!(
            "colour is {width}x{height} px, depth {}x{} px, and nothing says how they belong together: colour is left out",
            depth_size.0, depth_size.1
        );
        let words = format!("left out: {width}x{height} px, not registered to depth");
        Self { is_used: false, words, warning: Some(warning), warp: None }
    }

    /// Decodes a colour image to the pixels of depth, `size` columns and rows; `lens` was taken out of depth.
    pub(super) fn read(
        &self,
        bytes: &[u8],
        size: (u32, u32),
        lens: Option<&Undistortion>,
        buffers: &mut FrameBuffers<'_>,
    ) -> Result<(), ImageError> {
        match (&self.warp, lens) {
            (None, None) => decode::colour(bytes, size, buffers.colour)?,
            (None, Some(lens)) => lens.apply(3, &decoded(bytes, size)?, buffers.colour),
            (Some(warp), _) => warp.apply(buffers.depth, &decoded(bytes, warp.size)?, buffers.colour),
        }
        Ok(())
    }

    /// Decodes a colour image that is to be warped, as it was taken; `None` where it has the pixels of depth.
    pub(super) fn as_taken(
        &self,
        bytes: &[u8],
        file: Option<PathBuf>,
    ) -> Result<Option<TakenColour>, ImageError> {
        let Some(warp) = &self.warp else { return Ok(None) };
        let rgb = decoded(bytes, warp.size)?;
        Ok(Some(TakenColour { camera: warp.colour_camera(), rgb, file }))
    }
}

/// An image of these columns and rows.
fn decoded(bytes: &[u8], size: (u32, u32)) -> Result<Vec<u8>, ImageError> {
    let n_pixels = (size.0 as usize).saturating_mul(size.1 as usize);
    let mut rgb = vec![0; n_pixels.saturating_mul(3)];
    decode::colour(bytes, size, &mut rgb)?;
    Ok(rgb)
}

/// Colour images whose size is asked for before giving up.
const MOST_TRIED: usize = 5;

/// Columns and rows of those of some images, spread over all, that can be read.
fn sizes(files: &Files, images: &[ListEntry]) -> Vec<(u32, u32)> {
    let size_of = |entry: &ListEntry| files.size_of(&entry.file);
    some(images).filter_map(size_of).collect()
}

fn some(images: &[ListEntry]) -> impl Iterator<Item = &ListEntry> {
    let n = MOST_TRIED.min(images.len());
    (0..n).filter_map(move |at| images.get(at.saturating_mul(images.len()).checked_div(n)?))
}

/// Why the first of these images cannot be read.
fn unreadable(files: &Files, images: &[ListEntry]) -> Option<String> {
    let first = images.first()?;
    let error = files.read(&first.file).and_then(|bytes| decode::size(&bytes)).err()?;
    Some(format!("{}: {error}", first.file.display()))
}
