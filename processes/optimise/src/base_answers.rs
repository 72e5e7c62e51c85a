//! Answers of the base of a fleet, which an uplink puts into the run directory (docs/fleet.md): how long
//! they are waited for, and which are used.

use std::os::unix::fs::MetadataExt;
use tessera_slam::{FrameHistory, OptimiseRecord, Optimiser, RequestRecord};
use tessera_stage::{
    BaseAnswer, BaseContact, RunFiles, StageContext, StageError, identity_of, monotonic_nanos,
};

/// What came of waiting.
pub(crate) enum Waited {
    /// The base answered.
    Answered(Box<OptimiseRecord>),
    /// It is away, or it did not answer in time: the stage answers itself.
    InVain,
    /// The stage is told to stop.
    Stopped,
}

/// The answers of a base as they come.
pub(crate) struct BaseAnswers {
    files: RunFiles,
    identity: u64,
    wait_nanos: u64,
    /// Which file was looked at last.
    seen: Option<[u64; 3]>,
    /// Beginning of the contact in which an answer stayed away. Until another one begins, or an answer
    /// comes late, none is waited for.
    unanswered_since: Option<u64>,
    n_refused: u64,
}

impl BaseAnswers {
    /// The answers to the requests of a run; `None` where the run asks no base.
    ///
    /// # Errors
    /// Where `run.json` cannot be read.
    pub(crate) fn open(context: &StageContext) -> Result<Option<Self>, StageError> {
        let wait_s = context.settings.run.base_wait_s;
        if wait_s <= 0.0 {
            return Ok(None);
        }
        let (files, path) = (context.files.clone(), context.files.run_file());
        let bytes = std::fs::read(&path)
            .map_err(|error| StageError::RunFile { path, problem: format!("cannot read: {error}") })?;
        let wait_nanos = (wait_s * 1e9) as u64;
        let identity = identity_of(&bytes);
        Ok(Some(Self { files, identity, wait_nanos, seen: None, unanswered_since: None, n_refused: 0 }))
    }

    /// Waits for the answer to a pending request while the base is in contact, and no longer than the
    /// settings say. `idle` sleeps a moment and answers whether to go on.
    ///
    /// # Errors
    /// Those of `idle`.
    pub(crate) fn wait_for(
        &mut self,
        request: &RequestRecord,
        optimiser: &Optimiser,
        history: &dyn FrameHistory,
        idle: &mut dyn FnMut() -> Result<bool, StageError>,
    ) -> Result<Waited, StageError> {
        let began = monotonic_nanos();
        loop {
            if let Some(record) = self.look(request, optimiser, history) {
                return Ok(Waited::Answered(Box::new(record)));
            }
            let Some(contact) = BaseContact::read(&self.files) else { return Ok(Waited::InVain) };
            if self.unanswered_since == Some(contact.since_nanos) {
                return Ok(Waited::InVain);
            }
            let waited = monotonic_nanos().saturating_sub(began);
            if waited >= self.wait_nanos {
                let request = request.request;
                tracing::warn!(request, "no answer of the base within {:.1} s", waited as f64 * 1e-9);
                self.unanswered_since = Some(contact.since_nanos);
                return Ok(Waited::InVain);
            }
            if !idle()? {
                return Ok(Waited::Stopped);
            }
        }
    }

    /// The answer to the request, where it has come and can be used. Each file is looked at once.
    fn look(
        &mut self,
        request: &RequestRecord,
        optimiser: &Optimiser,
        history: &dyn FrameHistory,
    ) -> Option<OptimiseRecord> {
        let found = std::fs::metadata(self.files.base_answer()).ok()?;
        // A file that is replaced is another one.
        let stamp = [found.ino(), found.mtime() as u64, found.mtime_nsec() as u64];
        if self.seen.replace(stamp) == Some(stamp) {
            return None;
        }
        let answer = BaseAnswer::read(&self.files)
            .and_then(|bytes| BaseAnswer::from_bytes(&bytes.unwrap_or_default(), self.identity));
        let used = match answer {
            Ok(answer) if answer.correction.request < request.request => {
                tracing::info!(request = answer.correction.request, "the base answered too late");
                self.unanswered_since = None;
                return None;
            }
            Ok(answer) => optimiser.accept(request, (answer.correction, answer.changes), history),
            Err(problem) => Err(problem),
        };
        match used {
            Ok(record) => {
                self.unanswered_since = None;
                Some(record)
            }
            Err(problem) => {
                self.n_refused += 1;
                tracing::warn!(
                    request = request.request,
                    n_refused = self.n_refused,
                    "an answer of the base is refused: {problem}"
                );
                None
            }
        }
    }
}
