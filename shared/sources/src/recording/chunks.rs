//! Where the images stand, and reading them again.

use super::error::RecordingError;
use super::file::{Channels, McapFile, Place, message};
use super::heads::heads;
use super::messages::{self, Kind};
use super::topics::Topics;
use mcap::records::{MessageHeader, op};
use rayon::prelude::*;
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};

/// Bytes of read chunks that are kept, beside the newest.
const KEPT_BYTES: usize = 64 << 20;

/// A message that matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Spot {
    pub(super) stamp_nanos: i64,
    pub(super) kind: Kind,
    place: Place,
    /// Among the messages of its place.
    number: u32,
}

/// All messages that matter.
#[derive(Default)]
pub(super) struct Found {
    pub(super) depth: Vec<Spot>,
    pub(super) colour: Vec<Spot>,
    /// The first.
    pub(super) camera: Option<Spot>,
    /// The last record is damaged: what was said of it.
    pub(super) torn: Option<RecordingError>,
}

/// What a channel is to us.
#[derive(Clone, Copy)]
enum Role {
    Depth,
    Colour,
    Camera,
}

/// Looks through the file for the times of its images. A damaged last record of a file that was cut
/// ends it.
pub(super) fn find(file: &McapFile, channels: &Channels, topics: &Topics) -> Result<Found, RecordingError> {
    let mut roles: BTreeMap<u16, (Role, Kind)> = BTreeMap::new();
    for (&id, channel) in &channels.by_id {
        let Some(kind) = Kind::of(channel) else { continue };
        let is = |topic: &Option<String>| topic.as_ref() == Some(&channel.topic);
        let role = match kind.is_image() {
            true if channel.topic == topics.depth => Role::Depth,
            true if is(&topics.colour) => Role::Colour,
            false if is(&topics.camera) => Role::Camera,
            _ => continue,
        };
        roles.insert(id, (role, kind));
    }
    let is_content = |place: &&Place| place.opcode == op::CHUNK || place.opcode == op::MESSAGE;
    let places: Vec<&Place> = file.data.iter().filter(is_content).collect();
    let n = places.len();
    let read: Vec<Result<Found, RecordingError>> = places
        .par_iter()
        .enumerate()
        .map(|(at, place)| {
            let looking =
                Looking { roles: &roles, topics, place: **place, number: 0, found: Found::default() };
            // Where a file was cut, only checksums tell whether all of its end was written.
            looking.through(file, file.cut.is_some() && at + 1 == n)
        })
        .collect();
    let mut all = Found::default();
    for (at, found) in read.into_iter().enumerate() {
        match found {
            Ok(found) => {
                all.depth.extend(found.depth);
                all.colour.extend(found.colour);
                all.camera = all.camera.or(found.camera);
            }
            Err(error @ RecordingError::Damaged { .. }) if at + 1 == n && file.cut.is_some() => {
                all.torn = Some(error);
            }
            Err(error) => return Err(error),
        }
    }
    Ok(all)
}

/// Going through the messages of a place.
struct Looking<'a> {
    roles: &'a BTreeMap<u16, (Role, Kind)>,
    topics: &'a Topics,
    place: Place,
    number: u32,
    found: Found,
}

impl Looking<'_> {
    /// Reads the heads of messages alone where that will do.
    fn through(mut self, file: &McapFile, must_check: bool) -> Result<Found, RecordingError> {
        let place = self.place;
        let stamp_bytes: Option<Vec<u64>> = self.roles.values().map(|(_, kind)| kind.stamp_bytes()).collect();
        if let Some(n_bytes) = stamp_bytes.map(|bytes| bytes.into_iter().max().unwrap_or(0))
            && !must_check
            && heads(file, &place, n_bytes, |header, data| self.take(&header, data))?
        {
            return Ok(self.found);
        }
        let mut wrong = None;
        file.records(&place, |opcode, body| {
            if opcode == op::MESSAGE && wrong.is_none() {
                let (header, data) = message(body)?;
                wrong = self.take(&header, data).err();
            }
            Ok(())
        })?;
        wrong.map_or(Ok(self.found), Err)
    }

    fn take(&mut self, header: &MessageHeader, data: &[u8]) -> Result<(), RecordingError> {
        let number = self.number;
        self.number += 1;
        let Some(&(role, kind)) = self.roles.get(&header.channel_id) else { return Ok(()) };
        let mut spot = Spot { stamp_nanos: 0, kind, place: self.place, number };
        let (topic, to) = match role {
            Role::Camera => {
                self.found.camera.get_or_insert(spot);
                return Ok(());
            }
            Role::Depth => (&self.topics.depth, &mut self.found.depth),
            Role::Colour => {
                (self.topics.colour.as_ref().unwrap_or(&self.topics.depth), &mut self.found.colour)
            }
        };
        let wrong = |problem| {
            let (topic, number) = (topic.clone(), header.sequence as usize);
            RecordingError::Message { topic, number, problem }
        };
        spot.stamp_nanos = messages::stamp_nanos(kind, data).map_err(wrong)?;
        to.push(spot);
        Ok(())
    }
}

/// The messages of a place, one after the other.
type Messages = Arc<Vec<Vec<u8>>>;

/// Reads messages; the last few places are kept, for frames share them.
pub(super) struct Chunks {
    file: McapFile,
    kept: Mutex<VecDeque<(u64, usize, Messages)>>,
}

impl Chunks {
    pub(super) fn new(file: McapFile) -> Self {
        Self { file, kept: Mutex::default() }
    }

    /// The data of a message.
    pub(super) fn read(&self, spot: &Spot) -> Result<Vec<u8>, RecordingError> {
        let messages = self.messages(&spot.place)?;
        // The file has changed since it was opened.
        let gone = || RecordingError::Damaged {
            offset: spot.place.offset,
            reason: format!("message {} is not there any more", spot.number),
        };
        messages.get(spot.number as usize).cloned().ok_or_else(gone)
    }

    fn messages(&self, place: &Place) -> Result<Messages, RecordingError> {
        let lock = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((.., messages)) = lock().iter().find(|(offset, ..)| *offset == place.offset) {
            return Ok(Arc::clone(messages));
        }
        let mut messages = Vec::new();
        self.file.records(place, |opcode, body| {
            if opcode == op::MESSAGE {
                messages.push(message(body)?.1.to_vec());
            }
            Ok(())
        })?;
        let n_bytes = messages.iter().map(Vec::len).sum();
        let messages = Arc::new(messages);
        let mut kept = lock();
        kept.push_back((place.offset, n_bytes, Arc::clone(&messages)));
        while kept.len() > 1 && kept.iter().map(|(_, n, _)| n).sum::<usize>() > KEPT_BYTES {
            kept.pop_front();
        }
        Ok(messages)
    }
}
