//! Index of the images in a recording, and reading them again.

use crate::compression::{ZSTD, whole};
use crate::container::{Channels, Container, Place, Stored};
use crate::error::RecordingError;
use crate::imu::ImuMessage;
use crate::librealsense;
use crate::messages::{self, MessageKind};
use crate::topics::Topics;
use rayon::prelude::*;
use std::collections::{BTreeMap, VecDeque};
use std::ops::{Deref, Range};
use std::sync::{Arc, Mutex, PoisonError};

/// Bytes of read chunks that are kept, beside the newest.
const KEPT_BYTES: usize = 64 << 20;

/// The topic of transforms that stay.
const STATIC_TRANSFORMS: &str = "/tf_static";

/// A message that matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Spot {
    pub(super) stamp_nanos: i64,
    pub(super) kind: MessageKind,
    /// Time at which it was recorded, nanoseconds; 0: not known.
    pub(super) log_nanos: i64,
    /// Position among all messages that matter.
    pub(super) ordinal: u64,
    pub(super) place: Place,
    /// Among the messages of its place.
    pub(super) number: u32,
}

/// All messages that matter.
#[derive(Default)]
pub(super) struct FoundMessage {
    pub(super) depth: Vec<Spot>,
    pub(super) colour: Vec<Spot>,
    /// The first.
    pub(super) camera: Option<Spot>,
    /// The first of the colour camera.
    pub(super) colour_camera: Option<Spot>,
    /// The first of depth to colour.
    pub(super) extrinsics: Option<Spot>,
    /// Units of depth: the first.
    pub(super) units: Option<Spot>,
    /// Frame of a stream, that of its reference, and where the stream stands.
    pub(super) streams: Vec<(String, String, Spot)>,
    /// All transforms that stay.
    pub(super) transforms: Vec<Spot>,
    /// All messages of the IMU, each with the number of its topic.
    pub(super) imu: Vec<(usize, ImuMessage)>,
    /// What is wrong with those that cannot be used.
    pub(super) malformed_imu: Vec<String>,
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
    Units,
    StreamPlace,
    Transforms,
    /// With the number of its topic.
    Imu(usize),
}

/// Looks through the file for the times of its images. A damaged last record of a file that was cut
/// ends it.
pub(super) fn find(
    file: &dyn Container,
    channels: &Channels,
    topics: &Topics,
) -> Result<FoundMessage, RecordingError> {
    let mut roles: BTreeMap<u32, (Role, MessageKind)> = BTreeMap::new();
    for (&id, channel) in channels {
        let Some(kind) = MessageKind::of(channel) else { continue };
        let is = |topic: &Option<String>| topic.as_ref() == Some(&channel.topic);
        let role = match kind {
            kind if kind.is_image() && channel.topic == topics.depth => Role::Depth,
            kind if kind.is_image() && is(&topics.colour) => Role::Colour,
            kind if kind.is_camera() && is(&topics.camera) => Role::Camera,
            kind if kind.is_camera() && is(&topics.colour_camera) => Role::ColourCamera,
            MessageKind::RosExtrinsics(_) if is(&topics.extrinsics) => Role::Extrinsics,
            MessageKind::DepthUnits if is(&topics.units) => Role::Units,
            MessageKind::StreamPlace => Role::StreamPlace,
            MessageKind::RosImu(_) => match topics.imu.iter().position(|topic| *topic == channel.topic) {
                Some(topic) => Role::Imu(topic),
                None => continue,
            },
            MessageKind::RosTransforms(_) if channel.topic == STATIC_TRANSFORMS => Role::Transforms,
            _ => continue,
        };
        roles.insert(id, (role, kind));
    }
    let (places, is_cut) = (file.places(), file.cut().is_some());
    let is_compressed = places.first().is_some_and(|place| begins_compressed(file, place));
    let n = places.len();
    let read: Vec<Result<FoundMessage, RecordingError>> = places
        .par_iter()
        .enumerate()
        .map(|(at, place)| {
            let first_ordinal = (at as u64) << 32;
            let looking = Looking {
                channels,
                roles: &roles,
                topics,
                next_ordinal: first_ordinal,
                found: FoundMessage::default(),
            };
            // Where a file was cut, only checksums tell whether all of its end was written.
            looking.through(file, place, is_compressed || (is_cut && at.saturating_add(1) == n))
        })
        .collect();
    let mut all = FoundMessage::default();
    for (at, found) in read.into_iter().enumerate() {
        match found {
            Ok(found) => {
                all.depth.extend(found.depth);
                all.colour.extend(found.colour);
                all.camera = all.camera.or(found.camera);
                all.colour_camera = all.colour_camera.or(found.colour_camera);
                all.extrinsics = all.extrinsics.or(found.extrinsics);
                all.units = all.units.or(found.units);
                all.streams.extend(found.streams);
                all.transforms.extend(found.transforms);
                all.imu.extend(found.imu);
                all.malformed_imu.extend(found.malformed_imu);
            }
            Err(error @ RecordingError::Damaged { .. }) if at.saturating_add(1) == n && is_cut => {
                all.torn = Some(error);
            }
            Err(error) => return Err(error),
        }
    }
    Ok(all)
}

