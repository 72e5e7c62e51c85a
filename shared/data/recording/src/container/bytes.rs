//! Bytes of a part of a file, as they are stored or behind a compression.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::os::unix::fs::FileExt;

/// Compressed bytes that are read at once.
const READ_BYTES: usize = 1 << 16;
/// Memory taken for a record before any of it has been read.
const FIRST_BYTES: u64 = 4 << 20;

/// Bytes one behind the other.
pub(super) enum Bytes<'a> {
    Plain(Section<'a>),
    Compressed(Box<dyn Read + 'a>),
}

/// Bytes of the file from the offset `at`.
pub(super) struct Section<'a> {
    pub(super) file: &'a File,
    pub(super) at: u64,
    pub(super) end: u64,
}

impl<'a> Section<'a> {
    /// Bytes still to come.
    pub(super) fn n_left(&self) -> u64 {
        self.end.saturating_sub(self.at)
    }

    /// A reader for a decompression.
    pub(super) fn buffered(self) -> BufReader<Section<'a>> {
        BufReader::with_capacity(READ_BYTES, self)
    }
}

impl Read for Section<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let n = usize::try_from(self.n_left()).unwrap_or(usize::MAX).min(bytes.len());
        let n = self.file.read_at(bytes.get_mut(..n).unwrap_or_default(), self.at)?;
        self.at = self.at.saturating_add(n as u64);
        Ok(n)
    }
}

impl Read for Bytes<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Plain(section) => section.read(bytes),
            Self::Compressed(inside) => inside.read(bytes),
        }
    }
}

/// Reads at most `n` bytes; answers how many came. Memory grows as they come: what a damaged head
/// declares is not believed.
pub(super) fn fill(from: impl Read, n: u64, to: &mut Vec<u8>) -> io::Result<u64> {
    to.clear();
    to.reserve(usize::try_from(n.min(FIRST_BYTES)).unwrap_or_default());
    from.take(n).read_to_end(to).map(|found| found as u64)
}
