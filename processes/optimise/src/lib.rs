//! The optimise stage: requests come in through the aligner's journal, corrections go out through
//! its own.
//!
//! A request's input is the aligner's journal up to the request and nothing else, so a solve that
//! was killed is done again to the same bits. It reads no bulk data from shared memory: keyframes
//! are mapped from the store.
#![forbid(unsafe_code)]

use std::process::ExitCode;
use std::time::Duration;
use tessera_journal::{Follower, Journal};
use tessera_mapping::{AlignRecord, Correction, LoopVerdict, OptimiseRecord, Optimiser, RequestRecord};
use tessera_messages::{Phase, Stage, WaitingOn};
use tessera_settings::Fsync;
use tessera_stage::{
    ALIGN_JOURNAL, Context, IDLE, MappedKeyframes, OPTIMISE_JOURNAL, Outcome, Pulse, StageArgs, StageError,
    monotonic_nanos, stage_main,
};

/// How long a predecessor may take to die before its lock is an error.
const PATIENCE: Duration = Duration::from_secs(2);

/// Runs the stage as a process.
pub fn main(args: &StageArgs) -> ExitCode {
    stage_main(Stage::Optimise, || run(args))
}

/// Everything that the optimiser knows; it can be thrown away and read back at any time.
struct Desk {
    optimiser: Optimiser,
    keyframes: MappedKeyframes,
    records: Follower<AlignRecord>,
    journal: Journal<OptimiseRecord>,
}

impl Desk {
    fn open(context: &Context) -> Result<Self, StageError> {
        let files = &context.files;
        let mut optimiser = Optimiser::new(context.mapping_context());
        let (journal, recovered) = Journal::open(
            &files.optimise_journal(),
            OPTIMISE_JOURNAL,
            PATIENCE,
            |record: OptimiseRecord| {
                optimiser.apply_own(&record);
                Ok(())
            },
        )?;
        if let Some(reason) = &recovered.reason {
            tracing::warn!(
                "the journal of optimise ends after {} records, {} bytes behind them are dropped: {reason}",
                recovered.n_records,
                recovered.dropped_bytes
            );
        }
        Ok(Self {
            optimiser,
            keyframes: MappedKeyframes::open(&files.store(), context.layout.grid.len())?,
            records: Follower::open(&files.align_journal(), ALIGN_JOURNAL)?,
            journal,
        })
    }

    /// Reads on in the aligner's journal, up to the next request and no further.
    fn next_request(&mut self) -> Result<Option<RequestRecord>, StageError> {
        loop {
            if let Some(request) = self.optimiser.next_request() {
                return Ok(Some(request));
            }
            let Some(record) = self.records.next()? else { return Ok(None) };
            self.keyframes.take(&record)?;
            self.optimiser.apply(&record);
        }
    }
}

/// Each loop candidate with its tests, and how many went which way.
fn log_loops(correction: &Correction) {
    let mut n_by_verdict = [0_u32; 5];
    for pair in &correction.loops {
        let place = match pair.verdict {
            LoopVerdict::Accepted => 0,
            LoopVerdict::LittleOverlap => 1,
            LoopVerdict::FreeSpaceViolated => 2,
            LoopVerdict::Inconsistent => 3,
            LoopVerdict::Outvoted => 4,
        };
        n_by_verdict[place] += 1;
        tracing::debug!(
            newer = pair.newer,
            older = pair.older,
            overlap = pair.overlap,
            in_front = pair.in_front,
            inconsistency_sigmas = pair.inconsistency_sigmas,
            residual_sigmas = pair.residual_sigmas,
            weight = pair.weight,
            "loop {:?}",
            pair.verdict
        );
    }
    let [accepted, little_overlap, free_space_violated, inconsistent, outvoted] = n_by_verdict;
    tracing::info!(accepted, little_overlap, free_space_violated, inconsistent, outvoted, "loop pairs");
}

/// Runs the stage until the run is finished or it is told to stop.
///
/// # Errors
/// Where the run directory, the settings or the shared memory cannot be used.
pub fn run(args: &StageArgs) -> Result<Outcome, StageError> {
    let context = Context::open(Stage::Optimise, args)?;
    let mut desk = Desk::open(&context)?;
    let link = context.link(Stage::Optimise)?;
    let ear = link.ear(Stage::Optimise)?;
    let align = link.bell(Stage::Align)?;
    let mut pulse = Pulse::start(&link, Stage::Optimise, &context.stopwatch)?;
    context.kill_points.pass("opened", 0);
    pulse.ready(None);
    // A correction that was journaled may not have been noticed.
    align.ring();
    let mut n_done = 0;
    loop {
        if context.lifeline.is_cut() {
            pulse.finish();
            return Ok(Outcome::Stopped);
        }
        let Some(request) = desk.next_request()? else {
            if desk.optimiser.is_done() {
                pulse.finish();
                return Ok(Outcome::Finished);
            }
            pulse.waiting(WaitingOn::Requests);
            ear.wait(IDLE)?;
            continue;
        };
        pulse.working(request.request);
        context.kill_points.pass("received", request.request);
        let began = monotonic_nanos();
        let correction = desk.optimiser.solve(&request, &desk.keyframes, &mut || {
            pulse.progress();
            context.kill_points.pass("solving", request.request);
        });
        let Some(correction) = correction else {
            return Err(StageError::Inconsistent(format!("request {} is not pending", request.request)));
        };
        let solved = monotonic_nanos();
        pulse.phase(Phase::Computing, solved.saturating_sub(began));
        log_loops(&correction);
        let record = OptimiseRecord::Correction(Box::new(correction));
        desk.journal.append(&record, context.settings.flow.fsync != Fsync::Never)?;
        context.kill_points.pass("journaled", request.request);
        desk.optimiser.apply_own(&record);
        align.ring();
        let now = monotonic_nanos();
        pulse.phase(Phase::Publishing, now.saturating_sub(solved));
        let nanos = now.saturating_sub(began);
        pulse.done(began, now);
        tracing::info!(
            request = request.request,
            keyframes = request.n_keyframes,
            "answered in {:.1} ms",
            nanos as f64 * 1e-6
        );
        n_done += 1;
        if context.settings.run.forget_every > 0 && n_done % context.settings.run.forget_every == 0 {
            drop(desk);
            desk = Desk::open(&context)?;
        }
    }
}