/// Whether the messages of a place are compressed one by one: of their fronts nothing can be read.
fn begins_compressed(file: &dyn Container, place: &Place) -> bool {
    let mut is_compressed = false;
    // What is wrong with the place is told when all of it is read.
    let _ = file.messages(place, ZSTD.len() as u64, &mut |message| {
        is_compressed |= message.data.starts_with(&ZSTD);
        Ok(())
    });
    is_compressed
}

/// The first message of each image topic, by topic; damage ends the search.
pub(super) fn first_images(file: &dyn Container, channels: &Channels) -> BTreeMap<String, Spot> {
    let mut first: BTreeMap<String, Spot> = BTreeMap::new();
    let kinds: BTreeMap<u32, MessageKind> = channels
        .iter()
        .filter_map(|(id, channel)| Some((*id, MessageKind::of(channel).filter(|kind| kind.is_image())?)))
        .collect();
    for place in file.places() {
        let read = file.messages(&place, 0, &mut |message| {
            if let (Some(kind), Some(channel)) = (kinds.get(&message.channel), channels.get(&message.channel))
            {
                let spot = Spot {
                    stamp_nanos: 0,
                    kind: *kind,
                    log_nanos: message.log_nanos,
                    ordinal: 0,
                    place: message.place,
                    number: message.number,
                };
                first.entry(channel.topic.clone()).or_insert(spot);
            }
            Ok(())
        });
        if read.is_err() {
            break;
        }
    }
    first
}

/// Going through the messages of a place.
struct Looking<'a> {
    channels: &'a Channels,
    roles: &'a BTreeMap<u32, (Role, MessageKind)>,
    topics: &'a Topics,
    next_ordinal: u64,
    found: FoundMessage,
}

