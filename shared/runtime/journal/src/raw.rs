//! Records as bytes that are copied from one journal to another, byte for byte.

use crate::codec;
use crate::error::JournalError;
use crate::framing::{FILE_HEADER_BYTES, FileStart, RECORD_HEADER_BYTES, check_file_header, record_header};
use crate::scan::Mark;
use serde::de::DeserializeOwned;
use std::path::Path;

/// Largest record with its header, bytes.
pub const MAX_FRAMED_BYTES: usize = RECORD_HEADER_BYTES + codec::MAX_RECORD_BYTES;

/// A place in the bytes of a journal that goes on by whole parts: the header, then records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chain {
    kind: &'static str,
    mark: Mark,
    has_header: bool,
}

/// A whole part of a journal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FilePart<'b> {
    /// All its bytes.
    pub len: usize,
    /// Version of the record; 0 of the header.
    pub version: u32,
    /// What it holds; nothing of the header.
    pub payload: Option<&'b [u8]>,
}

impl Chain {
    /// Before the first byte of a journal of this kind.
    pub fn new(kind: &'static str) -> Self {
        Self { kind, mark: Mark::start(kind), has_header: false }
    }

    /// Bytes up to which the journal is whole: where the next part begins.
    pub fn len_bytes(&self) -> u64 {
        if self.has_header { self.mark.end } else { 0 }
    }

    /// Records so far.
    pub fn n_records(&self) -> u64 {
        self.mark.n_records
    }

    /// Checksum of the last record, which goes back to the first; that of the header before it.
    pub fn checksum(&self) -> u32 {
        self.mark.link
    }

    /// Goes over the part that `bytes`, which stand at [`Self::len_bytes`], begin with; `None` where
    /// they are too few to tell.
    ///
    /// # Errors
    /// Where they can never become such a part; names the file as `path`.
    pub fn step<'b>(&mut self, bytes: &'b [u8], path: &Path) -> Result<Option<FilePart<'b>>, JournalError> {
        if !self.has_header {
            let is_whole = bytes.len() >= FILE_HEADER_BYTES
                && check_file_header(bytes, self.kind, path)? == FileStart::Whole;
            self.has_header = is_whole;
            return Ok(is_whole.then_some(FilePart { len: FILE_HEADER_BYTES, version: 0, payload: None }));
        }
        let Some(header) = bytes.get(..RECORD_HEADER_BYTES) else { return Ok(None) };
        let head = record_header(header).ok_or_else(|| self.broken(path, "have no record header"))?;
        let behind = bytes.get(RECORD_HEADER_BYTES..).unwrap_or_default();
        let Some(payload) = behind.get(..head.len) else { return Ok(None) };
        if !head.is_of(self.mark.link, payload) {
            return Err(self.broken(path, "have a checksum that does not match"));
        }
        self.mark = self.mark.behind(&head);
        let len = RECORD_HEADER_BYTES.saturating_add(head.len);
        Ok(Some(FilePart { len, version: head.version, payload: Some(payload) }))
    }

    fn broken(&self, path: &Path, problem: &str) -> JournalError {
        JournalError::Slot {
            path: path.into(),
            offset: self.mark.end,
            len: RECORD_HEADER_BYTES as u64,
            problem: problem.into(),
        }
    }
}

/// The checksum that the header of a record holds; `None` of bytes that are no such header.
pub fn checksum_in(header: &[u8]) -> Option<u32> {
    record_header(header).map(|head| head.crc)
}

/// What a payload holds, in the form `T`: for the earlier forms of a [`RecordKind`](crate::RecordKind).
///
/// # Errors
/// Where it holds something else, or more.
pub fn decode<T: DeserializeOwned>(payload: &[u8]) -> Result<T, String> {
    codec::decode(payload)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Journal, RecordKind};
    use std::time::Duration;

    const TEST: RecordKind<u64> = RecordKind::only("test", 7);

    fn bytes_of_a_journal(n: u64) -> Vec<u8> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("j");
        let (mut journal, _) = Journal::open(&path, TEST, Duration::ZERO, |_| Ok(())).unwrap();
        for k in 0..n {
            journal.append(&(k * k * 1000), false).unwrap();
        }
        std::fs::read(&path).unwrap()
    }

    /// Feeds the bytes as a file grows by pieces.
    fn walk(bytes: &[u8], piece: usize) -> Result<(Vec<u64>, Chain), JournalError> {
        let (mut chain, mut found) = (Chain::new("test"), Vec::new());
        for end in (0..=bytes.len()).step_by(piece).chain([bytes.len()]) {
            while let Some(part) =
                chain.step(&bytes[(chain.len_bytes() as usize).min(end)..end], Path::new("j"))?
            {
                found.extend(part.payload.map(|payload| decode::<u64>(payload).unwrap()));
            }
        }
        Ok((found, chain))
    }

    #[test]
    fn records_come_whole_however_the_bytes_come() {
        let bytes = bytes_of_a_journal(20);
        let expected: Vec<u64> = (0..20).map(|k| k * k * 1000).collect();
        let (_, whole) = walk(&bytes, bytes.len()).unwrap();
        for piece in [1, 7, 40, 1000] {
            assert_eq!(walk(&bytes, piece).unwrap(), (expected.clone(), whole), "piece {piece}");
        }
        assert_eq!((whole.n_records(), whole.len_bytes()), (20, bytes.len() as u64));
        let (found, cut) = walk(&bytes[..bytes.len() - 1], 9).unwrap();
        assert_eq!((found.len(), cut.n_records()), (19, 19));
    }

    #[test]
    fn other_bytes_are_refused_where_they_begin() {
        let mut bytes = bytes_of_a_journal(20);
        let at = bytes.len() - 2;
        bytes[at] ^= 1;
        assert!(walk(&bytes, 1000).unwrap_err().to_string().contains("checksum"));
        assert!(walk(b"ply\nformat ascii 1.0\nelement vertex 3", 1000).is_err());
        let mut other = Chain::new("other");
        assert!(other.step(&bytes, Path::new("j")).unwrap_err().to_string().contains("not a Tessera other"));
        assert!(decode::<u64>(&[1, 2]).unwrap_err().contains("takes 1 of 2 bytes"));
    }
}
