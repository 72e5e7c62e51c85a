//! Surfaces of keyframes, read from the store and unpacked.

use crate::error::StageError;
use std::borrow::Cow;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use tessera_features::Feature;
use tessera_journal::{JournalError, Slot, StoreView};
use tessera_messages::{StoredSurfaceError, load_features, load_surface, max_stored_bytes};
use tessera_slam::{AlignRecord, KeyframeSurfaces, StoreSlot};
use tessera_surface::{Grid, Vertex};

/// The store's slot of a journaled one.
pub fn journal_slot(slot: &StoreSlot) -> Slot {
    Slot { offset: slot.offset, len: slot.len, crc: slot.crc }
}

/// The journal's form of a slot.
pub fn store_slot(slot: &Slot) -> StoreSlot {
    StoreSlot { offset: slot.offset, len: slot.len, crc: slot.crc }
}

/// Most surfaces that are held unpacked while others may be forgotten.
const MOST_UNPACKED: usize = 64;
/// Bytes of the surfaces that are held unpacked for a single look, at most: 1,000 of 160x120 vertices. A solve for
/// more keyframes reads the others anew each time it looks at them.
const MOST_LOOKED_AT_BYTES: usize = 614_000_000;
/// The same in vertices.
const MOST_LOOKED_AT_VERTICES: usize = MOST_LOOKED_AT_BYTES / size_of::<Vertex>();

/// All keyframes so far; each is unpacked when it is first read.
#[derive(Debug)]
pub struct StoredKeyframes {
    view: StoreView,
    grid: Grid,
    /// By keyframe id.
    keyframes: Vec<StoredKeyframe>,
    /// What was found when a keyframe was read.
    damage: OnceLock<StageError>,
    /// The first keyframe that was read and whose surface had been given up.
    given_up: OnceLock<u32>,
    /// A surface without a measurement, in place of one that is damaged or was given up.
    blank: OnceLock<Vec<Vertex>>,
    /// Surfaces that are held unpacked for a single look, at most.
    most_looked_at: usize,
    /// Surfaces that are held unpacked.
    n_held: AtomicUsize,
    /// Calls of [`Self::forget_unused`].
    now: u64,
}

/// Small: most of those that a long run makes are culled, and never held again.
#[derive(Debug)]
struct StoredKeyframe {
    slot: StoreSlot,
    /// `None`: it is damaged.
    surface: OnceLock<Option<Box<UnpackedSurface>>>,
    last_use: AtomicU64,
}

impl StoredKeyframe {
    fn is_held(&self) -> bool {
        self.surface.get().is_some()
    }
}

#[derive(Debug)]
struct UnpackedSurface {
    /// Empty: it was given up.
    vertices: Vec<Vertex>,
    features: Vec<Feature>,
}

impl StoredKeyframes {
    /// No keyframe yet. The surface of each will have the shape `grid`.
    ///
    /// # Errors
    /// Where the store cannot be opened.
    pub fn open(store: &std::path::Path, grid: Grid) -> Result<Self, JournalError> {
        Ok(Self {
            view: StoreView::open(store)?,
            grid,
            keyframes: Vec::new(),
            damage: OnceLock::new(),
            given_up: OnceLock::new(),
            blank: OnceLock::new(),
            most_looked_at: MOST_LOOKED_AT_VERTICES.checked_div(grid.len()).unwrap_or(0),
            n_held: AtomicUsize::new(0),
            now: 0,
        })
    }

    /// Takes in the keyframes that a record brings, if any, and checks their bytes; ids come in order.
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

    /// Takes the surface of a keyframe in and checks its bytes; ids come in order.
    ///
    /// # Errors
    /// Where it is not in the store, whole, or the id is not the next one.
    pub fn add(&mut self, id: u32, slot: &StoreSlot) -> Result<(), StageError> {
        self.add_unread(id, slot)?;
        self.view.read(&journal_slot(slot))?;
        Ok(())
    }

