//! Surfaces of keyframes, mapped from the store and read in place.

use crate::error::StageError;
use std::sync::OnceLock;
use tessera_features::Feature;
use tessera_journal::{Block, JournalError, Slot, StoreView};
use tessera_messages::{MAX_FEATURES, vertices_of_features};
use tessera_slam::{AlignRecord, KeyframeSurfaces, StoreSlot};
use tessera_surface::Vertex;

/// The store's slot of a journaled one.
pub fn journal_slot(slot: &StoreSlot) -> Slot {
    Slot { offset: slot.offset, len: slot.len, crc: slot.crc }
}

/// The journal's form of a slot.
pub fn store_slot(slot: &Slot) -> StoreSlot {
    StoreSlot { offset: slot.offset, len: slot.len, crc: slot.crc }
}

/// All keyframes so far; each is mapped and checked once, when it is added or when it is first read.
#[derive(Debug)]
pub struct MappedKeyframes {
    view: StoreView,
    /// By keyframe id.
    keyframes: Vec<Keyframe>,
    n_vertices: usize,
    /// What was found when a keyframe was read.
    damage: OnceLock<JournalError>,
    /// A surface without a measurement, in place of a damaged one.
    blank: OnceLock<Vec<Vertex>>,
}

#[derive(Debug)]
struct Keyframe {
    slot: StoreSlot,
    /// `None`: it is damaged.
    block: OnceLock<Option<Block>>,
}

impl MappedKeyframes {
    /// No keyframe yet. Each will have `n_vertices` vertices.
    ///
    /// # Errors
    /// Where the store cannot be opened.
    pub fn open(store: &std::path::Path, n_vertices: usize) -> Result<Self, JournalError> {
        Ok(Self {
            view: StoreView::open(store)?,
            keyframes: Vec::new(),
            n_vertices,
            damage: OnceLock::new(),
            blank: OnceLock::new(),
        })
    }

    /// Takes in the keyframes that a record brings, if any, and reads them; ids come in order.
    ///
    /// # Errors
    /// As [`Self::add`].
    pub fn take(&mut self, record: &AlignRecord) -> Result<(), StageError> {
        slots(record).try_for_each(|(id, slot)| self.add(id, slot))
    }

    /// As [`Self::take`], for records of a journal that was read and checked when the run began:
    /// what they name is read when it is needed ([`Self::check`]).
    ///
    /// # Errors
    /// As [`Self::add_unread`].
    pub fn take_unread(&mut self, record: &AlignRecord) -> Result<(), StageError> {
        slots(record).try_for_each(|(id, slot)| self.add_unread(id, slot))
    }

    /// Takes the surface of a keyframe in and reads it; ids come in order.
    ///
    /// # Errors
    /// Where it is not in the store, whole, or the id is not the next one.
    pub fn add(&mut self, id: u32, slot: &StoreSlot) -> Result<(), StageError> {
        let block = OnceLock::from(Some(self.view.map(&self.checked(id, slot)?)?));
        self.keyframes.push(Keyframe { slot: *slot, block });
        Ok(())
    }

    /// Takes the surface of a keyframe in; its bytes are checked when they are first read.
    ///
    /// # Errors
    /// Where it cannot be in the store, or the id is not the next one.
    pub fn add_unread(&mut self, id: u32, slot: &StoreSlot) -> Result<(), StageError> {
        self.view.check(&self.checked(id, slot)?)?;
        self.keyframes.push(Keyframe { slot: *slot, block: OnceLock::new() });
        Ok(())
    }

    fn checked(&self, id: u32, slot: &StoreSlot) -> Result<Slot, StageError> {
        if id as usize != self.keyframes.len() {
            return Err(StageError::Inconsistent(format!(
                "keyframe {id} was journaled, expected {}",
                self.keyframes.len()
            )));
        }
        let expected = (self.n_vertices * size_of::<Vertex>()) as u64;
        let most = expected + (vertices_of_features(MAX_FEATURES) * size_of::<Vertex>()) as u64;
        if slot.len < expected || slot.len > most {
            return Err(StageError::Inconsistent(format!(
                "the surface of keyframe {id} has {} bytes, expected {expected}",
                slot.len
            )));
        }
        Ok(journal_slot(slot))
    }

