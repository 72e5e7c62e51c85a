//! A store of surfaces at the base: the robot's bytes up to the last block that a record names. What they
//! hold is opaque here; each block has its checksum in the journal.

use crate::copies::open_copy;
use crate::error::FleetError;
use crate::wire::request::Growing;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use tessera_journal::{StoreView, set_aside};
use tessera_slam::StoreSlot;
use tessera_stage::journal_slot;

/// The copy of a store.
pub struct StoreCopy {
    file: File,
    path: PathBuf,
    /// Bytes that are here and whole.
    end: u64,
    /// Blocks that are here and whole: the first of those that the records name.
    n_whole: usize,
}

impl StoreCopy {
    /// Opens or creates the copy. What is whole in it the blocks' checksums say.
    ///
    /// # Errors
    /// Where the file cannot be read or written.
    pub fn open(folder: &Path, slots: &[StoreSlot]) -> Result<Self, FleetError> {
        let path = folder.join(Growing::Store.file());
        let file = open_copy(&path)?;
        let mut copy = Self { file, path, end: 0, n_whole: 0 };
        while let Some(slot) = slots.get(copy.n_whole).filter(|slot| copy.is_whole(slot)) {
            copy.end = copy.end.max(end_of(slot));
            copy.n_whole = copy.n_whole.saturating_add(1);
        }
        // A block that is all there and not whole is damage, and others may lie behind it.
        let len = copy.file.metadata().map_err(FleetError::io("look at", &copy.path))?.len();
        if slots.get(copy.n_whole).is_some_and(|slot| end_of(slot) <= len) {
            set_aside(&copy.path)?;
        }
        // What a death left behind: no reader has that mapped.
        copy.file.set_len(copy.end).map_err(FleetError::io("cut", &copy.path))?;
        Ok(copy)
    }

    /// Bytes from which on the next ones are asked.
    pub fn len_bytes(&self) -> u64 {
        self.end
    }

    /// Surfaces that are here.
    pub fn n_whole(&self) -> usize {
        self.n_whole
    }

    /// Writes bytes that continue the copy, and forces them to disk. `false`: a block in them is not
    /// what its record says, and is asked for again.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub fn append(&mut self, bytes: &[u8], slots: &[StoreSlot]) -> Result<bool, FleetError> {
        let io = |what: &'static str| FleetError::io(what, &self.path);
        self.file.write_all_at(bytes, self.end).map_err(io("append to"))?;
        self.file.sync_data().map_err(io("sync"))?;
        let end = self.end.saturating_add(bytes.len() as u64);
        while let Some(slot) = slots.get(self.n_whole).filter(|slot| end_of(slot) <= end) {
            if !self.is_whole(slot) {
                // Of a block that came in several answers all come again.
                self.end = self.end.min(slot.offset);
                return Ok(false);
            }
            self.n_whole = self.n_whole.saturating_add(1);
        }
        self.end = end;
        Ok(true)
    }

    fn is_whole(&self, slot: &StoreSlot) -> bool {
        StoreView::open(&self.path).and_then(|view| view.read(&journal_slot(slot))).is_ok()
    }
}

fn end_of(slot: &StoreSlot) -> u64 {
    slot.offset.saturating_add(slot.len)
}
