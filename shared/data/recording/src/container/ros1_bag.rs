//! Bags of ROS 1, version 2.0: records of a header with named fields and of data.
//!
//! The file is read from its front, record by record, and its index is not used: a bag that was never
//! closed is read as one that was. Source: wiki.ros.org/Bags/Format/2.0.

use super::bytes::{Bytes, Section, fill};
use super::{Channel, Channels, Container, MOST_BYTES, Place, Stored, Take, read_whole};
use crate::compression::decompress;
use crate::error::RecordingError;
use std::fs::File;
use std::io::{self, Read};

/// The first bytes of the file, of any version.
pub(super) const MAGIC: &[u8] = b"#ROSBAG V";
const VERSION: &[u8] = b"#ROSBAG V2.0\n";

const MESSAGE: u8 = 0x02;
const BAG_HEADER: u8 = 0x03;
const CHUNK: u8 = 0x05;
const CONNECTION: u8 = 0x07;

/// Longest header of a record: connections have their definition in the data.
const MOST_HEADER: u32 = 1 << 20;
/// Longest description of a connection.
const MOST_CONNECTION: u64 = 64 << 20;
/// A bag whose records have been found.
pub(super) struct Ros1Bag {
    file: File,
    /// Chunks, and messages outside of them as a recorder leaves them that was killed.
    places: Vec<Place>,
    channels: Channels,
    /// The damage that ended the search for channels.
    damage: Option<RecordingError>,
    cut: Option<String>,
}

/// The fields of a record's header.
struct RecordFields<'a>(&'a [u8]);

impl<'a> RecordFields<'a> {
    /// A field by its name; `None`: it is not there, or the header is torn before it.
    fn get(&self, name: &str) -> Option<&'a [u8]> {
        let mut left = self.0;
        while let Some((length, rest)) = left.split_at_checked(4) {
            let (field, rest) = rest.split_at_checked(u32_of(length)? as usize)?;
            let (found, value) = field.split_at_checked(field.iter().position(|&byte| byte == b'=')?)?;
            if found == name.as_bytes() {
                return value.get(1..);
            }
            left = rest;
        }
        None
    }

    fn op(&self) -> Option<u8> {
        self.get("op")?.first().copied()
    }

    fn text(&self, name: &str) -> Option<String> {
        self.get(name).map(|text| String::from_utf8_lossy(text).into_owned())
    }

    fn word(&self, name: &str) -> Option<u32> {
        u32_of(self.get(name)?)
    }
}

fn u32_of(bytes: &[u8]) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(..4)?.try_into().ok()?))
}

impl Ros1Bag {
    /// Finds the records of a file that begins with [`MAGIC`].
    pub(super) fn open(file: File) -> Result<Self, RecordingError> {
        let mut version = vec![0; VERSION.len()];
        let n = read_whole(&file, 0, &mut version)?;
        version.truncate(n);
        if version != VERSION {
            let found = version.escape_ascii().to_string();
            return Err(RecordingError::BagVersion { found });
        }
        let mut bag = Self { file, places: Vec::new(), channels: Channels::new(), damage: None, cut: None };
        bag.scan()?;
        if bag.channels.is_empty() {
            bag.search_chunks();
        }
        Ok(bag)
    }

