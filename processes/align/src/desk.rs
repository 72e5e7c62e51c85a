//! Everything that the aligner knows: a fold over its journal, and the files behind it.

use std::collections::BTreeMap;
use std::time::Duration;
use tessera_journal::{Follower, Journal, Store};
use tessera_mapping::{
    AlignRecord, Correction, FrameRecord, OptimiseRecord, RequestRecord, StoreSlot, Tracker,
};
use tessera_settings::Fsync;
use tessera_stage::{
    ALIGN_JOURNAL, Context, MappedKeyframes, OPTIMISE_JOURNAL, StageError, journal_slot, store_slot,
};
use tessera_surface::Vertex;

/// How long a predecessor may take to die before its lock is an error.
const PATIENCE: Duration = Duration::from_secs(2);

/// How the source ended, once it has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct End {
    /// Frames in the source.
    pub(crate) n_frames: u64,
    /// The final optimisation, if there is one.
    pub(crate) request: Option<RequestRecord>,
}

/// The aligner's whole state; what it holds can be thrown away and read back at any time.
pub(crate) struct Desk {
    pub(crate) tracker: Tracker,
    pub(crate) keyframes: MappedKeyframes,
    /// The last frame's record.
    pub(crate) last_frame: Option<FrameRecord>,
    pub(crate) end: Option<End>,
    /// Keyframes with an edge that closes a loop.
    pub(crate) n_loops: u64,
    journal: Journal<AlignRecord>,
    store: Store,
    answers: Follower<OptimiseRecord>,
    /// Corrections that the optimiser has journaled and that have not taken effect.
    pending: BTreeMap<u64, Correction>,
    /// The request whose correction took effect last.
    last_applied: Option<u64>,
    fsync: Fsync,
}

impl Desk {
    /// Reads the state back from the run directory; locks the journal and the store.
    pub(crate) fn open(context: &Context) -> Result<Self, StageError> {
        let files = &context.files;
        let store_path = files.store();
        let mut store = Store::open(&store_path, PATIENCE)?;
        let mut keyframes = MappedKeyframes::open(&store_path, context.layout.grid.len())?;
        let mut records = Vec::new();
        let (journal, recovered) =
            Journal::open(&files.align_journal(), ALIGN_JOURNAL, PATIENCE, |record: AlignRecord| {
                keyframes.take(&record).map_err(|e| e.to_string())?;
                slots(&record).iter().for_each(|slot| store.keep(&journal_slot(slot)));
                records.push(record);
                Ok(())
            })?;
        if let Some(reason) = &recovered.reason {
            tracing::warn!(
                "the journal of align ends after {} records, {} bytes behind them are dropped: {reason}",
                recovered.n_records,
                recovered.dropped_bytes
            );
        }
        if context.run.map.is_some() && !matches!(records.first(), Some(AlignRecord::Map(_))) {
            return Err(StageError::Inconsistent(format!(
                "{} does not begin with the map that the run starts in; `tessera resume` puts it back",
                files.align_journal().display()
            )));
        }
        let answers = Follower::open(&files.optimise_journal(), OPTIMISE_JOURNAL)?;
        let mut desk = Self {
            tracker: Tracker::new(context.mapping_context()),
            keyframes,
            last_frame: None,
            end: None,
            n_loops: 0,
            journal,
            store,
            answers,
            pending: BTreeMap::new(),
            last_applied: None,
            fsync: context.settings.flow.fsync,
        };
        for record in &records {
            desk.take_in(record);
        }
        Ok(desk)
    }

    fn take_in(&mut self, record: &AlignRecord) {
        self.tracker.apply(record);
        match record {
            AlignRecord::Frame(frame) => {
                let edges = frame.new_keyframe.iter().flat_map(|keyframe| &keyframe.edges);
                self.n_loops += u64::from(edges.filter(|edge| edge.is_loop).count() > 0);
                self.last_frame = Some((**frame).clone());
            }
            AlignRecord::Correction(applied) => self.last_applied = Some(applied.correction.request),
            AlignRecord::End { n_frames, request } => {
                self.end = Some(End { n_frames: *n_frames, request: *request });
            }
            AlignRecord::Skipped(..) | AlignRecord::Map(_) => {}
        }
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
        self.take_in(record);
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
        self.last_applied.is_some_and(|last| last >= request)
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
