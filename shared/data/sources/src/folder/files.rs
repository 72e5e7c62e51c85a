//! Where the files of a recording are: in a folder, or in a zip file.

use super::codec::DepthCodec;
use super::layouts;
use super::video::Video;
use super::zip::ZipFile;
use crate::{ImageError, SourceError};
use std::path::{Path, PathBuf};
use tessera_frames::decode;

/// The files of a recording by their names relative to it.
#[derive(Clone, Debug)]
pub(super) struct Files {
    root: PathBuf,
    zip: Option<ZipFile>,
    /// A video whose frames are files too.
    video: Option<Video>,
}

impl Files {
    pub(super) fn folder(root: &Path) -> Self {
        Self { root: root.to_owned(), zip: None, video: None }
    }

    /// With the frames of a video of the folder.
    pub(super) fn with_video(self, video: Option<Video>) -> Self {
        Self { video, ..self }
    }

    /// # Errors
    /// It is no whole zip file.
    pub(super) fn zip(file: &Path) -> Result<Self, SourceError> {
        Ok(Self { root: file.to_owned(), zip: Some(ZipFile::open(file)?), video: None })
    }

    /// The folder or zip file.
    pub(super) fn root(&self) -> &Path {
        &self.root
    }

    /// A file's path, for people.
    pub(super) fn path(&self, file: &Path) -> PathBuf {
        self.root.join(file)
    }

    /// The video that has this image, and the number of the image there.
    fn frame_of(&self, file: &Path) -> Option<(&Video, u64)> {
        let video = self.video.as_ref()?;
        Some((video, video.number_of(file)?))
    }

    /// Decodes what lies before an image of the video, with signs of life.
    pub(super) fn go_to(&self, file: &Path, alive: &mut dyn FnMut()) {
        if let Some((video, number)) = self.frame_of(file) {
            video.go_to(number, alive);
        }
    }

    /// Columns and rows of a colour image that can be read.
    pub(super) fn size_of(&self, file: &Path) -> Option<(u32, u32)> {
        match self.frame_of(file) {
            // All are alike, and none is decoded for it.
            Some((video, _)) => Some(video.size),
            None => decode::size(&self.read(file).ok()?).ok(),
        }
    }

    /// The path under which any program finds the file, if there is one.
    pub(super) fn own_path(&self, file: &Path) -> Option<PathBuf> {
        (self.zip.is_none() && self.frame_of(file).is_none()).then(|| self.root.join(file))
    }

    pub(super) fn is_file(&self, file: &Path) -> bool {
        match &self.zip {
            _ if self.frame_of(file).is_some() => true,
            Some(zip) => zip.is_file(file),
            None => self.root.join(file).is_file(),
        }
    }

    /// Names in a folder of it, sorted.
    pub(super) fn names(&self, folder: &str) -> Vec<String> {
        match &self.zip {
            Some(zip) => zip.names(folder).into_iter().filter(|name| !layouts::is_hidden(name)).collect(),
            None => layouts::names(&self.root.join(folder)),
        }
    }

    /// # Errors
    /// It cannot be read.
    pub(super) fn read(&self, file: &Path) -> Result<Vec<u8>, ImageError> {
        if let Some((video, number)) = self.frame_of(file) {
            return video.read(number);
        }
        match &self.zip {
            Some(zip) => zip.read(file),
            None => std::fs::read(self.root.join(file)).map_err(ImageError::Io),
        }
    }

    /// Looks at an image from outside, a whole file where it takes decompression to do so.
    ///
    /// # Errors
    /// It is not there, or not whole.
    pub(super) fn inspect(&self, file: &Path, codec: Option<DepthCodec>) -> Result<(), ImageError> {
        if self.frame_of(file).is_some() {
            return Ok(());
        }
        match (&self.zip, codec) {
            (Some(zip), Some(codec)) => codec.inspect_bytes(&zip.read(file)?),
            (Some(zip), None) => decode::inspect_bytes(&zip.read(file)?),
            (None, Some(codec)) => codec.inspect(&self.root.join(file)),
            (None, None) => decode::inspect(&self.root.join(file)),
        }
    }
}
