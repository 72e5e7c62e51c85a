//! A reader that follows a journal while another process writes it.

use crate::error::JournalError;
use crate::framing::{FILE_HEADER_BYTES, FileStart, check_file_header};
use crate::kind::{RecordKind, UnreadableRecord};
use crate::scan::{Mark, next_record, read_at};
use serde::de::DeserializeOwned;
use std::fs::File;
use std::path::{Path, PathBuf};

/// Reads a growing journal record by record; takes no lock and changes nothing.
#[derive(Debug)]
pub struct Follower<T> {
    file: File,
    path: PathBuf,
    kind: RecordKind<T>,
    mark: Mark,
    /// The file's first bytes have been seen.
    has_header: bool,
    buffer: Vec<u8>,
}

impl<T: DeserializeOwned> Follower<T> {
    /// Opens an existing journal at its first record.
    ///
    /// # Errors
    /// Where the file cannot be opened.
    pub fn open(path: &Path, kind: RecordKind<T>) -> Result<Self, JournalError> {
        Self::open_behind(path, kind, None)
    }

    /// Opens an existing journal behind a mark that fits ([`Mark::fits`]).
    ///
    /// # Errors
    /// Where the file cannot be opened.
    pub fn open_behind(path: &Path, kind: RecordKind<T>, mark: Option<&Mark>) -> Result<Self, JournalError> {
        let file = File::open(path).map_err(JournalError::io("open", path))?;
        let mark = mark.copied().unwrap_or(Mark::start(kind.name));
        Ok(Self { file, path: path.into(), kind, mark, has_header: false, buffer: Vec::new() })
    }

    /// The next whole record, or `None` where it is not there yet.
    ///
    /// # Errors
    /// Where the file is something else, cannot be read, or holds a whole record that this
    /// program cannot read.
    #[expect(clippy::should_implement_trait, reason = "an iterator ends at None, a follower does not")]
    pub fn next(&mut self) -> Result<Option<T>, JournalError> {
        if !self.has_header {
            if !read_at(&self.file, &self.path, 0, FILE_HEADER_BYTES, &mut self.buffer)?
                || check_file_header(&self.buffer, self.kind.name, &self.path)? == FileStart::Torn
            {
                return Ok(None);
            }
            self.has_header = true;
        }
        let Ok(head) = next_record(&self.file, &self.path, &self.mark, &mut self.buffer)? else {
            return Ok(None);
        };
        let record = self.kind.decode(head.version, &self.buffer).map_err(|unreadable| match unreadable {
            UnreadableRecord::Version { found, expected } => {
                JournalError::Version { path: self.path.clone(), found, expected }
            }
            UnreadableRecord::Damage(problem) => JournalError::Slot {
                path: self.path.clone(),
                offset: self.mark.end,
                len: self.buffer.len() as u64,
                problem: format!("are whole but no record: {problem}"),
            },
        })?;
        self.mark = self.mark.behind(&head);
        Ok(Some(record))
    }

    /// Behind the last record read.
    pub fn mark(&self) -> Mark {
        self.mark
    }

    /// Bytes behind the records read so far: of a journal without a writer, a torn tail.
    ///
    /// # Errors
    /// Where the file cannot be looked at.
    pub fn bytes_left(&self) -> Result<u64, JournalError> {
        let len = self.file.metadata().map_err(JournalError::io("look at", &self.path))?.len();
        Ok(if self.has_header { len.saturating_sub(self.mark.end) } else { len })
    }
}
