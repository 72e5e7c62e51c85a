//! The writing end of the keyframe store: a file of aligned byte blocks, appended one by one.
//!
//! What is in use is what a journal names; bytes behind the last named block are overwritten. A block
//! that is given up keeps its place, with a tombstone at its beginning, and its space goes back to the
//! file system.

use crate::error::{JournalError, sync_file};
use crate::lock::lock_file;
use rustix::fs::{FallocateFlags, fallocate};
use std::fs::{File, OpenOptions};
use std::os::unix::fs::{FileExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

const MAGIC: &[u8; 8] = b"TESSERAK";
const VERSION: u32 = 2;
/// Offset of the first block: a page, so that losing it loses no block.
const FIRST_BLOCK: u64 = 4096;
/// Bytes of its head: a magic word and the version.
pub(crate) const HEAD_BYTES: u64 = 12;
/// Blocks begin on cache lines.
const ALIGNMENT: u64 = 64;

/// Where a block lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Slot {
    /// Byte offset, a multiple of 64.
    pub offset: u64,
    /// Length in bytes.
    pub len: u64,
    /// CRC-32 of the bytes.
    pub crc: u32,
}

/// What stands at the beginning of a block that was given up: these words and its checksum.
pub(crate) struct Tombstone([u8; Tombstone::LEN]);

impl Tombstone {
    const WORDS: &[u8; 12] = b"TESSERA gone";
    const LEN: usize = Self::WORDS.len() + size_of::<u32>();

    #[expect(clippy::indexing_slicing, reason = "constant places of an array of ours")]
    pub(crate) fn of(slot: &Slot) -> Self {
        let mut bytes = [0; Self::LEN];
        bytes[..Self::WORDS.len()].copy_from_slice(Self::WORDS);
        bytes[Self::WORDS.len()..].copy_from_slice(&slot.crc.to_le_bytes());
        Self(bytes)
    }

    pub(crate) fn begins(&self, block: &[u8]) -> bool {
        block.starts_with(&self.0)
    }
}

/// First bytes of a store.
pub(crate) enum StoreHead {
    Whole,
    /// Absent or zeroed.
    Missing,
}

/// Checks the first bytes of a store.
pub(crate) fn check_head(file: &File, path: &Path) -> Result<StoreHead, JournalError> {
    let mut found = [0u8; MAGIC.len() + size_of::<u32>()];
    let n = file.read_at(&mut found, 0).map_err(JournalError::io("read", path))?;
    let (magic, version) = found.split_at(MAGIC.len());
    if n < found.len() || found.iter().all(|&byte| byte == 0) {
        return Ok(StoreHead::Missing);
    }
    if magic != MAGIC {
        return Err(JournalError::Foreign {
            path: path.into(),
            expected: "keyframe store".into(),
            found: format!("{:?}", String::from_utf8_lossy(&found)),
        });
    }
    if version != VERSION.to_le_bytes() {
        let found = version.iter().rev().fold(0, |number, &byte| number << 8 | u32::from(byte));
        return Err(JournalError::Version { path: path.into(), found, expected: VERSION.to_string() });
    }
    Ok(StoreHead::Whole)
}

/// The store, open for writing by this process alone.
#[derive(Debug)]
pub struct Store {
    file: File,
    path: PathBuf,
    end: u64,
}

impl Store {
    /// Opens or creates the store and locks it, waiting up to `wait` for another writer to end.
    ///
    /// # Errors
    /// Where it is locked, is something else, is of another version, or cannot be opened.
    pub fn open(path: &Path, wait: Duration) -> Result<Self, JournalError> {
        Self::open_file(path, wait, true)
    }

    /// As [`Self::open`], of a store that was begun before.
    ///
    /// # Errors
    /// As [`Self::open`], and where it is not there or has lost its first bytes.
    pub fn open_begun(path: &Path, wait: Duration) -> Result<Self, JournalError> {
        Self::open_file(path, wait, false)
    }

    fn open_file(path: &Path, wait: Duration, may_be_new: bool) -> Result<Self, JournalError> {
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(may_be_new)
            .truncate(false)
            .mode(0o600)
            .open(path)
            .map_err(|error| match error.kind() {
                std::io::ErrorKind::NotFound if !may_be_new => JournalError::Absent { path: path.into() },
                _ => JournalError::io("open", path)(error),
            })?;
        lock_file(&file, path, wait)?;
        match check_head(&file, path)? {
            StoreHead::Whole => {}
            StoreHead::Missing if may_be_new => {
                let header = [&MAGIC[..], &VERSION.to_le_bytes()].concat();
                file.write_all_at(&header, 0).map_err(JournalError::io("write", path))?;
            }
            StoreHead::Missing => {
                let problem = "are missing".into();
                return Err(JournalError::Slot { path: path.into(), offset: 0, len: HEAD_BYTES, problem });
            }
        }
        Ok(Self { file, path: path.into(), end: FIRST_BLOCK })
    }

    /// Marks a block that a journal names as in use: the next one goes behind it.
    pub fn keep(&mut self, slot: &Slot) {
        let behind = slot.offset.saturating_add(slot.len).checked_next_multiple_of(ALIGNMENT);
        self.end = self.end.max(behind.unwrap_or(u64::MAX));
    }