    /// Walks the records at the top of the file.
    fn scan(&mut self) -> Result<(), RecordingError> {
        let n_bytes = self.file.metadata()?.len();
        let mut offset = VERSION.len() as u64;
        let mut header = Vec::new();
        while offset < n_bytes {
            let mut whole = Section { file: &self.file, at: offset, end: n_bytes };
            let record = head(&mut whole, &mut header)?.filter(|n_data| *n_data <= whole.n_left());
            let Some(n_data) = record else {
                self.cut =
                    Some(format!("the record at byte {offset} is not whole, the file has {n_bytes} bytes"));
                return Ok(());
            };
            let (data_at, fields) = (whole.at, RecordFields(&header));
            let end = data_at.saturating_add(n_data);
            match fields.op() {
                Some(op @ (CHUNK | MESSAGE)) => {
                    self.places.push(Place { offset, len: end.saturating_sub(offset), opcode: op });
                }
                Some(CONNECTION) => {
                    let mut data = Vec::new();
                    let section = Section { file: &self.file, at: data_at, end };
                    fill(section, n_data.min(MOST_CONNECTION), &mut data)?;
                    let channel = connection(&fields, &data);
                    self.channels.extend(channel);
                }
                Some(BAG_HEADER) => {
                    let place = Place { offset, len: end.saturating_sub(offset), opcode: BAG_HEADER };
                    if let Some(by) = fields.text("encryptor").filter(|by| !by.is_empty()) {
                        return Err(place
                            .damaged(format!("the bag is encrypted by '{by}', expected one that is not")));
                    }
                    // The recorder writes where its index lies when it closes the bag.
                    if fields.get("index_pos").is_some_and(|at| at.iter().all(|byte| *byte == 0)) {
                        self.cut = Some("the bag was never closed".to_owned());
                    }
                }
                _ => {}
            }
            offset = end;
        }
        Ok(())
    }

    /// Finds the channels of a bag without an index.
    fn search_chunks(&mut self) {
        let mut channels = Channels::new();
        for place in &self.places {
            let read = self.records(place, 0, |fields, data| {
                if fields.op() == Some(CONNECTION) {
                    channels.extend(connection(fields, data));
                }
                Ok(())
            });
            if let Err(damage) = read {
                self.damage = Some(damage);
                break;
            }
        }
        self.channels = channels;
    }