    /// Takes the surface of a keyframe in; its bytes are checked when they are first read.
    ///
    /// # Errors
    /// Where it cannot be in the store, or the id is not the next one.
    pub fn add_unread(&mut self, id: u32, slot: &StoreSlot) -> Result<(), StageError> {
        if id as usize != self.keyframes.len() {
            return Err(StageError::Inconsistent(format!(
                "keyframe {id} was journaled, expected {}",
                self.keyframes.len()
            )));
        }
        let most = max_stored_bytes(self.grid) as u64;
        if slot.len > most {
            return Err(StageError::Inconsistent(format!(
                "the surface of keyframe {id} has {} bytes, expected at most {most}",
                slot.len
            )));
        }
        self.view.check(&journal_slot(slot))?;
        let (surface, last_use) = (OnceLock::new(), AtomicU64::new(self.now));
        self.keyframes.push(StoredKeyframe { slot: *slot, surface, last_use });
        Ok(())
    }

    /// Holds the surface of the newest keyframe, whose maker has it at hand, as if it had been read:
    /// `vertices` as they would be unpacked, `bytes` as they stand in the store.
    ///
    /// # Errors
    /// Where the bytes hold no features.
    pub fn hold_newest(&mut self, vertices: Vec<Vertex>, bytes: &[u8]) -> Result<(), StageError> {
        if let Some(newest) = self.keyframes.last_mut() {
            let features = load_features(bytes).map_err(|error| not_a_surface(&newest.slot, &error))?;
            if newest.surface.get().is_none() {
                *self.n_held.get_mut() = self.n_held.get_mut().saturating_add(1);
            }
            newest.surface = OnceLock::from(Some(Box::new(UnpackedSurface { vertices, features })));
        }
        Ok(())
    }

    /// Whether every keyframe that was read so far was whole. To be asked before anything that was
    /// computed from them is written down.
    ///
    /// # Errors
    /// Names the first that was not.
    pub fn check(&mut self) -> Result<(), StageError> {
        self.damage.take().map_or(Ok(()), Err)
    }

    /// Whether a surface was not read as it was written: what is computed from it goes nowhere.
    pub fn is_damaged(&self) -> bool {
        self.damage.get().is_some()
    }

    /// The bytes of a keyframe's surface as they stand in the store; `None`: it was given up.
    ///
    /// # Errors
    /// Where it is unknown or damaged.
    pub fn stored(&self, keyframe: u32) -> Result<Option<Vec<u8>>, StageError> {
        Ok(self.view.read(&journal_slot(&self.slot(keyframe)?))?)
    }

    /// The vertices of a keyframe, which are not held: for those who look at each surface once. One that
    /// was given up has no measurement.
    ///
    /// # Errors
    /// As [`Self::stored`].
    pub fn load(&self, keyframe: u32) -> Result<Vec<Vertex>, StageError> {
        let vertices = self.read(&self.slot(keyframe)?)?.vertices;
        Ok(if vertices.is_empty() { self.blank().to_vec() } else { vertices })
    }

    /// Whether every keyframe that was read so far, but by [`Self::load`], had its surface still: for
    /// those who need active keyframes alone.
    ///
    /// # Errors
    /// Names the first whose surface was given up.
    pub fn check_held(&self) -> Result<(), StageError> {
        self.given_up.get().map_or(Ok(()), |id| {
            Err(StageError::Inconsistent(format!(
                "keyframe {id} is needed, but its surface was given up after it had been culled; \
                 a run with a larger flow.culled_mb keeps it"
            )))
        })
    }

    fn slot(&self, keyframe: u32) -> Result<StoreSlot, StageError> {
        let n = self.keyframes.len();
        let unknown = || StageError::Inconsistent(format!("there is no keyframe {keyframe}, there are {n}"));
        Ok(self.keyframes.get(keyframe as usize).ok_or_else(unknown)?.slot)
    }

    /// Forgets the surfaces that were not used within the last `n_calls` calls, where many are held;
    /// what is needed again is read again.
    pub fn forget_unused(&mut self, n_calls: u64) {
        self.now = self.now.saturating_add(1);
        if !self.now.is_multiple_of(n_calls) {
            return;
        }
        if *self.n_held.get_mut() > MOST_UNPACKED {
            let now = self.now;
            for keyframe in &mut self.keyframes {
                if keyframe.last_use.get_mut().saturating_add(n_calls) < now
                    && keyframe.surface.take().is_some()
                {
                    *self.n_held.get_mut() = self.n_held.get_mut().saturating_sub(1);
                }
            }
        }
    }

    /// Number of keyframes.
    pub fn len(&self) -> usize {
        self.keyframes.len()
    }

