//! The aligner's durable state: a fold over its journal, and the files behind it.

use crate::journal_fold::{FoldSnapshot, JournalFold};
use crate::posed::PosedFrame;
use std::collections::BTreeMap;
use std::time::Duration;
use tessera_journal::{Follower, Journal, Opening, Recovered, Store};
use tessera_messages::store_surface;
use tessera_settings::Fsync;
use tessera_slam::{AlignRecord, Correction, FrameRecord, GivenUp, OptimiseRecord, Tracker};
use tessera_stage::{
    ALIGN_JOURNAL, Checkpoint, Marks, OPTIMISE_JOURNAL, StageContext, StageError, StateAt, StoredKeyframes,
    journal_slot, slots, store_slot,
};
use tessera_surface::{Grid, Vertex};

/// What the checkpoint calls itself: another name for each layout of the state in it.
const CHECKPOINT: &str = "align.3";
/// Records after which a keyframe's surface that was not needed is forgotten.
const FORGET_AFTER_RECORDS: u64 = 64;
/// How long a predecessor may take to die before its lock is an error.
const PATIENCE: Duration = Duration::from_secs(2);

/// The aligner's whole state; it can be thrown away and read back from disk at any time.
pub(crate) struct JournaledAligner {
    pub(crate) fold: JournalFold,
    pub(crate) keyframes: StoredKeyframes,
    pub(crate) posed: PosedFrame,
    journal: Journal<AlignRecord>,
    store: Store,
    corrections: Follower<OptimiseRecord>,
    /// Corrections that the optimiser has journaled and that have not taken effect.
    pending: BTreeMap<u64, Correction>,
    fsync: Fsync,
    checkpoint: Checkpoint,
    grid: Grid,
    /// The surface that was stored for the record about to be committed, packed and as it is unpacked.
    stored: Option<(Vec<u8>, Vec<Vertex>)>,
    /// Bytes that the surfaces of culled keyframes may take.
    culled_bytes: u64,
    /// Keyframes whose surfaces this process has given up.
    given_up: GivenUp,
}

/// Logs what was read back of the aligner's journal.
fn log_recovery(marks: Option<&Marks>, recovered: &Recovered) {
    if let Some(marks) = marks {
        tracing::info!("a checkpoint spares {} of {} records", marks.align.n_records, recovered.n_records);
    }
    if let Some(reason) = &recovered.reason {
        tracing::warn!(
            "the journal of align ends after {} records, {} bytes behind them are dropped: {reason}",
            recovered.n_records,
            recovered.dropped_bytes
        );
    }
}

impl JournaledAligner {
    /// Reads the state back from the run directory; locks the journal and the store.
    pub(crate) fn open(context: &StageContext) -> Result<Self, StageError> {
        let files = &context.files;
        let store_path = files.store();
        let mut store = Store::open_begun(&store_path, PATIENCE)?;
        let mut keyframes = StoredKeyframes::open(&store_path, context.layout.grid)?;
        let flow = &context.settings.flow;
        let mut checkpoint = Checkpoint::new(&files.align_checkpoint(), CHECKPOINT, flow.checkpoint_kb);
        let kept = checkpoint.read::<StateAt<FoldSnapshot<'static>>>().filter(|kept| kept.marks.fits(files));
        let (marks, mut fold) = match kept {
            Some(kept) => (Some(kept.marks), JournalFold::restore(context.mapping_context(), kept.state)),
            None => (None, JournalFold::new(Tracker::new(context.mapping_context()))),
        };
        for keyframe in &fold.tracker.state().keyframes {
            keyframes.add_unread(keyframe.id, &keyframe.slot)?;
            store.keep(&journal_slot(&keyframe.slot));
        }
        let corrections = Follower::open_behind(
            &files.optimise_journal(),
            OPTIMISE_JOURNAL,
            marks.as_ref().map(|marks| &marks.optimise),
        )?;
        let mark = marks.as_ref().map(|marks| &marks.align);
        let (journal, recovered) = Journal::open_as(
            &files.align_journal(),
            ALIGN_JOURNAL,
            Opening { mark, is_begun: true, ..Opening::new(PATIENCE) },
            |record: AlignRecord| {
                keyframes.take_unread(&record).map_err(|e| e.to_string())?;
                slots(&record).for_each(|(_, slot)| store.keep(&journal_slot(slot)));
                fold.apply(record);
                Ok(())
            },
        )?;
        log_recovery(marks.as_ref(), &recovered);
        if context.run.map.is_some() && !fold.begins_in_map {
            return Err(StageError::Inconsistent(format!(
                "{} does not begin with the map that the run starts in; `tessera resume` puts it back",
                files.align_journal().display()
            )));
        }
        checkpoint.stands_at(marks.map_or(0, |marks| marks.len_bytes()));
        let (pending, fsync) = (BTreeMap::new(), flow.fsync.of_run(context.settings.run.live));
        let grid = context.layout.grid;
        let culled_bytes = u64::from(flow.culled_mb) * 1_000_000;
        let given_up = GivenUp::default();
        let mut state = Self {
            fold,
            keyframes,
            posed: PosedFrame::open(&files.live_posed(), context.settings.run.live)?,
            journal,
            store,
            corrections,
            pending,
            fsync,
            checkpoint,
            grid,
            culled_bytes,
            given_up,
            stored: None,
        };
        state.give_up_culled()?;
        Ok(state)
    }