    /// Gives fields and data of each record of a place, of messages the first `most` bytes.
    fn records(
        &self,
        place: &Place,
        most: u64,
        mut take: impl FnMut(&RecordFields<'_>, &[u8]) -> Result<(), RecordingError>,
    ) -> Result<(), RecordingError> {
        let broken = |error: io::Error| place.damaged(error.to_string());
        let torn = || place.damaged("a record in it is not whole");
        let (mut bytes, mut n_left) = self.content(place)?;
        let (mut header, mut data) = (Vec::new(), Vec::new());
        while n_left > 0 {
            let n_data = head(&mut bytes, &mut header).map_err(broken)?.ok_or_else(torn)?;
            let fields = RecordFields(&header);
            let n_record = (header.len() as u64).saturating_add(8).saturating_add(n_data);
            n_left = n_left.checked_sub(n_record).ok_or_else(torn)?;
            let n = if fields.op() == Some(MESSAGE) { n_data.min(most) } else { n_data };
            let n_found = fill(&mut bytes, n, &mut data).map_err(broken)?;
            let n_more = n_data.saturating_sub(n);
            if n_found != n || pass(&mut bytes, n_more).map_err(broken)? != n_more {
                return Err(torn());
            }
            take(&fields, &data)?;
        }
        if bytes.read(&mut [0]).map_err(broken)? > 0 {
            return Err(place.damaged("it holds more bytes than it declares"));
        }
        Ok(())
    }

    /// The bytes of a place's records, and how many there are.
    fn content(&self, place: &Place) -> Result<(Bytes<'_>, u64), RecordingError> {
        let mut section = Section { file: &self.file, at: place.offset, end: place.end() };
        if place.opcode == MESSAGE {
            return Ok((Bytes::Plain(section), place.len));
        }
        let mut header = Vec::new();
        let n_stored = head(&mut section, &mut header)?;
        let fields = RecordFields(&header);
        let n_stored = n_stored.filter(|n| *n <= section.n_left());
        let n_stored =
            n_stored.ok_or_else(|| place.damaged("its head has changed since the file was opened"))?;
        let size = fields.word("size").ok_or_else(|| place.damaged("it has no size"))?;
        if u64::from(size) > MOST_BYTES {
            return Err(place.damaged(format!("it has {size} bytes, expected at most {MOST_BYTES}")));
        }
        match fields.text("compression").unwrap_or_default().as_str() {
            "none" if u64::from(size) != n_stored => {
                Err(place.damaged(format!("its records have {n_stored} bytes, and it declares {size}")))
            }
            "none" => Ok((Bytes::Plain(section), u64::from(size))),
            name => {
                let bytes = match name {
                    "bz2" | "lz4" => decompress(name, section.buffered()),
                    _ => None,
                };
                let unknown =
                    || place.damaged(format!("its compression is '{name}', expected none, bz2 or lz4"));
                Ok((Bytes::Compressed(bytes.ok_or_else(unknown)?), u64::from(size)))
            }
        }
    }
}

/// Reads the header of a record; answers the length of its data. `None`: it is not whole.
fn head(from: &mut impl Read, header: &mut Vec<u8>) -> io::Result<Option<u64>> {
    let mut word = Vec::new();
    header.clear();
    if fill(&mut *from, 4, &mut word)? < 4 {
        return Ok(None);
    }
    let n = u32_of(&word).filter(|n| (1..=MOST_HEADER).contains(n));
    let Some(n) = n.map(u64::from) else { return Ok(None) };
    if fill(&mut *from, n, header)? < n || fill(&mut *from, 4, &mut word)? < 4 {
        return Ok(None);
    }
    Ok(u32_of(&word).map(u64::from))
}

/// Passes over bytes; answers how many there were.
fn pass(bytes: &mut Bytes<'_>, n: u64) -> io::Result<u64> {
    match bytes {
        Bytes::Plain(section) => {
            let n = n.min(section.n_left());
            section.at = section.at.saturating_add(n);
            Ok(n)
        }
        Bytes::Compressed(inside) => io::copy(&mut inside.take(n), &mut io::sink()),
    }
}

/// The channel of a connection; the data of its record are fields too.
fn connection(fields: &RecordFields<'_>, data: &[u8]) -> Option<(u32, Channel)> {
    let schema = RecordFields(data).text("type")?;
    let topic = fields.text("topic").or_else(|| RecordFields(data).text("topic"))?;
    Some((fields.word("conn")?, Channel { topic, encoding: "ros1".to_owned(), schema }))
}

impl Container for Ros1Bag {
    fn name(&self) -> &'static str {
        "bag of ROS 1"
    }

    fn channels(&self) -> (Channels, Option<RecordingError>) {
        let damage = self.damage.as_ref().map(|damage| match damage {
            RecordingError::Damaged { offset, reason } => {
                RecordingError::Damaged { offset: *offset, reason: reason.clone() }
            }
            other => RecordingError::Damaged { offset: 0, reason: other.to_string() },
        });
        (self.channels.clone(), damage)
    }

    fn places(&self) -> Vec<Place> {
        self.places.clone()
    }

    fn cut(&self) -> Option<&str> {
        self.cut.as_deref()
    }

    fn messages(&self, place: &Place, most: u64, take: &mut Take<'_>) -> Result<(), RecordingError> {
        let mut number = 0;
        self.records(place, most, |fields, data| {
            if fields.op() != Some(MESSAGE) {
                return Ok(());
            }
            let channel =
                fields.word("conn").ok_or_else(|| place.damaged("a message in it has no connection"))?;
            let (seconds, nanos) =
                (fields.get("time").and_then(u32_of), fields.get("time").and_then(|t| u32_of(t.get(4..)?)));
            let log_nanos = seconds
                .zip(nanos)
                .map_or(0, |(s, n)| i64::from(s).saturating_mul(1_000_000_000).saturating_add(i64::from(n)));
            let sequence = u64::from(number).saturating_add(1);
            let stored = Stored { channel, place: *place, number, sequence, log_nanos, data };
            number = u32::saturating_add(number, 1);
            take(&stored)
        })
    }
}
