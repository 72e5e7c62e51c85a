//! Where the files of a recording are: in a folder, or in a zip file.

use super::codec::DepthCodec;
use super::layouts;
use super::zip::ZipFile;
use crate::{ImageError, SourceError};
use std::path::{Path, PathBuf};
use tessera_frames::decode;

/// The files of a recording by their names relative to it.
#[derive(Clone, Debug)]
pub(super) struct Files {
    root: PathBuf,
    zip: Option<ZipFile>,
}

impl Files {
    pub(super) fn folder(root: &Path) -> Self {
        Self { root: root.to_owned(), zip: None }
    }

    /// # Errors
    /// It is no whole zip file.
    pub(super) fn zip(file: &Path) -> Result<Self, SourceError> {
        Ok(Self { root: file.to_owned(), zip: Some(ZipFile::open(file)?) })
    }

    /// The folder or zip file.
    pub(super) fn root(&self) -> &Path {
        &self.root
    }

    /// A file's path, for people.
    pub(super) fn path(&self, file: &Path) -> PathBuf {
        self.root.join(file)
    }

    /// The path under which any program finds the file, if there is one.
    pub(super) fn own_path(&self, file: &Path) -> Option<PathBuf> {
        self.zip.is_none().then(|| self.root.join(file))
    }

    pub(super) fn is_file(&self, file: &Path) -> bool {
        match &self.zip {
            Some(zip) => zip.is_file(file),
            None => self.root.join(file).is_file(),
        }
    }

    /// Names in a folder of it, sorted.
    pub(super) fn names(&self, folder: &str) -> Vec<String> {
        match &self.zip {
            Some(zip) => zip.names(folder),
            None => layouts::names(&self.root.join(folder)),
        }
    }

    /// # Errors
    /// It cannot be read.
    pub(super) fn read(&self, file: &Path) -> Result<Vec<u8>, ImageError> {
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
        match (&self.zip, codec) {
            (Some(zip), Some(codec)) => codec.inspect_bytes(&zip.read(file)?),
            (Some(zip), None) => decode::inspect_bytes(&zip.read(file)?),
            (None, Some(codec)) => codec.inspect(&self.root.join(file)),
            (None, None) => decode::inspect(&self.root.join(file)),
        }
    }
}