    /// Writes a block behind the last one; with `sync` it has reached the disk when this returns.
    ///
    /// # Errors
    /// A full disk is an error here and never a fault in a reader: space is allocated first.
    pub fn append(&mut self, bytes: &[u8], sync: bool) -> Result<Slot, JournalError> {
        let (offset, len) = (self.end, bytes.len() as u64);
        match fallocate(&self.file, FallocateFlags::empty(), offset, len.max(1)) {
            // A file system without fallocate: the write below finds out about the space.
            Ok(()) | Err(rustix::io::Errno::OPNOTSUPP) => {}
            Err(errno) => return Err(JournalError::io("allocate space in", &self.path)(errno.into())),
        }
        self.file.write_all_at(bytes, offset).map_err(JournalError::io("append to", &self.path))?;
        if sync {
            sync_file(&self.file, &self.path)?;
        }
        let slot = Slot { offset, len, crc: crc32fast::hash(bytes) };
        self.keep(&slot);
        Ok(slot)
    }
}

impl Store {
    /// Appends a block that was given up elsewhere.
    ///
    /// # Errors
    /// As [`Self::append`].
    pub fn append_given_up(&mut self) -> Result<Slot, JournalError> {
        // No checksum of these bytes: they stand for themselves.
        let slot = self.append(&Tombstone::of(&Slot::default()).0, false)?;
        Ok(Slot { crc: 0, ..slot })
    }

    /// Gives a block up for good: its readers find none, and its space is the file system's again,
    /// where that can take it back. Done twice it is as if done once. With `sync` the tombstone is on disk
    /// before the bytes behind it go: a power cut leaves the block whole or given up.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub fn give_up(&self, slot: &Slot, sync: bool) -> Result<(), JournalError> {
        let tombstone = Tombstone::of(slot).0;
        let behind = tombstone.len() as u64;
        if slot.len < behind {
            return Ok(());
        }
        // First the words, so that a death in between leaves no damaged block.
        self.file.write_all_at(&tombstone, slot.offset).map_err(JournalError::io("write", &self.path))?;
        if sync {
            self.sync()?;
        }
        let hole = FallocateFlags::PUNCH_HOLE | FallocateFlags::KEEP_SIZE;
        let (from, len) = (slot.offset.saturating_add(behind), slot.len.saturating_sub(behind).max(1));
        match fallocate(&self.file, hole, from, len) {
            Ok(()) | Err(rustix::io::Errno::OPNOTSUPP) => Ok(()),
            Err(errno) => Err(JournalError::io("give back space of", &self.path)(errno.into())),
        }
    }

    /// Forces what was written to disk.
    ///
    /// # Errors
    /// Where the system refuses.
    pub fn sync(&self) -> Result<(), JournalError> {
        sync_file(&self.file, &self.path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::StoreView;

    #[test]
    fn blocks_come_back_in_place_and_aligned() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s");
        let mut store = Store::open(&path, Duration::ZERO).unwrap();
        let blocks: Vec<Vec<u8>> = (0..5u8).map(|k| vec![k + 1; 1000 + 77 * k as usize]).collect();
        let view = StoreView::open(&path).unwrap();
        let mut slots = Vec::new();
        for block in &blocks {
            slots.push(store.append(block, false).unwrap());
        }
        for (slot, block) in slots.iter().zip(&blocks) {
            assert_eq!(view.read(slot).unwrap().as_ref(), Some(block));
            assert_eq!(slot.offset % 64, 0);
        }
        drop(store);
        // A writer that comes back knows from its journal what is in use: the rest is overwritten.
        let mut store = Store::open(&path, Duration::ZERO).unwrap();
        store.keep(&slots[2]);
        assert_eq!(store.append(&blocks[3], false).unwrap(), slots[3]);
    }

    #[test]
    fn a_block_that_is_given_up_says_so_and_takes_no_space() {
        use std::os::unix::fs::MetadataExt;
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s");
        let mut store = Store::open(&path, Duration::ZERO).unwrap();
        let slots: Vec<Slot> = (1..4).map(|k| store.append(&[k; 300_000], false).unwrap()).collect();
        let blocks = || std::fs::metadata(&path).unwrap().blocks();
        let before = blocks();
        store.give_up(&slots[1], false).unwrap();
        store.give_up(&slots[1], false).unwrap();
        // File systems without holes keep the space.
        assert!(blocks() <= before);
        let view = StoreView::open(&path).unwrap();
        assert_eq!(view.read(&slots[1]).unwrap(), None);
        for k in [0, 2] {
            assert_eq!(view.read(&slots[k]).unwrap(), Some(vec![k as u8 + 1; 300_000]));
        }
        assert!(view.read(&Slot { crc: 7, ..slots[1] }).is_err(), "another block's tombstone");
        let elsewhere = store.append_given_up().unwrap();
        assert_eq!(view.read(&elsewhere).unwrap(), None);
        assert_eq!(elsewhere.offset, slots[2].offset + 300_032);
    }

    #[test]
    fn damage_is_found_before_it_is_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s");
        let mut store = Store::open(&path, Duration::ZERO).unwrap();
        let slot = store.append(&[7; 9000], false).unwrap();
        let text = |slot: Slot| StoreView::open(&path).unwrap().read(&slot).unwrap_err().to_string();
        assert!(text(Slot { len: 1 << 40, ..slot }).contains("lie behind its end"));
        assert!(text(Slot { offset: u64::MAX - 63, ..slot }).contains("lie behind its end"));
        assert!(text(Slot { offset: slot.offset + 1, ..slot }).contains("not begin on a cache line"));
        store.file.write_all_at(&[8], slot.offset + 4097).unwrap();
        assert!(text(slot).contains("checksum"));
        std::fs::write(&path, "something else").unwrap();
        drop(store);
        assert!(
            Store::open(&path, Duration::ZERO).unwrap_err().to_string().contains("not a Tessera keyframe")
        );
    }
}