    /// Writes a checkpoint for a successor, where the journals have grown enough since the last
    /// one; to be called behind everything that others wait for.
    pub(crate) fn checkpoint_if_due(&mut self, context: &StageContext, index: u64) {
        let marks = Marks { align: self.journal.mark(), optimise: self.corrections.mark() };
        let bytes = marks.len_bytes();
        // A correction that is pending lies before the mark of the corrections.
        if self.pending.is_empty() && self.checkpoint.is_due(bytes) {
            self.checkpoint.write(&StateAt { marks, state: self.fold.snapshot() }, bytes);
            context.kill_points.pass("checkpointed", index);
        }
    }

    /// Appends the surface of a frame that becomes a keyframe to the store; the record gets its slot.
    pub(crate) fn store_keyframe(
        &mut self,
        record: &mut FrameRecord,
        surface: &[Vertex],
    ) -> Result<(), StageError> {
        let sync = self.fsync != Fsync::Never;
        let (bytes, vertices) = store_surface(self.grid, surface);
        let slot = self.store.append(&bytes, sync)?;
        if let Some(keyframe) = &mut record.change.new_keyframe {
            keyframe.slot = store_slot(&slot);
            self.stored = Some((bytes, vertices));
        }
        Ok(())
    }

    /// Journals a record and applies it: the commit point.
    pub(crate) fn commit(&mut self, record: AlignRecord) -> Result<(), StageError> {
        let is_plain = matches!(&record, AlignRecord::Frame(f) if f.change.new_keyframe.is_none())
            || matches!(record, AlignRecord::Skipped(..));
        let sync = match self.fsync {
            // `Auto` is none of a run.
            Fsync::Auto | Fsync::Never => false,
            Fsync::Keyframe => !is_plain,
            Fsync::Always => true,
        };
        self.journal.append(&record, sync)?;
        self.keyframes.take_unread(&record)?;
        if let Some((bytes, vertices)) = self.stored.take() {
            self.keyframes.hold_newest(vertices, &bytes)?;
        }
        self.keyframes.forget_unused(FORGET_AFTER_RECORDS);
        self.fold.apply(record);
        if is_plain { Ok(()) } else { self.give_up_culled() }
    }

    /// Gives up the surfaces of culled keyframes that are too many, oldest first: a function of the
    /// journal, done again by each successor. A request that is under way may need those that were
    /// active when it was made.
    fn give_up_culled(&mut self) -> Result<(), StageError> {
        let state = self.fold.tracker.state();
        if state.pending.is_some() {
            return Ok(());
        }
        for keyframe in self.given_up.more(&state.keyframes, self.culled_bytes) {
            self.store.give_up(&journal_slot(&keyframe.slot), self.fsync != Fsync::Never)?;
        }
        Ok(())
    }

    /// Takes the correction of `request`, if the optimiser has journaled it.
    pub(crate) fn take_correction(&mut self, request: u64) -> Result<Option<Correction>, StageError> {
        self.read_corrections()?;
        Ok(self.pending.remove(&request))
    }

    /// Takes the oldest correction that has not taken effect (live mode).
    pub(crate) fn take_oldest_correction(&mut self) -> Result<Option<Correction>, StageError> {
        self.read_corrections()?;
        Ok(self.pending.pop_first().map(|(_, correction)| correction))
    }

    /// Whether the correction of `request` has taken effect.
    pub(crate) fn is_applied(&self, request: u64) -> bool {
        self.fold.last_applied.is_some_and(|last| last >= request)
    }

    fn read_corrections(&mut self) -> Result<(), StageError> {
        while let Some(record) = self.corrections.next()? {
            let correction = record.into_correction();
            if !self.is_applied(correction.request) {
                self.pending.insert(correction.request, correction);
            }
        }
        Ok(())
    }
}
