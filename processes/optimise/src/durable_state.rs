//! The optimiser's durable state: a fold over both journals, and the files behind it.

use std::time::Duration;
use tessera_journal::{Follower, Journal, Opening};
use tessera_settings::Fsync;
use tessera_slam::{AlignRecord, OptimiseRecord, Optimiser, OptimiserState, RequestRecord};
use tessera_stage::{
    ALIGN_JOURNAL, Checkpoint, Marks, OPTIMISE_JOURNAL, StageContext, StageError, StateAt, StoredKeyframes,
};

/// How long a predecessor may take to die before its lock is an error.
const PATIENCE: Duration = Duration::from_secs(2);

/// The optimiser's whole state; it can be thrown away and read back from disk at any time.
pub(crate) struct JournaledOptimiser {
    pub(crate) optimiser: Optimiser,
    pub(crate) keyframes: StoredKeyframes,
    records: Follower<AlignRecord>,
    journal: Journal<OptimiseRecord>,
    fsync: Fsync,
    checkpoint: Checkpoint,
}

impl JournaledOptimiser {
    /// Reads the state back from the run directory; locks the journal.
    pub(crate) fn open(context: &StageContext) -> Result<Self, StageError> {
        let (files, flow) = (&context.files, &context.settings.flow);
        let mut checkpoint =
            Checkpoint::new(&files.optimise_checkpoint(), OPTIMISE_JOURNAL.name, flow.checkpoint_kb);
        let kept = checkpoint.read::<StateAt<OptimiserState<'static>>>();
        let (marks, mut optimiser) = match kept.filter(|kept| kept.marks.fits(files)) {
            Some(kept) => (Some(kept.marks), Optimiser::restore(context.mapping_context(), kept.state)),
            None => (None, Optimiser::new(context.mapping_context())),
        };
        let mut keyframes = StoredKeyframes::open(&files.store(), context.layout.grid)?;
        for keyframe in &optimiser.state().keyframes {
            keyframes.add_unread(keyframe.id, &keyframe.slot)?;
        }
        let mark = marks.as_ref().map(|marks| &marks.optimise);
        let (journal, recovered) = Journal::open_as(
            &files.optimise_journal(),
            OPTIMISE_JOURNAL,
            Opening { mark, is_begun: true, ..Opening::new(PATIENCE) },
            |record: OptimiseRecord| {
                optimiser.apply_own(&record);
                Ok(())
            },
        )?;
        if let Some(marks) = &marks {
            tracing::info!("a checkpoint spares {} records", marks.align.n_records);
        }
        if let Some(reason) = &recovered.reason {
            tracing::warn!(
                "the journal of optimise ends after {} records, {} bytes behind them are dropped: {reason}",
                recovered.n_records,
                recovered.dropped_bytes
            );
        }
        let records = Follower::open_behind(
            &files.align_journal(),
            ALIGN_JOURNAL,
            marks.as_ref().map(|marks| &marks.align),
        )?;
        checkpoint.stands_at(marks.map_or(0, |marks| marks.len_bytes()));
        let fsync = flow.fsync.of_run(context.settings.run.live);
        Ok(Self { optimiser, keyframes, records, journal, fsync, checkpoint })
    }

    /// Reads on in the aligner's journal, up to the next request and no further.
    pub(crate) fn next_request(&mut self) -> Result<Option<RequestRecord>, StageError> {
        loop {
            if let Some(request) = self.optimiser.next_request() {
                return Ok(Some(request));
            }
            let Some(record) = self.records.next()? else { return Ok(None) };
            self.keyframes.take_unread(&record)?;
            self.optimiser.apply(&record);
        }
    }

    /// Journals a correction and applies it here.
    pub(crate) fn commit(&mut self, record: &OptimiseRecord) -> Result<(), StageError> {
        self.journal.append(record, self.fsync != Fsync::Never)?;
        self.optimiser.apply_own(record);
        Ok(())
    }

    /// Writes a checkpoint for a successor, where the journals have grown enough since the last
    /// one; `true` where it did.
    pub(crate) fn checkpoint_if_due(&mut self) -> bool {
        let marks = Marks { align: self.records.mark(), optimise: self.journal.mark() };
        let bytes = marks.len_bytes();
        let is_due = self.checkpoint.is_due(bytes);
        let snapshot = if is_due { self.optimiser.snapshot() } else { None };
        let Some(state) = snapshot else { return false };
        self.checkpoint.write(&StateAt { marks, state }, bytes);
        true
    }
}
