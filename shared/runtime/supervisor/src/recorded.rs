//! Opening the journals and the store of a run before any stage does: new ones are made, those of a run
//! that goes on are read whole. What is damaged is refused, or set aside where that was asked for.

use crate::failure::SupervisorError;
use crate::failure::directory;
use crate::plan::Plan;
use std::path::Path;
use std::time::Duration;
use tessera_journal::{Journal, JournalError, OnDamage, Opening, Recovered, Store, set_aside};
use tessera_slam::{AlignRecord, OptimiseRecord};
use tessera_stage::{ALIGN_JOURNAL, OPTIMISE_JOURNAL, RunFiles, StageError, StoredKeyframes};
use tessera_transport::Layout;

/// How long stages of an earlier supervisor may take to end.
pub(crate) const PATIENCE: Duration = Duration::from_secs(1);

/// Bytes of a store without a surface, at most.
const HEAD_BYTES: u64 = 4096;

/// The aligner's journal and the store, locked.
pub(crate) struct OpenedFiles {
    pub(crate) store: Store,
    pub(crate) journal: Journal<AlignRecord>,
    pub(crate) n_records: u64,
}

/// The run whose files are opened.
pub(crate) struct Opener<'p> {
    plan: &'p Plan,
    files: &'p RunFiles,
    /// The run began before.
    is_begun: bool,
}

impl<'p> Opener<'p> {
    pub(crate) fn new(plan: &'p Plan, files: &'p RunFiles, is_begun: bool) -> Self {
        Self { plan, files, is_begun }
    }

    fn opening(&self) -> Opening<'static> {
        let on_damage = if self.plan.drop_damaged { OnDamage::SetAside } else { OnDamage::Refuse };
        Opening { mark: None, wait: PATIENCE, on_damage, is_begun: self.is_begun }
    }

    /// Opens the aligner's journal and the store. Each surface that a record names is read.
    pub(crate) fn open_aligned(&self, layout: &Layout) -> Result<OpenedFiles, SupervisorError> {
        let (store_path, path) = (self.files.store(), self.files.align_journal());
        let store = self.open_store(&store_path)?;
        let mut keyframes =
            StoredKeyframes::open(&store_path, layout.grid).map_err(|e| directory("map", &store_path, &e))?;
        let mut next_frame = 0;
        let take = |record: AlignRecord| {
            keyframes.take(&record).map_err(|e| e.to_string())?;
            next_frame = record.next_index().unwrap_or(next_frame);
            Ok(())
        };
        let (journal, recovered) = Journal::open_as(&path, ALIGN_JOURNAL, self.opening(), take)
            .map_err(|error| self.failure(&path, error, Some(next_frame)))?;
        let is_cut = recovered.set_aside.is_some() || recovered.n_records == 0;
        let holds_surfaces = || std::fs::metadata(&store_path).is_ok_and(|meta| meta.len() > HEAD_BYTES);
        if self.is_begun && is_cut && holds_surfaces() {
            // The next keyframes are written over the surfaces that the cut records named.
            let copy = set_aside(&store_path).map_err(|error| self.failure(&store_path, error, None))?;
            tracing::warn!("{} was copied to {}", store_path.display(), copy.display());
        }
        log_dropped(&path, &recovered);
        Ok(OpenedFiles { store, journal, n_records: recovered.n_records })
    }

    /// Opens the optimiser's journal, once.
    pub(crate) fn open_optimised(&self) -> Result<Journal<OptimiseRecord>, SupervisorError> {
        let path = self.files.optimise_journal();
        let take = |_: OptimiseRecord| Ok(());
        let (journal, recovered) = Journal::open_as(&path, OPTIMISE_JOURNAL, self.opening(), take)
            .map_err(|error| self.failure(&path, error, None))?;
        log_dropped(&path, &recovered);
        Ok(journal)
    }

    fn open_store(&self, path: &Path) -> Result<Store, SupervisorError> {
        let open = if self.is_begun { Store::open_begun } else { Store::open };
        let wrong = |error| self.failure(path, error, None);
        match open(path, PATIENCE) {
            Err(JournalError::Absent { .. }) if self.plan.drop_damaged => {
                tracing::warn!("{} is not there: a new one is begun", path.display());
            }
            Err(JournalError::Slot { .. } | JournalError::Foreign { .. }) if self.plan.drop_damaged => {
                let copy = set_aside(path).map_err(wrong)?;
                tracing::warn!("{} has lost its head: it was copied to {}", path.display(), copy.display());
                std::fs::File::create(path).map_err(|e| directory("empty", path, &e))?;
            }
            opened => return opened.map_err(wrong),
        }
        Store::open(path, PATIENCE).map_err(wrong)
    }

    /// Damage with its cure; of any other error what cannot be done.
    fn failure(&self, path: &Path, error: JournalError, next_frame: Option<u64>) -> SupervisorError {
        let is_damage = matches!(
            error,
            JournalError::Absent { .. }
                | JournalError::Damaged { .. }
                | JournalError::Slot { .. }
                | JournalError::Foreign { .. }
        );
        if is_damage && self.is_begun {
            let (run, is_live) = (self.plan.run_dir.clone(), self.plan.settings.run.live);
            let error = Box::new(error);
            return SupervisorError::Damaged { error, run, next_frame, is_live };
        }
        match error {
            error @ JournalError::Version { .. } => SupervisorError::Stage(StageError::Journal(error)),
            error => directory("prepare", path, &error),
        }
    }
}

/// Logs what was dropped of a journal.
fn log_dropped(path: &Path, recovered: &Recovered) {
    let Some(reason) = &recovered.reason else { return };
    let Recovered { n_records, dropped_bytes, set_aside, .. } = recovered;
    let copy = set_aside
        .as_ref()
        .map_or(String::new(), |copy| format!("; the file as it was is {}", copy.display()));
    tracing::warn!(
        "{} ends after {n_records} records, {dropped_bytes} bytes behind them are dropped: {reason}{copy}",
        path.display()
    );
}
