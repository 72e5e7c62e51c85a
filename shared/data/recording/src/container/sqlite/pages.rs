//! A database's pages, read one by one.
//!
//! Source: sqlite.org/fileformat2.html, sections 1.3 (the database header) and 3 to 4 (journals).

use crate::container::read_whole;
use crate::error::RecordingError;
use std::fs::File;
use std::path::{Path, PathBuf};

/// Bytes of the database header, at the front of page 1.
pub(super) const HEADER_BYTES: usize = 100;
/// Text encoding 1.
const UTF8: u32 = 1;

/// A database file of which every page is where its header says.
#[derive(Debug)]
pub(super) struct Pages {
    file: File,
    /// Bytes of a page.
    pub(super) size: usize,
    /// Bytes of a page without those reserved at its end.
    pub(super) usable: usize,
    /// Pages of the file; the first is 1.
    pub(super) n: u32,
}

impl Pages {
    /// Checks header and companions of a file that begins with the magic word.
    pub(super) fn open(file: File, path: &Path) -> Result<Self, RecordingError> {
        let wrong = |words: String| Err(RecordingError::Database(words));
        let mut header = [0u8; HEADER_BYTES];
        if read_whole(&file, 0, &mut header)? < HEADER_BYTES {
            return wrong("is an SQLite database that was cut within its header".to_owned());
        }
        let short = |at| short(&header, at).unwrap_or_default();
        let word = |at| word(&header, at).unwrap_or_default();
        // 65536 does not fit and is written as 1.
        let size = if short(16) == 1 { 65536 } else { usize::from(short(16)) };
        let usable = size.saturating_sub(usize::from(header[20]));
        if !size.is_power_of_two() || size < 512 || usable < 480 {
            return wrong(format!("is an SQLite database with pages of {size} bytes, expected 512 to 65536"));
        }
        if header[19] > 2 {
            return wrong(format!("is an SQLite database of read version {}, expected 1 or 2", header[19]));
        }
        if !matches!(word(56), 0 | UTF8) {
            return wrong(format!("is an SQLite database with text encoding {}, expected UTF-8", word(56)));
        }
        for (end, what) in [("-wal", "write-ahead log"), ("-journal", "rollback journal")] {
            refuse_companion(path, end, what)?;
        }
        let n_bytes = file.metadata()?.len();
        let n = u32::try_from(n_bytes.checked_div(size as u64).unwrap_or(0)).unwrap_or(u32::MAX);
        // The count is valid where two counters of changes agree.
        let expected = if word(24) == word(92) { word(28) } else { n };
        if n < expected {
            return wrong(format!(
                "is an SQLite database that was cut: {n_bytes} bytes, expected {expected} pages of {size} bytes; copy it \
                 again, or save what is left: sqlite3 FILE.db3 .recover | sqlite3 NEW.db3"
            ));
        }
        Ok(Self { file, size, usable, n })
    }

    /// Where a page begins in the file.
    pub(super) fn offset(&self, page: u32) -> u64 {
        u64::from(page.saturating_sub(1)).saturating_mul(self.size as u64)
    }

    /// The page at an offset of the file.
    pub(super) fn page_at(&self, offset: u64) -> u32 {
        let before = offset.checked_div(self.size as u64).unwrap_or(u64::MAX);
        u32::try_from(before.saturating_add(1)).unwrap_or(u32::MAX)
    }

    /// Reads a page.
    pub(super) fn read(&self, page: u32) -> Result<Vec<u8>, RecordingError> {
        let damaged = |reason| RecordingError::Damaged { offset: self.offset(page), reason };
        if page == 0 || page > self.n {
            return Err(damaged(format!("page {page} is used, the database has {} pages", self.n)));
        }
        let mut bytes = vec![0; self.size];
        let n = read_whole(&self.file, self.offset(page), &mut bytes)?;
        if n < self.size {
            return Err(damaged(format!("page {page} has {n} bytes, expected {}", self.size)));
        }
        bytes.truncate(self.usable);
        Ok(bytes)
    }
}

/// A number of two bytes.
pub(super) fn short(bytes: &[u8], at: usize) -> Option<u16> {
    bytes.get(at..)?.first_chunk().map(|short| u16::from_be_bytes(*short))
}

/// A number of four bytes.
pub(super) fn word(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().map(|word| u32::from_be_bytes(*word))
}

/// Changes in a file beside the database are not in it yet, or have to be taken back.
fn refuse_companion(path: &Path, end: &str, what: &str) -> Result<(), RecordingError> {
    let mut name = path.as_os_str().to_owned();
    name.push(end);
    let companion = PathBuf::from(name);
    if companion.metadata().is_ok_and(|file| file.len() > 0) {
        return Err(RecordingError::Database(format!(
            "has a {what} beside it, {}: it was not closed, or is being recorded; end the recording, or fold it in: \
             sqlite3 {} 'PRAGMA wal_checkpoint(TRUNCATE); PRAGMA integrity_check'",
            companion.display(),
            path.display()
        )));
    }
    Ok(())
}
