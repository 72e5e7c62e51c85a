//! Framing of records in a file: a header that names the file, then records, each with its length,
//! version and a checksum chained with the record before.
//!
//! The chain keeps stale bytes behind a torn tail from coming back to life: they continue
//! another record than the one that now stands before them.

use crate::codec::MAX_RECORD_BYTES;
use crate::error::JournalError;
use std::io;
use std::path::Path;

const MAGIC: &[u8; 8] = b"TESSERAJ";
/// Version of the framing: of a file's first bytes and of each record's header. What records hold has versions of
/// its own ([`RecordKind`](crate::RecordKind)).
const FRAMING: u32 = 16;
/// Versions of records are below this.
const VERSIONS_END: u32 = 1 << 10;
/// Bytes before the first record.
pub(crate) const FILE_HEADER_BYTES: usize = 32;
/// Bytes before each record's payload: length, version, checksum.
pub const RECORD_HEADER_BYTES: usize = 12;

/// The first bytes of a journal of this kind (at most 16 bytes of name).
#[expect(
    clippy::indexing_slicing,
    clippy::arithmetic_side_effects,
    reason = "constant places of an array of ours"
)]
pub(crate) fn file_header(kind: &str) -> [u8; FILE_HEADER_BYTES] {
    let mut header = [0; FILE_HEADER_BYTES];
    header[..8].copy_from_slice(MAGIC);
    header[8..12].copy_from_slice(&FRAMING.to_le_bytes());
    let name = &kind.as_bytes()[..kind.len().min(16)];
    header[12..12 + name.len()].copy_from_slice(name);
    let crc = crc32fast::hash(&header[..28]);
    header[28..].copy_from_slice(&crc.to_le_bytes());
    header
}

/// What the first bytes of a file say.
#[derive(Debug, PartialEq)]
pub(crate) enum FileStart {
    /// A journal of the expected kind; the checksum begins the chain.
    Whole,
    /// Cut short or zeroed: nothing was ever committed.
    Torn,
}

/// Judges the first bytes of a file.
pub(crate) fn check_file_header(bytes: &[u8], kind: &str, path: &Path) -> Result<FileStart, JournalError> {
    let expected = file_header(kind);
    if bytes.starts_with(&expected) {
        return Ok(FileStart::Whole);
    }
    let is_prefix = bytes.len() < FILE_HEADER_BYTES && expected.starts_with(bytes);
    if is_prefix || bytes.iter().take(FILE_HEADER_BYTES).all(|&b| b == 0) {
        return Ok(FileStart::Torn);
    }
    if bytes.starts_with(MAGIC)
        && let Some(found) = u32_at(bytes, MAGIC.len()).filter(|found| *found != FRAMING)
    {
        return Err(JournalError::Version { path: path.into(), found, expected: FRAMING.to_string() });
    }
    Err(JournalError::Foreign {
        path: path.into(),
        expected: format!("{kind} journal"),
        found: format!("{:?}", String::from_utf8_lossy(bytes.get(..28).unwrap_or(bytes))),
    })
}

/// The kind that a header names.
pub(crate) fn kind_in(header: &[u8]) -> String {
    let name = header.get(12..28).unwrap_or_default();
    String::from_utf8_lossy(name).trim_end_matches('\0').to_owned()
}

/// The checksum that the first record continues.
pub(crate) fn first_link(kind: &str) -> u32 {
    crc32fast::hash(&file_header(kind))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().copied().map(u32::from_le_bytes)
}

/// Length and checksum of a payload that goes by.
#[derive(Clone, Debug, Default)]
pub(crate) struct Digest {
    pub(crate) len: u64,
    crc: crc32fast::Hasher,
}

impl io::Write for Digest {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.len = self.len.saturating_add(bytes.len() as u64);
        self.crc.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Digest {
    fn of(payload: &[u8]) -> Self {
        let mut crc = crc32fast::Hasher::new();
        crc.update(payload);
        Self { len: payload.len() as u64, crc }
    }

    /// The checksum of a record with this payload that follows one whose checksum is `link`.
    #[expect(clippy::cast_possible_truncation, reason = "a record has at most MAX_RECORD_BYTES")]
    fn chained_crc(&self, link: u32, version: u32) -> u32 {
        let mut hasher = crc32fast::Hasher::new();
        hasher.update(&link.to_le_bytes());
        hasher.update(&(self.len as u32).to_le_bytes());
        hasher.update(&version.to_le_bytes());
        hasher.combine(&self.crc);
        hasher.finalize()
    }
}

/// The header of a record with this payload that follows one whose checksum is `link`.
#[expect(clippy::cast_possible_truncation, reason = "a record has at most MAX_RECORD_BYTES")]
pub(crate) fn sealed_header(version: u32, link: u32, payload: &Digest) -> [u8; RECORD_HEADER_BYTES] {
    let mut header = [0; RECORD_HEADER_BYTES];
    header[..4].copy_from_slice(&(payload.len as u32).to_le_bytes());
    header[4..8].copy_from_slice(&version.to_le_bytes());
    header[8..].copy_from_slice(&payload.chained_crc(link, version).to_le_bytes());
    header
}

/// Fills in the header at the front of `record`, whose payload stands behind it; answers its checksum.
pub(crate) fn seal(record: &mut [u8], version: u32, link: u32) -> u32 {
    let (header, payload) = record.split_at_mut(RECORD_HEADER_BYTES);
    let payload = Digest::of(payload);
    header.copy_from_slice(&sealed_header(version, link, &payload));
    payload.chained_crc(link, version)
}

/// The header of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RecordHead {
    /// Bytes of the payload.
    pub(crate) len: usize,
    /// Version of what the payload holds.
    pub(crate) version: u32,
    /// Checksum over the payload and all before it.
    pub(crate) crc: u32,
}

impl RecordHead {
    /// Whether a payload belongs to it, behind a record whose checksum is `link`.
    pub(crate) fn is_of(&self, link: u32, payload: &[u8]) -> bool {
        Digest::of(payload).chained_crc(link, self.version) == self.crc
    }
}

/// The header that `bytes` begin with, where they can be one.
pub(crate) fn record_header(bytes: &[u8]) -> Option<RecordHead> {
    let (len, version, crc) = (u32_at(bytes, 0)? as usize, u32_at(bytes, 4)?, u32_at(bytes, 8)?);
    let can_be = (1..VERSIONS_END).contains(&version) && (1..=MAX_RECORD_BYTES).contains(&len);
    can_be.then_some(RecordHead { len, version, crc })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_files_are_named_and_torn_ones_are_not_errors() {
        let path = Path::new("a.journal");
        let check = |bytes: &[u8]| check_file_header(bytes, "align", path);
        assert_eq!(check(&file_header("align")).unwrap(), FileStart::Whole);
        for cut in 0..FILE_HEADER_BYTES {
            assert_eq!(check(&file_header("align")[..cut]).unwrap(), FileStart::Torn);
        }
        assert_eq!(check(&[0; 4096]).unwrap(), FileStart::Torn);
        assert!(check(&file_header("optimise")).unwrap_err().to_string().contains("not a Tessera align"));
        assert!(check(b"ply\nformat ascii 1.0\nelement v").unwrap_err().to_string().contains("ply"));
        let mut newer = file_header("align");
        newer[8] = FRAMING as u8 + 1;
        let words = format!("version {}", FRAMING + 1);
        assert!(check(&newer).unwrap_err().to_string().contains(&words));
    }
}
