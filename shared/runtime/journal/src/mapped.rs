//! The one module that maps files: blocks of the keyframe store, read in place.
#![expect(unsafe_code, reason = "mapping a file is unsafe: its bytes could change under the reader")]

use crate::error::JournalError;
use crate::store::Slot;
use memmap2::{Mmap, MmapOptions};
use std::fs::File;
use std::path::{Path, PathBuf};

/// A reader of the store.
#[derive(Debug)]
pub struct StoreView {
    file: File,
    path: PathBuf,
}

/// A block, mapped and checked.
#[derive(Debug)]
pub struct StoredBlock(Mmap);

impl StoredBlock {
    /// Its bytes, on a 64-byte border.
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }
}

impl StoreView {
    /// Opens an existing store.
    ///
    /// # Errors
    /// Where the file cannot be opened.
    pub fn open(path: &Path) -> Result<Self, JournalError> {
        let file = File::open(path).map_err(JournalError::io("open", path))?;
        Ok(Self { file, path: path.into() })
    }

    /// Whether a block can be where the slot says; its bytes are not looked at.
    ///
    /// # Errors
    /// Where it lies outside the file or off the borders of cache lines.
    pub fn check(&self, slot: &Slot) -> Result<(), JournalError> {
        if !slot.offset.is_multiple_of(64) {
            return Err(self.wrong(slot, "do not begin on a cache line".into()));
        }
        let file_len = self.file.metadata().map_err(JournalError::io("look at", &self.path))?.len();
        if slot.offset.checked_add(slot.len).is_none_or(|end| end > file_len) {
            return Err(self.wrong(slot, format!("lie behind its end at {file_len}")));
        }
        Ok(())
    }

    /// Maps a block and checks its checksum.
    ///
    /// # Errors
    /// Where the block lies outside the file or does not hold what its checksum says.
    pub fn map(&self, slot: &Slot) -> Result<StoredBlock, JournalError> {
        self.check(slot)?;
        let len = usize::try_from(slot.len).map_err(|_| self.wrong(slot, "are too many".into()))?;
        // SAFETY: the store is append-only: the writer never shortens it and never writes to a
        // block that a record names, and no record names a block before its bytes are complete.
        let block = unsafe { MmapOptions::new().offset(slot.offset).len(len).map(&self.file) }
            .map_err(JournalError::io("map", &self.path))?;
        let crc = crc32fast::hash(&block);
        if crc != slot.crc {
            return Err(self.wrong(slot, format!("have checksum {crc:08x}, expected {:08x}", slot.crc)));
        }
        Ok(StoredBlock(block))
    }

    fn wrong(&self, slot: &Slot, problem: String) -> JournalError {
        JournalError::Slot { path: self.path.clone(), offset: slot.offset, len: slot.len, problem }
    }
}
