//! A reader that follows a journal while another process writes it.

use crate::codec;
use crate::error::JournalError;
use crate::framing::{
    FILE_HEADER_BYTES, FileStart, RECORD_HEADER_BYTES, chained_crc, check_file_header, first_link,
    record_header,
};
use serde::de::DeserializeOwned;
use std::fs::File;
use std::marker::PhantomData;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// Reads a growing journal record by record; takes no lock and changes nothing.
#[derive(Debug)]
pub struct Follower<T> {
    file: File,
    path: PathBuf,
    kind: String,
    end: u64,
    link: u32,
    buffer: Vec<u8>,
    of: PhantomData<fn() -> T>,
}

impl<T: DeserializeOwned> Follower<T> {
    /// Opens an existing journal at its first record.
    ///
    /// # Errors
    /// Where the file cannot be opened.
    pub fn open(path: &Path, kind: &str) -> Result<Self, JournalError> {
        let file = File::open(path).map_err(JournalError::io("open", path))?;
        let (path, kind) = (path.to_path_buf(), kind.to_string());
        Ok(Self { file, path, link: first_link(&kind), kind, end: 0, buffer: Vec::new(), of: PhantomData })
    }

    /// The next whole record, or `None` where it is not there yet.
    ///
    /// # Errors
    /// Where the file is something else, cannot be read, or holds a whole record that this
    /// program cannot decode.
    #[expect(clippy::should_implement_trait, reason = "an iterator ends at None, a follower does not")]
    pub fn next(&mut self) -> Result<Option<T>, JournalError> {
        if self.end == 0 {
            if !self.fill(0, FILE_HEADER_BYTES)? {
                return Ok(None);
            }
            if check_file_header(&self.buffer, &self.kind, &self.path)? == FileStart::Torn {
                return Ok(None);
            }
            self.end = FILE_HEADER_BYTES as u64;
        }
        if !self.fill(self.end, RECORD_HEADER_BYTES)? {
            return Ok(None);
        }
        let Some((len, crc)) = record_header(&self.buffer) else { return Ok(None) };
        if !self.fill(self.end + RECORD_HEADER_BYTES as u64, len)?
            || chained_crc(self.link, &self.buffer) != crc
        {
            return Ok(None);
        }
        let record = codec::decode(&self.buffer).map_err(|problem| JournalError::Slot {
            path: self.path.clone(),
            offset: self.end,
            len: len as u64,
            problem: format!("are whole but no record: {problem}"),
        })?;
        self.end += (RECORD_HEADER_BYTES + len) as u64;
        self.link = crc;
        Ok(Some(record))
    }

    /// Bytes behind the records read so far: of a journal that nobody writes, a torn tail.
    ///
    /// # Errors
    /// Where the file cannot be looked at.
    pub fn bytes_left(&self) -> Result<u64, JournalError> {
        let len = self.file.metadata().map_err(JournalError::io("look at", &self.path))?.len();
        Ok(len.saturating_sub(self.end))
    }

    /// Reads exactly `len` bytes at `offset` into the buffer; `false` where the file is shorter.
    fn fill(&mut self, offset: u64, len: usize) -> Result<bool, JournalError> {
        self.buffer.resize(len, 0);
        match self.file.read_exact_at(&mut self.buffer, offset) {
            Ok(()) => Ok(true),
            Err(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => Ok(false),
            Err(error) => Err(JournalError::io("read", &self.path)(error)),
        }
    }
}
