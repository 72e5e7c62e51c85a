//! The reading end of the keyframe store.

use crate::error::JournalError;
use crate::store::{HEAD_BYTES, Slot, StoreHead, Tombstone, check_head};
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// A reader of the store.
#[derive(Debug)]
pub struct StoreView {
    file: File,
    path: PathBuf,
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

    /// As [`Self::open`], of a store whose first bytes are there.
    ///
    /// # Errors
    /// Where they are missing, are something else, or of another version.
    pub fn open_whole(path: &Path) -> Result<Self, JournalError> {
        let view = Self::open(path)?;
        match check_head(&view.file, path)? {
            StoreHead::Whole => Ok(view),
            StoreHead::Missing => {
                Err(view.wrong(&Slot { len: HEAD_BYTES, ..Slot::default() }, "are missing".into()))
            }
        }
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

    /// The bytes of a block; `None` where it was given up.
    ///
    /// # Errors
    /// Where the block lies outside the file or does not hold what its checksum says.
    pub fn read(&self, slot: &Slot) -> Result<Option<Vec<u8>>, JournalError> {
        self.check(slot)?;
        let len = usize::try_from(slot.len).map_err(|_| self.wrong(slot, "are too many".into()))?;
        let mut bytes = vec![0; len];
        self.file.read_exact_at(&mut bytes, slot.offset).map_err(JournalError::io("read", &self.path))?;
        let crc = crc32fast::hash(&bytes);
        if crc == slot.crc {
            return Ok(Some(bytes));
        }
        if Tombstone::of(slot).begins(&bytes) {
            return Ok(None);
        }
        Err(self.wrong(slot, format!("have checksum {crc:08x}, expected {:08x}", slot.crc)))
    }

    fn wrong(&self, slot: &Slot, problem: String) -> JournalError {
        JournalError::Slot { path: self.path.clone(), offset: slot.offset, len: slot.len, problem }
    }
}
