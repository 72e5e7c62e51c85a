//! Surfaces of keyframes, mapped from the store and read in place.

use crate::error::StageError;
use tessera_journal::{JournalError, Slot, StoreView};
use tessera_mapping::{AlignRecord, KeyframeSurfaces, StoreSlot};
use tessera_surface::Vertex;

/// The store's slot of a journaled one.
pub fn journal_slot(slot: &StoreSlot) -> Slot {
    Slot { offset: slot.offset, len: slot.len, crc: slot.crc }
}

/// The journal's form of a slot.
pub fn store_slot(slot: &Slot) -> StoreSlot {
    StoreSlot { offset: slot.offset, len: slot.len, crc: slot.crc }
}

/// All keyframes so far; each is mapped and checked once.
#[derive(Debug)]
pub struct MappedKeyframes {
    view: StoreView,
    /// Position in the view, by keyframe id.
    positions: Vec<usize>,
    n_vertices: usize,
}

impl MappedKeyframes {
    /// No keyframe yet. Each will have `n_vertices` vertices.
    ///
    /// # Errors
    /// Where the store cannot be opened.
    pub fn open(store: &std::path::Path, n_vertices: usize) -> Result<Self, JournalError> {
        Ok(Self { view: StoreView::open(store)?, positions: Vec::new(), n_vertices })
    }

    /// Takes in the keyframes that a record brings, if any; ids come in order.
    ///
    /// # Errors
    /// As [`Self::add`].
    pub fn take(&mut self, record: &AlignRecord) -> Result<(), StageError> {
        match record {
            AlignRecord::Frame(frame) => {
                frame.new_keyframe.iter().try_for_each(|keyframe| self.add(keyframe.id, &keyframe.slot))
            }
            AlignRecord::Map(map) => {
                map.keyframes.iter().try_for_each(|keyframe| self.add(keyframe.id, &keyframe.slot))
            }
            AlignRecord::Skipped(..) | AlignRecord::Correction(_) | AlignRecord::End { .. } => Ok(()),
        }
    }

    /// Takes the surface of a keyframe in; ids come in order.
    ///
    /// # Errors
    /// Where it is not in the store, whole, or the id is not the next one.
    pub fn add(&mut self, id: u32, slot: &StoreSlot) -> Result<(), StageError> {
        if id as usize != self.positions.len() {
            return Err(StageError::Inconsistent(format!(
                "keyframe {id} was journaled, expected {}",
                self.positions.len()
            )));
        }
        let expected = (self.n_vertices * size_of::<Vertex>()) as u64;
        if slot.len != expected {
            return Err(StageError::Inconsistent(format!(
                "the surface of keyframe {id} has {} bytes, expected {expected}",
                slot.len
            )));
        }
        self.positions.push(self.view.map(&journal_slot(slot))?);
        Ok(())
    }

    /// Bytes of a keyframe's surface, as they stand in the store.
    pub fn bytes(&self, keyframe: u32) -> &[u8] {
        self.positions.get(keyframe as usize).map_or(&[], |&position| self.view.bytes(position))
    }

    /// Number of keyframes.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there is no keyframe yet.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }
}

impl KeyframeSurfaces for MappedKeyframes {
    fn vertices(&self, keyframe: u32) -> &[Vertex] {
        // Slots lie on 64-byte borders and their length was checked when they were added.
        bytemuck::try_cast_slice(self.bytes(keyframe)).unwrap_or(&[])
    }
}
