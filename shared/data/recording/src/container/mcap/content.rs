//! The records at one place of an MCAP file as a stream: a record by itself, or those of a chunk.

use super::FRAMING;
use crate::compression::decompress;
use crate::container::bytes::{Bytes, Section, fill};
use crate::container::{MOST_BYTES, Place};
use crate::error::RecordingError;
use mcap::records::op;
use std::fs::File;
use std::io::{self, Read};
use std::os::unix::fs::FileExt;

/// Bytes of a chunk's record before the name of its compression: two times, size and checksum.
const CHUNK_HEAD: u64 = 28;
/// Bytes of the lengths before the name and before the records.
const NAME_LENGTH: u64 = 4;
const RECORDS_LENGTH: u64 = 8;
/// Longest name of a compression.
const MOST_NAME: u32 = 32;

/// The content of a place. Its bytes come as they are read; no more than a record is in memory.
pub(super) struct Content<'a> {
    bytes: Bytes<'a>,
    place: Place,
    /// Bytes still to come, as the place declares them.
    n_left: u64,
    /// Of all bytes so far; `None`: some were passed over.
    crc: Option<crc32fast::Hasher>,
    /// 0: not known.
    expected_crc: u32,
    /// No more bytes can be had.
    is_broken: bool,
}

impl<'a> Content<'a> {
    pub(super) fn open(file: &'a File, place: &Place) -> Result<Self, RecordingError> {
        let (at, end) = (place.offset, place.end());
        let mut content = Self {
            bytes: Bytes::Plain(Section { file, at, end }),
            place: *place,
            n_left: place.len,
            crc: Some(crc32fast::Hasher::new()),
            expected_crc: 0,
            is_broken: false,
        };
        if place.opcode == op::CHUNK {
            content.enter(file, at.saturating_add(FRAMING), end)?;
        }
        if content.n_left > MOST_BYTES {
            let reason = format!("it has {} bytes, expected at most {MOST_BYTES}", content.n_left);
            return Err(place.damaged(reason));
        }
        Ok(content)
    }

    /// Reads the head of a chunk, whose body lies from `at` to `end`.
    fn enter(&mut self, file: &'a File, mut at: u64, end: u64) -> Result<(), RecordingError> {
        let place = self.place;
        let mut next = |n: u64| {
            let behind = at.checked_add(n).filter(|behind| *behind <= end);
            let behind = behind.ok_or_else(|| place.damaged("it is shorter than a chunk's head"))?;
            let mut bytes = vec![0; usize::try_from(n).unwrap_or(usize::MAX)];
            file.read_exact_at(&mut bytes, at)?;
            at = behind;
            Ok::<_, RecordingError>(bytes)
        };
        let head = next(CHUNK_HEAD)?;
        let n_name = u32_at(&next(NAME_LENGTH)?, 0);
        if n_name > MOST_NAME {
            return Err(place.damaged(format!(
                "the name of its compression has {n_name} bytes, expected at most {MOST_NAME}"
            )));
        }
        let name = next(u64::from(n_name))?;
        let n_stored = u64_at(&next(RECORDS_LENGTH)?, 0);
        let end = at.checked_add(n_stored).filter(|behind| *behind <= end);
        let end = end.ok_or_else(|| place.damaged("its records are longer than itself"))?;
        self.n_left = u64_at(&head, 16);
        self.expected_crc = u32_at(&head, 24);
        let stored = Section { file, at, end };
        self.bytes = match name.as_slice() {
            b"" if self.n_left != n_stored => {
                return Err(place
                    .damaged(format!("its records have {n_stored} bytes, and it declares {}", self.n_left)));
            }
            b"" => Bytes::Plain(stored),
            name => {
                let name = name.escape_ascii().to_string();
                let unknown = || format!("its compression is '{name}', expected zstd, lz4 or none");
                let known = ["zstd", "lz4"].contains(&name.as_str());
                let bytes = if known { decompress(&name, stored.buffered()) } else { None };
                Bytes::Compressed(bytes.ok_or_else(|| place.damaged(unknown()))?)
            }
        };
        Ok(())
    }