impl Looking<'_> {
    /// Reads the heads of messages alone where that will do.
    fn through(
        mut self,
        file: &dyn Container,
        place: &Place,
        needs_all: bool,
    ) -> Result<FoundMessage, RecordingError> {
        let stamp_bytes: Option<Vec<u64>> = self.roles.values().map(|(_, kind)| kind.stamp_bytes()).collect();
        let most = match stamp_bytes.and_then(|bytes| bytes.into_iter().max()) {
            Some(n) if !needs_all => n,
            _ => u64::MAX,
        };
        file.messages(place, most, &mut |message| self.take(message))?;
        Ok(self.found)
    }

    /// A message of librealsense names no frame: it is that of its stream.
    fn in_frame(&self, topic: usize, mut imu: ImuMessage) -> ImuMessage {
        if imu.frame.is_empty() {
            let stream = self.topics.imu.get(topic).and_then(|topic| librealsense::stream_of(topic));
            imu.frame = stream.unwrap_or_default();
        }
        imu
    }

    fn take(&mut self, message: &Stored<'_>) -> Result<(), RecordingError> {
        let Some(&(role, kind)) = self.roles.get(&message.channel) else { return Ok(()) };
        let data = whole(message.data)?;
        let mut spot = Spot {
            stamp_nanos: 0,
            kind,
            log_nanos: message.log_nanos,
            ordinal: self.next_ordinal,
            place: message.place,
            number: message.number,
        };
        self.next_ordinal = self.next_ordinal.saturating_add(1);
        let (topic, to) = match role {
            Role::StreamPlace => {
                let topic = self.channels.get(&message.channel).map_or("", |channel| channel.topic.as_str());
                let placed = librealsense::placed_by(topic);
                self.found.streams.extend(placed.map(|(stream, reference)| (stream, reference, spot)));
                return Ok(());
            }
            Role::Camera | Role::ColourCamera | Role::Extrinsics | Role::Units => {
                let first = match role {
                    Role::Camera => &mut self.found.camera,
                    Role::ColourCamera => &mut self.found.colour_camera,
                    Role::Units => &mut self.found.units,
                    _ => &mut self.found.extrinsics,
                };
                first.get_or_insert(spot);
                return Ok(());
            }
            Role::Transforms => {
                self.found.transforms.push(spot);
                return Ok(());
            }
            Role::Imu(topic) => {
                let MessageKind::RosImu(wire) = kind else { return Ok(()) };
                match ImuMessage::of(wire, &data) {
                    Ok(imu) => self.found.imu.push((topic, self.in_frame(topic, imu))),
                    Err(problem) => self.found.malformed_imu.push(problem.to_string()),
                }
                return Ok(());
            }
            Role::Depth => (&self.topics.depth, &mut self.found.depth),
            Role::Colour => {
                (self.topics.colour.as_ref().unwrap_or(&self.topics.depth), &mut self.found.colour)
            }
        };
        let wrong = |problem| {
            let (topic, number) = (topic.clone(), usize::try_from(message.sequence).unwrap_or(usize::MAX));
            RecordingError::Message { topic, number, problem }
        };
        spot.stamp_nanos = messages::stamp_nanos(kind, &data).map_err(wrong)?;
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
pub(super) struct RecordedMessage {
    of: Arc<Messages>,
    range: Range<usize>,
}

impl Deref for RecordedMessage {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        self.of.bytes.get(self.range.clone()).unwrap_or_default()
    }
}

/// Reads messages; the last few places are kept, for frames share them.
pub(super) struct Chunks {
    file: Box<dyn Container>,
    kept: Mutex<VecDeque<(u64, Arc<Messages>)>>,
}

impl Chunks {
    pub(super) fn new(file: Box<dyn Container>) -> Self {
        Self { file, kept: Mutex::default() }
    }

    pub(super) fn file(&self) -> &dyn Container {
        &*self.file
    }

    /// What the file is, for people.
    pub(super) fn name(&self) -> &'static str {
        self.file.name()
    }

    /// The data of a message.
    pub(super) fn read(&self, spot: &Spot) -> Result<RecordedMessage, RecordingError> {
        let of = self.messages(&spot.place)?;
        // The file has changed since it was opened.
        let gone = || spot.place.damaged(format!("message {} is not there any more", spot.number));
        let range = of.ranges.get(spot.number as usize).cloned().ok_or_else(gone)?;
        Ok(RecordedMessage { of, range })
    }

    fn messages(&self, place: &Place) -> Result<Arc<Messages>, RecordingError> {
        let lock = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, messages)) = lock().iter().find(|(offset, _)| *offset == place.offset) {
            return Ok(Arc::clone(messages));
        }
        let mut messages = Messages::default();
        self.file.messages(place, u64::MAX, &mut |message| {
            let at = messages.bytes.len();
            messages.bytes.extend_from_slice(&whole(message.data)?);
            messages.ranges.push(at..messages.bytes.len());
            Ok(())
        })?;
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
