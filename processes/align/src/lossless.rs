//! Every frame exactly once and in order; corrections take effect before the frame fixed for them.

use crate::Pause;
use crate::correction::{apply_correction, finish};
use crate::durable_state::JournaledAligner;
use crate::inbox::SeenSurfaces;
use crate::ports::Ports;
use crate::step::{Acknowledge, MissingSurface, Policy, process_frame};
use tessera_messages::WaitingOn;
use tessera_stage::{Outcome, StageContext, StageError, monotonic_nanos};

/// How long a restarted aligner waits for the history: an idle writer gives it within 10 ms.
const HISTORY_NANOS: u64 = 30_000_000;

const POLICY: Policy = Policy {
    skips_poison: false,
    missing_surface: MissingSurface::Fail,
    acknowledge: Acknowledge::RecentSurfaces,
};

/// Runs until the run is finished, the stage is told to stop, or the state is to be read back.
pub(crate) fn run(
    context: &StageContext,
    state: &mut JournaledAligner,
    ports: &mut Ports,
) -> Result<Pause, StageError> {
    let forget_every = context.settings.run.forget_every;
    let mut n_done = 0;
    let next = state.fold.tracker.next_index();
    let first = state.fold.tracker.first_recent_index().min(next);
    match await_history(context, ports, first, next)? {
        Some((epoch, seen)) => ports.adopt_epoch(epoch, next, &seen)?,
        None => ports.begin_epoch(ports.inbox.first_missing(first, next))?,
    }
    // A request that was journaled may not have been noticed.
    ports.notify_optimiser();
    loop {
        if context.lifeline.is_cut() {
            return Ok(Pause::Over(Outcome::Stopped));
        }
        if let Some(end) = state.fold.end {
            match finish(state, ports, end)? {
                true => return Ok(Pause::Over(Outcome::Finished)),
                false => continue,
            }
        }
        let next = state.fold.tracker.next_index();
        if let Some(request) = state.fold.tracker.correction_due(next) {
            if !apply_correction(state, ports, request, next)? {
                ports.wait(WaitingOn::Correction)?;
                ports.control.was_busy(monotonic_nanos());
            }
            continue;
        }
        if !receive(context, state, ports, next)? {
            continue;
        }
        process_frame(context, &POLICY, state, ports, next)?;
        state.checkpoint_if_due(context, next);
        n_done += 1;
        if forget_every > 0 && n_done >= forget_every && state.fold.end.is_none() {
            return Ok(Pause::Forget);
        }
    }
}

/// What a predecessor had under way comes again by the history of the living writer: then nothing
/// need be read and computed again. Answers the epoch to go on in, and what was received; `None`
/// where recent surfaces stay away.
fn await_history(
    context: &StageContext,
    ports: &mut Ports,
    first: u64,
    next: u64,
) -> Result<Option<(u64, SeenSurfaces)>, StageError> {
    let limit = next.saturating_add(2 * u64::from(context.layout.window) + 1);
    let began = monotonic_nanos();
    let mut seen = SeenSurfaces::new();
    // At the run's first frame, and to a reader that was here before, no history comes.
    while std::mem::take(&mut ports.is_fresh) && first < next {
        seen.extend(ports.inbox.fill(first, Some(limit), &mut ports.pulse)?);
        // An epoch is a time: one that lies ahead is nonsense.
        let epoch = seen.iter().map(|(_, epoch)| *epoch).filter(|epoch| *epoch < began).max();
        if ports.inbox.first_missing(first, next) == next {
            return Ok(epoch.map(|epoch| (epoch, seen)));
        }
        if monotonic_nanos().saturating_sub(began) < HISTORY_NANOS {
            ports.is_fresh = true;
            ports.wait(WaitingOn::Surfaces)?;
        }
    }
    Ok(None)
}

/// Whether the next surface and all recent ones are here; asks for what is missing.
fn receive(
    context: &StageContext,
    state: &JournaledAligner,
    ports: &mut Ports,
    next: u64,
) -> Result<bool, StageError> {
    let first = state.fold.tracker.first_recent_index().min(next);
    ports.inbox.release_below(first);
    let window = u64::from(context.layout.window);
    let limit = next.saturating_add(2 * window + 1);
    let seen = ports.inbox.fill(first, Some(limit), &mut ports.pulse)?;
    let now = monotonic_nanos();
    if ports.control.acknowledge(ports.inbox.first_missing(first, next), now) {
        ports.notify_sensor()?;
    }
    for (index, epoch) in seen {
        ports.control.saw(index, epoch, now);
    }
    if ports.inbox.first_missing(first, next + 1) > next {
        return Ok(true);
    }
    if ports.control.waited(now) {
        tracing::info!(frame = next, "asking again from frame {}", ports.control.flow().resend_from);
        ports.notify_sensor()?;
    }
    ports.wait(WaitingOn::Surfaces)?;
    Ok(false)
}
