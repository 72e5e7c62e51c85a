//! Everything that the aligner knows: a fold over its journal, and the files behind it.

use crate::known::Known;
use std::collections::BTreeMap;
use std::time::Duration;
use tessera_journal::{Follower, Journal, Store};
use tessera_mapping::{AlignRecord, Correction, FrameRecord, OptimiseRecord, StoreSlot, Tracker};
use tessera_settings::Fsync;
use tessera_stage::{
    ALIGN_JOURNAL, Context, MappedKeyframes, OPTIMISE_JOURNAL, StageError, journal_slot, store_slot,
};
use tessera_surface::Vertex;

/// How long a predecessor may take to die before its lock is an error.
const PATIENCE: Duration = Duration::from_secs(2);

/// The aligner's whole state; what it holds can be thrown away and read back at any time.
pub(crate) struct Desk {
    pub(crate) known: Known,
    pub(crate) keyframes: MappedKeyframes,
    journal: Journal<AlignRecord>,
    store: Store,
    answers: Follower<OptimiseRecord>,
    /// Corrections that the optimiser has journaled and that have not taken effect.
    pending: BTreeMap<u64, Correction>,
    fsync: Fsync,
}

impl Desk {
    /// Reads the state back from the run directory; locks the journal and the store.
    pub(crate) fn open(context: &Context) -> Result<Self, StageError> {
        let files = &context.files;
        let store_path = files.store();
        let mut store = Store::open(&store_path, PATIENCE)?;
        let mut keyframes = MappedKeyframes::open(&store_path, context.layout.grid.len())?;
        let mut known = Known::new(Tracker::new(context.mapping_context()));
        let (journal, recovered) =
            Journal::open(&files.align_journal(), ALIGN_JOURNAL, PATIENCE, |record: AlignRecord| {
                keyframes.take(&record).map_err(|e| e.to_string())?;
                slots(&record).iter().for_each(|slot| store.keep(&journal_slot(slot)));
                known.take_in(record);
                Ok(())
            })?;
        if let Some(reason) = &recovered.reason {
            tracing::warn!(
                "the journal of align ends after {} records, {} bytes behind them are dropped: {reason}",
                recovered.n_records,
                recovered.dropped_bytes
            );
        }
        if context.run.map.is_some() && !known.begins_in_map {
            return Err(StageError::Inconsistent(format!(
                "{} does not begin with the map that the run starts in; `tessera resume` puts it back",
                files.align_journal().display()
            )));
        }
        let answers = Follower::open(&files.optimise_journal(), OPTIMISE_JOURNAL)?;
        Ok(Self {
            known,
            keyframes,
            journal,
            store,
            answers,
            pending: BTreeMap::new(),
            fsync: context.settings.flow.fsync,
        })
    }

    /// Writes the surface of a frame that becomes a keyframe into the store and names it.
    pub(crate) fn store_keyframe(
        &mut self,
        record: &mut FrameRecord,
        surface: &[Vertex],
    ) -> Result<(), StageError> {
        let sync = self.fsync != Fsync::Never;
        let slot = self.store.append(bytemuck::cast_slice(surface), sync)?;
        if let Some(keyframe) = &mut record.new_keyframe {
            keyframe.slot = store_slot(&slot);
        }
        Ok(())
    }

    /// Writes a record down and lets it take effect: from here on it has happened.
    pub(crate) fn commit(&mut self, record: &AlignRecord) -> Result<(), StageError> {
        let is_plain = matches!(record, AlignRecord::Frame(f) if f.new_keyframe.is_none())
            || matches!(record, AlignRecord::Skipped(..));
        let sync = match self.fsync {
            Fsync::Never => false,
            Fsync::Keyframe => !is_plain,
            Fsync::Always => true,
        };
        self.journal.append(record, sync)?;
        self.keyframes.take(record)?;
        self.known.take_in(record.clone());
        Ok(())
    }

    /// The correction that answers `request`, if the optimiser has journaled it.
    pub(crate) fn answer(&mut self, request: u64) -> Result<Option<Correction>, StageError> {
        self.read_answers()?;
        Ok(self.pending.remove(&request))
    }

    /// Any correction that has not taken effect, the oldest first (live mode).
    pub(crate) fn any_answer(&mut self) -> Result<Option<Correction>, StageError> {
        self.read_answers()?;
        Ok(self.pending.pop_first().map(|(_, correction)| correction))
    }

    /// Whether the correction of `request` has taken effect.
    pub(crate) fn is_applied(&self, request: u64) -> bool {
        self.known.last_applied.is_some_and(|last| last >= request)
    }

    fn read_answers(&mut self) -> Result<(), StageError> {
        while let Some(OptimiseRecord::Correction(correction)) = self.answers.next()? {
            if !self.is_applied(correction.request) {
                self.pending.insert(correction.request, *correction);
            }
        }
        Ok(())
    }
}

/// Where the surfaces lie that a record names.
fn slots(record: &AlignRecord) -> Vec<StoreSlot> {
    match record {
        AlignRecord::Frame(frame) => frame.new_keyframe.iter().map(|keyframe| keyframe.slot).collect(),
        AlignRecord::Map(map) => map.keyframes.iter().map(|keyframe| keyframe.slot).collect(),
        _ => Vec::new(),
    }
}
