//! What messages are stored in: MCAP files, bags of ROS 1 and bags of ROS 2 in SQLite, behind one trait.
//!
//! To add another, implement [`Container`] in a file of its own and add a case to [`open`].

mod bytes;
mod mcap;
mod ros1_bag;
mod sqlite;
mod unpacked;

use crate::compression::ZSTD;
use crate::error::RecordingError;
use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::path::Path;

/// Largest content of a place or message: no image is that large.
const MOST_BYTES: u64 = 1 << 30;

/// A part of the file that holds messages: a record, a chunk, a page, or a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// Where it begins.
    pub(super) offset: u64,
    /// Bytes of it; 0 where its container does not say.
    pub(super) len: u64,
    /// What it is, in the codes of its container.
    pub(super) opcode: u8,
}

impl Place {
    /// Where it ends.
    pub(super) fn end(&self) -> u64 {
        self.offset.saturating_add(self.len)
    }

    /// Says what is wrong here.
    pub(super) fn damaged(&self, reason: impl Into<String>) -> RecordingError {
        RecordingError::Damaged { offset: self.offset, reason: reason.into() }
    }
}

/// A kind of message on a topic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Channel {
    pub(super) topic: String,
    /// `cdr`, `ros1`, `protobuf`, `json`.
    pub(super) encoding: String,
    pub(super) schema: String,
}

/// The channels of a file.
pub(super) type Channels = BTreeMap<u32, Channel>;

/// A message as it is stored.
pub(super) struct Stored<'a> {
    pub(super) channel: u32,
    /// Where it is read again.
    pub(super) place: Place,
    /// Among the messages of that place.
    pub(super) number: u32,
    /// What people call it.
    pub(super) sequence: u64,
    /// Time at which it was recorded, nanoseconds; 0: not known.
    pub(super) log_nanos: i64,
    /// Its first bytes, as many as were asked for.
    pub(super) data: &'a [u8],
}

/// Takes messages one by one.
pub(super) type Take<'a> = dyn FnMut(&Stored<'_>) -> Result<(), RecordingError> + 'a;

/// A file that holds messages of several channels.
pub(super) trait Container: Send + Sync {
    /// What it is, for people.
    fn name(&self) -> &'static str;

    /// All channels, and the damage that ended the search for them.
    fn channels(&self) -> (Channels, Option<RecordingError>);

    /// The places of all messages, in the order of the file.
    fn places(&self) -> Vec<Place>;

    /// Where and why the reading ended before the file did.
    fn cut(&self) -> Option<&str>;

    /// Gives each message of a place with its first `most` bytes.
    ///
    /// # Errors
    /// Names the place and what is wrong with it, or what `take` said.
    fn messages(&self, place: &Place, most: u64, take: &mut Take<'_>) -> Result<(), RecordingError>;
}

/// Opens a file for what its first bytes say it is; one that is compressed as a whole is unpacked first.
pub(super) fn open(path: &Path) -> Result<Box<dyn Container>, RecordingError> {
    let file = File::open(path)?;
    let (mut head, mut unpacked_head) = ([0u8; 16], [0u8; 16]);
    let head = head_of(&file, &mut head)?;
    if !head.starts_with(&ZSTD) {
        return of_kind(file, path, head);
    }
    let file = unpacked::unpacked(&file)?;
    let head = head_of(&file, &mut unpacked_head)?;
    of_kind(file, path, head)
}

fn head_of<'a>(file: &File, head: &'a mut [u8]) -> io::Result<&'a [u8]> {
    let n = read_whole(file, 0, head)?;
    Ok(head.get(..n).unwrap_or_default())
}

fn of_kind(file: File, path: &Path, head: &[u8]) -> Result<Box<dyn Container>, RecordingError> {
    if head.starts_with(mcap::MAGIC) {
        return Ok(Box::new(mcap::McapFile::open(file)?));
    }
    if head.starts_with(ros1_bag::MAGIC) {
        return Ok(Box::new(ros1_bag::Ros1Bag::open(file)?));
    }
    if head.starts_with(sqlite::MAGIC) {
        return Ok(Box::new(sqlite::SqliteBag::open(file, path)?));
    }
    Err(RecordingError::Magic { found: head.get(..8).unwrap_or(head).escape_ascii().to_string() })
}

/// Reads as many bytes as there are; answers how many.
fn read_whole(file: &File, offset: u64, bytes: &mut [u8]) -> io::Result<usize> {
    let mut n = 0_usize;
    while let Some(left) = bytes.get_mut(n..).filter(|left| !left.is_empty()) {
        match file.read_at(left, offset.saturating_add(n as u64)) {
            Ok(0) => break,
            Ok(more) => n = n.saturating_add(more),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(n)
}
