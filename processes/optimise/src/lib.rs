//! The optimise stage: requests come in through the aligner's journal, corrections go out through
//! its own.
//!
//! A request's input is the aligner's journal up to the request and nothing else, so a solve that
//! was killed is done again to the same bits. It reads no bulk data from shared memory: keyframes
//! are mapped from the store. With `run.base_wait_s` the base of a fleet may answer in its place: what was
//! journaled counts, wherever it was computed.
#![forbid(unsafe_code)]

mod base_answers;
mod durable_state;
mod history;

use base_answers::{BaseAnswers, Waited};
use durable_state::JournaledOptimiser;
use history::JournaledFrames;
use std::process::ExitCode;
use tessera_messages::{Phase, Stage, WaitingOn};
use tessera_slam::{Correction, LoopVerdict, OptimiseRecord, RequestRecord};
use tessera_stage::{
    Checkpoint, IDLE, Outcome, Pulse, StageArgs, StageContext, StageError, monotonic_nanos, stage_main,
};

/// Runs the stage as a process.
pub fn main(args: &StageArgs) -> ExitCode {
    stage_main(Stage::Optimise, || run(args))
}

/// Each loop candidate with its tests, and how many went which way.
fn log_loops(correction: &Correction) {
    let mut n_by_verdict = [0_u32; 6];
    for pair in &correction.loops {
        let place = match pair.verdict {
            LoopVerdict::Accepted => 0,
            LoopVerdict::LittleOverlap => 1,
            LoopVerdict::FreeSpaceViolated => 2,
            LoopVerdict::Inconsistent => 3,
            LoopVerdict::Outvoted => 4,
            LoopVerdict::Contradicted => 5,
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
    let [closed, little_overlap, free_space_violated, inconsistent, rejected, contradicted] = n_by_verdict;
    tracing::info!(
        closed,
        little_overlap,
        free_space_violated,
        inconsistent,
        rejected,
        contradicted,
        "loop pairs"
    );
}

/// What was answered, and how long it took.
fn log_answer(request: &RequestRecord, record: &OptimiseRecord, nanos: u64) {
    tracing::info!(
        request = request.request,
        keyframes = request.n_keyframes,
        "answered{} in {:.1} ms",
        if record.is_from_base() { " by the base" } else { "" },
        nanos as f64 * 1e-6
    );
}

/// Waits for the answer of a base to a request; in vain at once for what the stage itself must answer.
fn wait_for_base(
    base: &mut BaseAnswers,
    context: &StageContext,
    state: &JournaledOptimiser,
    request: &RequestRecord,
    pulse: &mut Pulse,
    sleep: &mut dyn FnMut() -> Result<(), StageError>,
) -> Result<Waited, StageError> {
    let solves_for_camera = request.is_final && context.settings.mapping.global.refine_camera;
    if solves_for_camera || context.poison.contains(&request.request) {
        return Ok(Waited::InVain);
    }
    let history = JournaledFrames::new(&context.files);
    let waited = base.wait_for(request, &state.optimiser, &history, &mut || {
        pulse.waiting(WaitingOn::Base);
        sleep()?;
        Ok(!context.lifeline.is_cut())
    })?;
    history.check()?;
    pulse.working(request.request);
    Ok(waited)
}

/// The stage's own answer to a request.
fn solve(
    context: &StageContext,
    state: &mut JournaledOptimiser,
    request: &RequestRecord,
    pulse: &mut Pulse,
) -> Result<OptimiseRecord, StageError> {
    let history = JournaledFrames::new(&context.files);
    let answer = if context.poison.contains(&request.request) {
        tracing::warn!(request = request.request, "left out: it ended optimise again and again");
        state.optimiser.decline(request).map(|correction| OptimiseRecord::Correction(Box::new(correction)))
    } else {
        state.optimiser.solve(request, &state.keyframes, &history, &mut || {
            pulse.progress();
            context.kill_points.pass("solving", request.request);
        })
    };
    state.keyframes.check()?;
    state.keyframes.check_held()?;
    // Culled keyframes are not needed again.
    state.keyframes.forget_unused(1);
    history.check()?;
    answer.ok_or_else(|| StageError::Inconsistent(format!("request {} is not pending", request.request)))
}

/// Runs the stage until the run is finished or it is told to stop.
///
/// # Errors
/// Where the run directory, the settings or the shared memory cannot be used.
pub fn run(args: &StageArgs) -> Result<Outcome, StageError> {
    let context = StageContext::open(Stage::Optimise, args)?;
    let mut state = JournaledOptimiser::open(&context)?;
    let link = context.link(Stage::Optimise)?;
    let listener = link.listener(Stage::Optimise)?;
    let align = link.notifier(Stage::Align)?;
    let mut pulse = Pulse::start(&link, Stage::Optimise, &context)?;
    let mut base = BaseAnswers::open(&context)?;
    context.kill_points.pass("opened", 0);
    pulse.ready(None);
    // A correction that was journaled may not have been noticed.
    align.notify();
    let mut n_done = 0;
    loop {
        if context.lifeline.is_cut() {
            pulse.finish();
            return Ok(Outcome::Stopped);
        }
        let Some(request) = state.next_request()? else {
            if state.optimiser.is_done() {
                Checkpoint::remove(&context.files.optimise_checkpoint());
                pulse.finish();
                return Ok(Outcome::Finished);
            }
            // No request is pending: time for a checkpoint.
            if state.checkpoint_if_due() {
                context.kill_points.pass("checkpointed", state.optimiser.n_answered());
            }
            pulse.waiting(WaitingOn::Requests);
            listener.wait(IDLE)?;
            continue;
        };
        pulse.working(request.request);
        if !context.poison.contains(&request.request) {
            context.kill_points.pass("received", request.request);
        }
        let mut sleep = || Ok(listener.wait(IDLE).map(drop)?);
        let from_base = match &mut base {
            Some(base) => wait_for_base(base, &context, &state, &request, &mut pulse, &mut sleep)?,
            None => Waited::InVain,
        };
        let began = monotonic_nanos();
        let record = match from_base {
            Waited::Stopped => continue,
            Waited::Answered(record) => *record,
            Waited::InVain => solve(&context, &mut state, &request, &mut pulse)?,
        };
        let solved = monotonic_nanos();
        pulse.phase(Phase::Computing, solved.saturating_sub(began));
        log_loops(record.correction());
        state.commit(&record)?;
        context.kill_points.pass("journaled", request.request);
        align.notify();
        let now = monotonic_nanos();
        pulse.phase(Phase::Publishing, now.saturating_sub(solved));
        pulse.done(began, now);
        log_answer(&request, &record, now.saturating_sub(began));
        n_done += 1;
        if context.settings.run.forget_every > 0 && n_done % context.settings.run.forget_every == 0 {
            drop(state);
            state = JournaledOptimiser::open(&context)?;
        }
    }
}