    /// Whether every keyframe that was read so far was whole. To be asked before anything that was
    /// computed from them is written down.
    ///
    /// # Errors
    /// Names the first that was not.
    pub fn check(&mut self) -> Result<(), StageError> {
        self.damage.take().map_or(Ok(()), |damage| Err(damage.into()))
    }

    /// Bytes of a keyframe's surface, as they stand in the store; none of one that is damaged.
    pub fn bytes(&self, keyframe: u32) -> &[u8] {
        let Some(keyframe) = self.keyframes.get(keyframe as usize) else { return &[] };
        let block = keyframe.block.get_or_init(|| match self.view.map(&journal_slot(&keyframe.slot)) {
            Ok(block) => Some(block),
            Err(error) => {
                let _ = self.damage.set(error);
                None
            }
        });
        block.as_ref().map_or(&[], Block::bytes)
    }

    /// Number of keyframes.
    pub fn len(&self) -> usize {
        self.keyframes.len()
    }

    /// Whether there is no keyframe yet.
    pub fn is_empty(&self) -> bool {
        self.keyframes.is_empty()
    }
}

impl KeyframeSurfaces for MappedKeyframes {
    fn vertices(&self, keyframe: u32) -> &[Vertex] {
        // Slots lie on 64-byte borders and their length was checked when they were added.
        match bytemuck::try_cast_slice::<u8, Vertex>(self.bytes(keyframe)) {
            Ok(vertices) if vertices.len() >= self.n_vertices => &vertices[..self.n_vertices],
            _ => self.blank.get_or_init(|| vec![Vertex::default(); self.n_vertices]),
        }
    }

    fn features(&self, keyframe: u32) -> &[Feature] {
        // Behind the vertices, whose 32 bytes keep the descriptors aligned.
        let bytes = self.bytes(keyframe);
        let tail = bytes.get(self.n_vertices * size_of::<Vertex>()..).unwrap_or_default();
        let n_bytes = tail.len() / size_of::<Feature>() * size_of::<Feature>();
        bytemuck::try_cast_slice(&tail[..n_bytes]).unwrap_or_default()
    }
}

/// Keyframes that a record brings, with where their surfaces lie.
pub fn slots(record: &AlignRecord) -> impl Iterator<Item = (u32, &StoreSlot)> {
    let (one, many) = match record {
        AlignRecord::Frame(frame) => (frame.new_keyframe.as_ref(), &[][..]),
        AlignRecord::Map(map) => (None, &map.keyframes[..]),
        AlignRecord::Skipped(..) | AlignRecord::Correction(_) | AlignRecord::End { .. } => (None, &[][..]),
    };
    let one = one.into_iter().map(|keyframe| (keyframe.id, &keyframe.slot));
    one.chain(many.iter().map(|keyframe| (keyframe.id, &keyframe.slot)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::FileExt;
    use std::time::Duration;
    use tessera_journal::Store;

    #[test]
    fn a_damaged_keyframe_is_found_when_it_is_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s");
        let mut store = Store::open(&path, Duration::ZERO).unwrap();
        let surface = vec![Vertex::default(); 12];
        let slots: Vec<StoreSlot> = (0..3)
            .map(|_| store_slot(&store.append(bytemuck::cast_slice(&surface), false).unwrap()))
            .collect();
        let file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
        file.write_all_at(&[1], slots[1].offset + 7).unwrap();
        let mut keyframes = MappedKeyframes::open(&path, 12).unwrap();
        for (id, slot) in slots.iter().enumerate() {
            keyframes.add_unread(id as u32, slot).unwrap();
        }
        assert_eq!(keyframes.vertices(0).len(), 12);
        assert!(keyframes.check().is_ok(), "what nobody read was not looked at");
        assert_eq!(keyframes.vertices(1).len(), 12, "a surface without a measurement");
        let message = keyframes.check().unwrap_err().to_string();
        assert!(message.contains("checksum"), "{message}");
        let mut eager = MappedKeyframes::open(&path, 12).unwrap();
        eager.add(0, &slots[0]).unwrap();
        assert!(eager.add(1, &slots[1]).is_err());
    }
}