    /// Gives opcode and body of each record, of longer bodies the first `most` bytes for its opcode,
    /// and compares the checksum if it has read all bytes: it passes over those of a chunk that is
    /// not compressed.
    pub(super) fn records(
        mut self,
        most: impl Fn(u8) -> u64,
        mut take: impl FnMut(u8, &[u8]) -> Result<(), RecordingError>,
    ) -> Result<(), RecordingError> {
        let walked = self.walk(most, &mut take);
        if walked.is_err() && (self.is_broken || matches!(self.bytes, Bytes::Plain(_))) {
            return walked;
        }
        // Wrong bytes out of a decompression read as wrong records: where the checksum knows, it says so.
        self.pass(self.n_left)?;
        self.end()?;
        walked
    }

    fn walk(
        &mut self,
        most: impl Fn(u8) -> u64,
        take: &mut impl FnMut(u8, &[u8]) -> Result<(), RecordingError>,
    ) -> Result<(), RecordingError> {
        let mut body = Vec::new();
        while self.n_left > 0 {
            self.fill(FRAMING.min(self.n_left), &mut body)?;
            let torn = || self.place.damaged("a record in it is not whole");
            let (&opcode, length) = body.split_first().ok_or_else(torn)?;
            let length = length.try_into().map(u64::from_le_bytes).map_err(|_| torn())?;
            if opcode == 0 || length > self.n_left {
                return Err(torn());
            }
            let n = length.min(most(opcode));
            self.fill(n, &mut body)?;
            self.pass(length.saturating_sub(n))?;
            take(opcode, &body)?;
        }
        Ok(())
    }

    fn fill(&mut self, n: u64, to: &mut Vec<u8>) -> Result<(), RecordingError> {
        let found = fill(&mut *self, n, to);
        self.expect(n, found)
    }

    fn pass(&mut self, n: u64) -> Result<(), RecordingError> {
        if n == 0 {
            return Ok(());
        }
        if let Bytes::Plain(section) = &mut self.bytes {
            section.at = section.at.saturating_add(n);
            self.n_left = self.n_left.saturating_sub(n);
            self.crc = None;
            return Ok(());
        }
        let passed = io::copy(&mut self.take(n), &mut io::sink());
        self.expect(n, passed)
    }

    fn expect(&mut self, n: u64, found: io::Result<u64>) -> Result<(), RecordingError> {
        self.is_broken = !matches!(found, Ok(found) if found == n);
        match found {
            Err(error) => Err(self.place.damaged(error.to_string())),
            Ok(_) if self.is_broken => Err(self
                .place
                .damaged(format!("it ends {} bytes before the size that it declares", self.n_left))),
            Ok(_) => Ok(()),
        }
    }

    fn end(&mut self) -> Result<(), RecordingError> {
        let n_beyond = match &mut self.bytes {
            Bytes::Plain(_) => 0,
            Bytes::Compressed(bytes) => {
                bytes.read(&mut [0]).map_err(|error| self.place.damaged(error.to_string()))?
            }
        };
        if n_beyond > 0 {
            return Err(self.place.damaged("it holds more bytes than it declares"));
        }
        let Some(found) = self.crc.take().map(crc32fast::Hasher::finalize) else { return Ok(()) };
        if self.expected_crc != 0 && found != self.expected_crc {
            let expected = self.expected_crc;
            let reason = format!("its checksum is {found:08x}, expected {expected:08x}");
            return Err(self.place.damaged(reason));
        }
        Ok(())
    }
}

impl Read for Content<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let n = self.bytes.read(bytes)?;
        self.n_left = self.n_left.saturating_sub(n as u64);
        if let Some(crc) = &mut self.crc {
            crc.update(bytes.get(..n).unwrap_or_default());
        }
        Ok(n)
    }
}

/// A number in bytes that were read for it; 0 behind their end.
fn u32_at(bytes: &[u8], at: usize) -> u32 {
    bytes.get(at..).and_then(<[u8]>::first_chunk).map_or(0, |word| u32::from_le_bytes(*word))
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    bytes.get(at..).and_then(<[u8]>::first_chunk).map_or(0, |word| u64::from_le_bytes(*word))
}
