//! Reading records one after another, and where between two of them a reader stands.

use crate::error::JournalError;
use crate::framing::{
    FILE_HEADER_BYTES, FileStart, RECORD_HEADER_BYTES, RecordHead, check_file_header, first_link,
    record_header,
};
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;

/// A place between two records of a journal: enough to go on from there, and to see whether a file
/// still is the journal in which it was taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Mark {
    /// Records before it.
    pub n_records: u64,
    /// Byte offset of the next record.
    pub(crate) end: u64,
    /// Checksum of the last record: the chain goes on from it.
    pub(crate) link: u32,
    /// Byte offset of the last record, and the checksum that it continued.
    last_at: u64,
    last_link: u32,
}

impl Mark {
    /// Before the first record of a journal of this kind.
    pub(crate) fn start(kind: &str) -> Self {
        let (end, link) = (FILE_HEADER_BYTES as u64, first_link(kind));
        Self { n_records: 0, end, link, last_at: end, last_link: link }
    }

    /// A mark as a damaged checkpoint may have it.
    #[cfg(test)]
    pub(crate) fn forged(n_records: u64, end: u64, last_at: u64) -> Self {
        Self { n_records, end, link: 1, last_at, last_link: 2 }
    }

    /// Behind a further record.
    pub(crate) fn behind(&self, head: &RecordHead) -> Self {
        Self {
            n_records: self.n_records.saturating_add(1),
            // A mark of a checkpoint is untrusted input: no file reaches the end of the range.
            end: self.end.saturating_add(RECORD_HEADER_BYTES as u64).saturating_add(head.len as u64),
            link: head.crc,
            last_at: self.end,
            last_link: self.link,
        }
    }

    /// Bytes of the journal before it.
    pub fn len_bytes(&self) -> u64 {
        self.end
    }

    /// Whether the journal in this file has a place like it: the record before it is there, with
    /// the checksum that it had, which goes back to the first record.
    ///
    /// # Errors
    /// Where the file cannot be read.
    pub fn fits(&self, path: &Path, kind: &str) -> Result<bool, JournalError> {
        let file = File::open(path).map_err(JournalError::io("open", path))?;
        let mut buffer = Vec::new();
        let header = read_at(&file, path, 0, FILE_HEADER_BYTES, &mut buffer)?;
        if !header || !matches!(check_file_header(&buffer, kind, path), Ok(FileStart::Whole)) {
            return Ok(false);
        }
        if self.n_records == 0 {
            return Ok(*self == Self::start(kind));
        }
        let before = Self {
            end: self.last_at,
            link: self.last_link,
            n_records: self.n_records.saturating_sub(1),
            ..*self
        };
        let found = next_record(&file, path, &before, &mut buffer)?;
        Ok(found.is_ok_and(|head| before.behind(&head) == *self))
    }
}

/// Why there is no record at a place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum NoRecord {
    /// The file ends there.
    End,
    /// What stands there is no whole record.
    Broken(String),
}

/// Reads the record behind `mark` into `payload`; its header, or why there is none.
pub(crate) fn next_record(
    file: &File,
    path: &Path,
    mark: &Mark,
    payload: &mut Vec<u8>,
) -> Result<Result<RecordHead, NoRecord>, JournalError> {
    let broken = |reason: &str| Ok(Err(NoRecord::Broken(reason.into())));
    if !read_at(file, path, mark.end, RECORD_HEADER_BYTES, payload)? {
        let len = file.metadata().map_err(JournalError::io("look at", path))?.len();
        return if len <= mark.end { Ok(Err(NoRecord::End)) } else { broken("no record header") };
    }
    let Some(head) = record_header(payload) else { return broken("no record header") };
    if !read_at(file, path, mark.end.saturating_add(RECORD_HEADER_BYTES as u64), head.len, payload)? {
        return Ok(Err(NoRecord::Broken(format!("a record of {} bytes is cut short", head.len))));
    }
    if head.is_of(mark.link, payload) { Ok(Ok(head)) } else { broken("a checksum does not match") }
}

/// Reads exactly `len` bytes at `offset`; `false` where the file is shorter.
pub(crate) fn read_at(
    file: &File,
    path: &Path,
    offset: u64,
    len: usize,
    buffer: &mut Vec<u8>,
) -> Result<bool, JournalError> {
    // A mark of a checkpoint is untrusted input: no file has such an offset, and the system calls it an error.
    if i64::try_from(offset.saturating_add(len as u64)).is_err() {
        return Ok(false);
    }
    buffer.resize(len, 0);
    match file.read_exact_at(buffer, offset) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(JournalError::io("read", path)(error)),
    }
}
