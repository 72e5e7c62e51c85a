//! The records of an MCAP file, by where they stand: top-level records and chunks.

mod content;

use super::{Channel, Channels, Container, Place, Stored, Take};
use crate::error::RecordingError;
use content::Content;
use mcap::records::{MessageHeader, Record, op};
use std::collections::BTreeMap;
use std::fs::File;
use std::os::unix::fs::FileExt;

/// The first bytes of the file.
pub(super) const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";
/// Bytes of opcode and length before each record.
const FRAMING: u64 = 9;
/// Bytes of a message's record before its data: channel, sequence and two times.
const MESSAGE_HEAD: u64 = 22;

/// Schemas and channels, as they come.
#[derive(Default)]
struct Described {
    schemas: BTreeMap<u16, String>,
    channels: Channels,
}

impl Described {
    /// Takes in a schema or a channel; other records are left.
    fn take(&mut self, opcode: u8, body: &[u8]) -> Result<(), String> {
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
                self.channels.insert(channel.id.into(), Channel { topic, encoding, schema });
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
    data: Vec<Place>,
    /// Schemas and channels of the summary; empty in a file that was cut.
    summary: Vec<Place>,
    /// Where and why the reading ended before the file did.
    cut: Option<String>,
}

impl McapFile {
    /// Finds the records of a file that begins with [`MAGIC`].
    pub(super) fn open(file: File) -> Result<Self, RecordingError> {
        let n_bytes = file.metadata()?.len();
        let mut found = Self { file, data: Vec::new(), summary: Vec::new(), cut: None };
        let mut offset = 8;
        let mut is_summary = false;
        loop {
            let mut framing = [0u8; 9];
            let Some(n_behind) = n_bytes.checked_sub(offset).and_then(|n| n.checked_sub(FRAMING)) else {
                found.cut = Some(format!("the file ends at byte {n_bytes} without a footer"));
                break;
            };
            found.file.read_exact_at(&mut framing, offset)?;
            let [opcode, length @ ..] = framing;
            let length = u64::from_le_bytes(length);
            if opcode == 0 || length > n_behind {
                found.cut =
                    Some(format!("the record at byte {offset} is not whole, the file has {n_bytes} bytes"));
                break;
            }
            let place = Place { offset, len: FRAMING.saturating_add(length), opcode };
            match opcode {
                op::FOOTER => break,
                op::DATA_END => is_summary = true,
                op::SCHEMA | op::CHANNEL if is_summary => found.summary.push(place),
                op::SCHEMA | op::CHANNEL | op::MESSAGE | op::CHUNK if !is_summary => found.data.push(place),
                _ => {}
            }
            offset = place.end();
        }
        Ok(found)
    }

    /// Gives each record of a place, those of a chunk one by one: opcode and body, of longer bodies
    /// the first `most` bytes for its opcode.
    fn records(
        &self,
        place: &Place,
        most: impl Fn(u8) -> u64,
        take: impl FnMut(u8, &[u8]) -> Result<(), RecordingError>,
    ) -> Result<(), RecordingError> {
        Content::open(&self.file, place)?.records(most, take)
    }
}

impl Container for McapFile {
    fn name(&self) -> &'static str {
        "MCAP recording"
    }

    /// From the summary, or from the whole file where it was cut or has none, then up to what is damaged.
    fn channels(&self) -> (Channels, Option<RecordingError>) {
        let mut described = Described::default();
        let from_summary = self.cut.is_none() && self.summary.iter().any(|place| place.opcode == op::CHANNEL);
        let places = if from_summary { &self.summary } else { &self.data };
        let most = |opcode| if opcode == op::MESSAGE { 0 } else { u64::MAX };
        for place in places {
            let read = self.records(place, most, |opcode, body| {
                described.take(opcode, body).map_err(|reason| place.damaged(reason))
            });
            if read.is_err() {
                return (described.channels, read.err());
            }
        }
        (described.channels, None)
    }

    fn places(&self) -> Vec<Place> {
        let is_content = |place: &&Place| place.opcode == op::CHUNK || place.opcode == op::MESSAGE;
        self.data.iter().filter(is_content).copied().collect()
    }

    fn cut(&self) -> Option<&str> {
        self.cut.as_deref()
    }

    fn messages(&self, place: &Place, most: u64, take: &mut Take<'_>) -> Result<(), RecordingError> {
        let mut number = 0;
        let most = most.saturating_add(MESSAGE_HEAD);
        self.records(
            place,
            |_| most,
            |opcode, body| {
                if opcode != op::MESSAGE {
                    return Ok(());
                }
                let (header, data) = message(body).map_err(|reason| place.damaged(reason))?;
                let (channel, sequence) = (header.channel_id.into(), header.sequence.into());
                let log_nanos = i64::try_from(header.log_time).unwrap_or(0);
                let stored = Stored { channel, place: *place, number, sequence, log_nanos, data };
                number = u32::saturating_add(number, 1);
                take(&stored)
            },
        )
    }
}

/// Header and content of a message record.
fn message(body: &[u8]) -> Result<(MessageHeader, &[u8]), String> {
    match mcap::parse_record(op::MESSAGE, body).map_err(|error| error.to_string())? {
        Record::Message { header, data } => {
            let at = body.len().saturating_sub(data.len());
            Ok((header, body.get(at..).unwrap_or_default()))
        }
        _ => Err("no message".to_owned()),
    }
}