    /// Whether there is no keyframe yet.
    pub fn is_empty(&self) -> bool {
        self.keyframes.is_empty()
    }

    /// The surface of a keyframe; none of one that is unknown or damaged.
    fn surface(&self, id: u32) -> Option<&UnpackedSurface> {
        let keyframe = self.keyframes.get(id as usize)?;
        keyframe.last_use.store(self.now, Ordering::Relaxed);
        let hold = || {
            self.n_held.fetch_add(1, Ordering::Relaxed);
            self.read_known(id, keyframe).map(Box::new)
        };
        keyframe.surface.get_or_init(hold).as_deref()
    }

    /// Reads the surface of a keyframe; `None`: it is damaged.
    fn read_known(&self, id: u32, keyframe: &StoredKeyframe) -> Option<UnpackedSurface> {
        let surface = self.read(&keyframe.slot).map_err(|error| self.damage.set(error)).ok()?;
        if surface.vertices.is_empty() {
            self.given_up.get_or_init(|| id);
        }
        Some(surface)
    }

    fn read(&self, slot: &StoreSlot) -> Result<UnpackedSurface, StageError> {
        let Some(bytes) = self.view.read(&journal_slot(slot))? else {
            return Ok(UnpackedSurface { vertices: Vec::new(), features: Vec::new() });
        };
        let (vertices, features) =
            load_surface(self.grid, &bytes).map_err(|error| not_a_surface(slot, &error))?;
        Ok(UnpackedSurface { vertices, features })
    }

    fn blank(&self) -> &[Vertex] {
        self.blank.get_or_init(|| vec![Vertex::default(); self.grid.len()])
    }
}

fn not_a_surface(slot: &StoreSlot, error: &StoredSurfaceError) -> StageError {
    StageError::Inconsistent(format!("at {} of the keyframe store: {error}", slot.offset))
}

impl KeyframeSurfaces for StoredKeyframes {
    fn vertices(&self, keyframe: u32) -> &[Vertex] {
        match self.surface(keyframe) {
            Some(surface) if !surface.vertices.is_empty() => &surface.vertices,
            _ => self.blank(),
        }
    }

    fn vertices_once(&self, keyframe: u32) -> Cow<'_, [Vertex]> {
        let is_full = self.n_held.load(Ordering::Relaxed) >= self.most_looked_at;
        let Some(known) = self.keyframes.get(keyframe as usize).filter(|known| is_full && !known.is_held())
        else {
            return self.vertices(keyframe).into();
        };
        match self.read_known(keyframe, known) {
            Some(surface) if !surface.vertices.is_empty() => surface.vertices.into(),
            _ => self.blank().into(),
        }
    }

    fn features(&self, keyframe: u32) -> &[Feature] {
        self.surface(keyframe).map_or(&[], |surface| &surface.features)
    }

    /// Without the vertices, which take a hundred times as long to unpack.
    fn features_once(&self, keyframe: u32) -> Cow<'_, [Feature]> {
        let Some(known) = self.keyframes.get(keyframe as usize) else { return Cow::Borrowed(&[]) };
        if known.is_held() {
            return self.features(keyframe).into();
        }
        let read = || -> Result<Vec<Feature>, StageError> {
            let Some(bytes) = self.view.read(&journal_slot(&known.slot))? else { return Ok(Vec::new()) };
            load_features(&bytes).map_err(|error| not_a_surface(&known.slot, &error))
        };
        read().map_err(|error| self.damage.set(error)).unwrap_or_default().into()
    }
}

/// Keyframes that a record brings, with where their surfaces lie.
pub fn slots(record: &AlignRecord) -> impl Iterator<Item = (u32, &StoreSlot)> {
    let (one, many) = match record {
        AlignRecord::Frame(frame) => (frame.change.new_keyframe.as_ref(), &[][..]),
        AlignRecord::Map(map) => (None, &map.keyframes[..]),
        AlignRecord::Skipped(..) | AlignRecord::Correction(_) | AlignRecord::End { .. } => (None, &[][..]),
    };
    let one = one.into_iter().map(|keyframe| (keyframe.id, &keyframe.slot));
    one.chain(many.iter().map(|keyframe| (keyframe.id, &keyframe.slot)))
}

#[cfg(test)]
mod tests;
