//! The one module that maps files: blocks of the keyframe store, read in place.
#![expect(unsafe_code, reason = "mapping a file is unsafe: its bytes could change under the reader")]

use crate::error::JournalError;
use crate::store::Slot;
use memmap2::{Mmap, MmapOptions};
use std::fs::File;
use std::path::{Path, PathBuf};

/// A reader of the store that maps each block once, when it is first needed, and checks it then.
#[derive(Debug)]
pub struct StoreView {
    file: File,
    path: PathBuf,
    blocks: Vec<Mmap>,
}

impl StoreView {
    /// Opens an existing store.
    ///
    /// # Errors
    /// Where the file cannot be opened.
    pub fn open(path: &Path) -> Result<Self, JournalError> {
        let file = File::open(path).map_err(JournalError::io("open", path))?;
        Ok(Self { file, path: path.into(), blocks: Vec::new() })
    }

    /// Maps a block and checks its checksum; answers its position for [`Self::bytes`].
    ///
    /// # Errors
    /// Where the block lies outside the file or does not hold what its checksum says.
    pub fn map(&mut self, slot: &Slot) -> Result<usize, JournalError> {
        let wrong = |problem: String| JournalError::Slot {
            path: self.path.clone(),
            offset: slot.offset,
            len: slot.len,
            problem,
        };
        if !slot.offset.is_multiple_of(64) {
            return Err(wrong("do not begin on a cache line".into()));
        }
        let file_len = self.file.metadata().map_err(JournalError::io("look at", &self.path))?.len();
        if slot.offset.checked_add(slot.len).is_none_or(|end| end > file_len) {
            return Err(wrong(format!("lie behind its end at {file_len}")));
        }
        let len = usize::try_from(slot.len).map_err(|_| wrong("are too many".into()))?;
        // SAFETY: the store is append-only: the writer never shortens it and never writes to a
        // block that a record names, and no record names a block before its bytes are complete.
        let block = unsafe { MmapOptions::new().offset(slot.offset).len(len).map(&self.file) }
            .map_err(JournalError::io("map", &self.path))?;
        let crc = crc32fast::hash(&block);
        if crc != slot.crc {
            return Err(wrong(format!("have checksum {crc:08x}, expected {:08x}", slot.crc)));
        }
        self.blocks.push(block);
        Ok(self.blocks.len() - 1)
    }

    /// The bytes of a mapped block, on a 64-byte border; empty for a position never given out.
    pub fn bytes(&self, position: usize) -> &[u8] {
        self.blocks.get(position).map_or(&[], |block| &block[..])
    }
}
