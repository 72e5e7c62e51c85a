//! The records of an MCAP file, by where they stand: top-level records and chunks.

use crate::content::Content;
use crate::error::RecordingError;
use mcap::records::{MessageHeader, Record, op};
use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;

const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";
/// Bytes of opcode and length before each record.
pub(super) const FRAMING: u64 = 9;

/// A record of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// Where its framing begins.
    pub(super) offset: u64,
    /// With its framing.
    pub(super) len: u64,
    pub(super) opcode: u8,
}

impl Place {
    /// Says what is wrong here.
    pub(super) fn damaged(&self, reason: impl Into<String>) -> RecordingError {
        RecordingError::Damaged { offset: self.offset, reason: reason.into() }
    }
}

/// A kind of message on a topic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Channel {
    pub(super) topic: String,
    /// `cdr`, `protobuf`, `json`.
    pub(super) encoding: String,
    pub(super) schema: String,
}

/// Schemas and channels, as they come.
#[derive(Default)]
pub(super) struct Channels {
    schemas: BTreeMap<u16, String>,
    pub(super) by_id: BTreeMap<u16, Channel>,
}

impl Channels {
    /// Takes in a schema or a channel; other records are left.
    pub(super) fn take(&mut self, opcode: u8, body: &[u8]) -> Result<(), String> {
        if opcode != op::SCHEMA && opcode != op::CHANNEL {
            return Ok(());
        }
        match mcap::parse_record(opcode, body).map_err(|error| error.to_string())? {
            Record::Schema { header, .. } => {
                self.schemas.insert(header.id, header.name);
            }
            Record::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                let (topic, encoding) = (channel.topic, channel.message_encoding);
                self.by_id.insert(channel.id, Channel { topic, encoding, schema });
            }
            _ => {}
        }
        Ok(())
    }
}

/// An MCAP file whose records have been found.
pub(super) struct McapFile {
    file: File,
    /// Schemas, channels, messages and chunks of the data section.
    pub(super) data: Vec<Place>,
    /// Schemas and channels of the summary; empty in a file that was cut.
    pub(super) summary: Vec<Place>,
    /// Where and why the reading ended before the file did.
    pub(super) cut: Option<String>,
}

impl McapFile {
    pub(super) fn open(path: &std::path::Path) -> Result<Self, RecordingError> {
        let file = File::open(path)?;
        let n_bytes = file.metadata()?.len();
        let mut magic = [0u8; 8];
        let n = n_bytes.min(8) as usize;
        file.read_exact_at(&mut magic[..n], 0)?;
        if magic != *MAGIC {
            return Err(RecordingError::Magic { found: magic[..n].escape_ascii().to_string() });
        }
        let mut found = Self { file, data: Vec::new(), summary: Vec::new(), cut: None };
        let mut offset = 8;
        let mut is_summary = false;
        loop {
            let mut framing = [0u8; FRAMING as usize];
            if n_bytes - offset < FRAMING {
                found.cut = Some(format!("the file ends at byte {n_bytes} without a footer"));
                break;
            }
            found.file.read_exact_at(&mut framing, offset)?;
            let [opcode, length @ ..] = framing;
            let length = u64::from_le_bytes(length);
            if opcode == 0 || length > n_bytes - offset - FRAMING {
                found.cut =
                    Some(format!("the record at byte {offset} is not whole, the file has {n_bytes} bytes"));
                break;
            }
            let place = Place { offset, len: FRAMING + length, opcode };
            match opcode {
                op::FOOTER => break,
                op::DATA_END => is_summary = true,
                op::SCHEMA | op::CHANNEL if is_summary => found.summary.push(place),
                op::SCHEMA | op::CHANNEL | op::MESSAGE | op::CHUNK if !is_summary => found.data.push(place),
                _ => {}
            }
            offset += place.len;
        }
        Ok(found)
    }

    /// Reads bytes of the file, all of them.
    pub(super) fn read(&self, offset: u64, bytes: &mut [u8]) -> Result<(), RecordingError> {
        Ok(self.file.read_exact_at(bytes, offset)?)
    }

    /// Reads bytes of the file, as many as come at once; 0 at its end.
    pub(super) fn read_some(&self, offset: u64, bytes: &mut [u8]) -> io::Result<usize> {
        self.file.read_at(bytes, offset)
    }

    /// Gives each record of a place, those of a chunk one by one: opcode and body, of longer bodies
    /// the first `most` bytes for its opcode.
    pub(super) fn records(
        &self,
        place: &Place,
        most: impl Fn(u8) -> u64,
        take: impl FnMut(u8, &[u8]) -> Result<(), RecordingError>,
    ) -> Result<(), RecordingError> {
        Content::open(self, place)?.records(most, take)
    }
}

/// Header and content of a message record.
pub(super) fn message(body: &[u8]) -> Result<(MessageHeader, &[u8]), String> {
    match mcap::parse_record(op::MESSAGE, body).map_err(|error| error.to_string())? {
        Record::Message { header, data } => {
            let at = body.len() - data.len();
            Ok((header, &body[at..]))
        }
        _ => Err("no message".to_owned()),
    }
}
