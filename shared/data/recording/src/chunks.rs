//! Index of the images in a recording, and reading them again.

use crate::error::RecordingError;
use crate::file::{Channels, McapFile, Place, message};
use crate::messages::{self, Kind};
use crate::topics::Topics;
use mcap::records::{MessageHeader, op};
use rayon::prelude::*;
use std::collections::{BTreeMap, VecDeque};
use std::ops::{Deref, Range};
use std::sync::{Arc, Mutex, PoisonError};

/// Bytes of read chunks that are kept, beside the newest.
const KEPT_BYTES: usize = 64 << 20;

/// Bytes of a message's record before its data: channel, sequence and two times.
const MESSAGE_HEAD: u64 = 22;

/// The topic of transforms that stay.
const STATIC_TRANSFORMS: &str = "/tf_static";

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
    /// The first of the colour camera.
    pub(super) colour_camera: Option<Spot>,
    /// The first of depth to colour.
    pub(super) extrinsics: Option<Spot>,
    /// All transforms that stay.
    pub(super) transforms: Vec<Spot>,
    /// The last record is damaged: what was said of it.
    pub(super) torn: Option<RecordingError>,
}

/// What a channel is to us.
#[derive(Clone, Copy)]
enum Role {
    Depth,
    Colour,
    Camera,
    ColourCamera,
    Extrinsics,
    Transforms,
}

/// Looks through the file for the times of its images. A damaged last record of a file that was cut
/// ends it.
pub(super) fn find(file: &McapFile, channels: &Channels, topics: &Topics) -> Result<Found, RecordingError> {
    let mut roles: BTreeMap<u16, (Role, Kind)> = BTreeMap::new();
    for (&id, channel) in &channels.by_id {
        let Some(kind) = Kind::of(channel) else { continue };
        let is = |topic: &Option<String>| topic.as_ref() == Some(&channel.topic);
        let role = match kind {
            kind if kind.is_image() && channel.topic == topics.depth => Role::Depth,
            kind if kind.is_image() && is(&topics.colour) => Role::Colour,
            kind if kind.is_camera() && is(&topics.camera) => Role::Camera,
            kind if kind.is_camera() && is(&topics.colour_camera) => Role::ColourCamera,
            Kind::RosExtrinsics if is(&topics.extrinsics) => Role::Extrinsics,
            Kind::RosTransforms if channel.topic == STATIC_TRANSFORMS => Role::Transforms,
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
                all.colour_camera = all.colour_camera.or(found.colour_camera);
                all.extrinsics = all.extrinsics.or(found.extrinsics);
                all.transforms.extend(found.transforms);
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
        let most = match stamp_bytes.and_then(|bytes| bytes.into_iter().max()) {
            Some(n) if !must_check => MESSAGE_HEAD + n,
            _ => u64::MAX,
        };
        file.records(
            &place,
            |_| most,
            |opcode, body| {
                if opcode == op::MESSAGE {
                    let (header, data) = message(body).map_err(|reason| place.damaged(reason))?;
                    self.take(&header, data)?;
                }
                Ok(())
            },
        )?;
        Ok(self.found)
    }

    fn take(&mut self, header: &MessageHeader, data: &[u8]) -> Result<(), RecordingError> {
        let number = self.number;
        self.number += 1;
        let Some(&(role, kind)) = self.roles.get(&header.channel_id) else { return Ok(()) };
        let mut spot = Spot { stamp_nanos: 0, kind, place: self.place, number };
        let (topic, to) = match role {
            Role::Camera | Role::ColourCamera | Role::Extrinsics => {
                let first = match role {
                    Role::Camera => &mut self.found.camera,
                    Role::ColourCamera => &mut self.found.colour_camera,
                    _ => &mut self.found.extrinsics,
                };
                first.get_or_insert(spot);
                return Ok(());
            }
            Role::Transforms => {
                self.found.transforms.push(spot);
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

/// The messages of a place, one behind the other.
#[derive(Default)]
struct Messages {
    bytes: Vec<u8>,
    ranges: Vec<Range<usize>>,
}

/// The data of a message, with the place that it stands in kept for as long as it is used.
pub(super) struct Message {
    of: Arc<Messages>,
    range: Range<usize>,
}

impl Deref for Message {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.of.bytes[self.range.clone()]
    }
}

/// Reads messages; the last few places are kept, for frames share them.
pub(super) struct Chunks {
    file: McapFile,
    kept: Mutex<VecDeque<(u64, Arc<Messages>)>>,
}

impl Chunks {
    pub(super) fn new(file: McapFile) -> Self {
        Self { file, kept: Mutex::default() }
    }

    /// The data of a message.
    pub(super) fn read(&self, spot: &Spot) -> Result<Message, RecordingError> {
        let of = self.messages(&spot.place)?;
        // The file has changed since it was opened.
        let gone = || spot.place.damaged(format!("message {} is not there any more", spot.number));
        let range = of.ranges.get(spot.number as usize).cloned().ok_or_else(gone)?;
        Ok(Message { of, range })
    }

    fn messages(&self, place: &Place) -> Result<Arc<Messages>, RecordingError> {
        let lock = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, messages)) = lock().iter().find(|(offset, _)| *offset == place.offset) {
            return Ok(Arc::clone(messages));
        }
        let mut messages = Messages::default();
        self.file.records(
            place,
            |_| u64::MAX,
            |opcode, body| {
                if opcode == op::MESSAGE {
                    let (_, data) = message(body).map_err(|reason| place.damaged(reason))?;
                    let at = messages.bytes.len();
                    messages.bytes.extend_from_slice(data);
                    messages.ranges.push(at..messages.bytes.len());
                }
                Ok(())
            },
        )?;
        messages.bytes.shrink_to_fit();
        let messages = Arc::new(messages);
        let mut kept = lock();
        kept.push_back((place.offset, Arc::clone(&messages)));
        while kept.len() > 1 && kept.iter().map(|(_, of)| of.bytes.len()).sum::<usize>() > KEPT_BYTES {
            kept.pop_front();
        }
        Ok(messages)
    }
}
