//! Frames at the camera's own rate: the newest wins, the others are journaled as skipped.

use crate::Pause;
use crate::correction::{apply_oldest_correction, finish};
use crate::durable_state::JournaledAligner;
use crate::load_shedding::{FramePace, LoadShedding};
use crate::ports::Ports;
use crate::step::{Acknowledge, MissingSurface, Policy, process_frame};
use std::time::Duration;
use tessera_messages::WaitingOn;
use tessera_stage::{AwakeDeadline, Outcome, StageContext, StageError};
use tessera_surface::WorkloadLevel;

const POLICY: Policy =
    Policy { skips_poison: true, missing_surface: MissingSurface::Postpone, acknowledge: Acknowledge::Frame };

/// How long a successor waits for the frame whose pose was sent before its record was journaled: an idle writer
/// gives it within 10 ms, on a busy machine later.
const POSED: Duration = Duration::from_millis(300);

/// Runs until the run is finished, the stage is told to stop, or the state is to be read back.
pub(crate) fn run(
    context: &StageContext,
    state: &mut JournaledAligner,
    ports: &mut Ports,
) -> Result<Pause, StageError> {
    let forget_every = context.settings.run.forget_every;
    let mut n_done = 0;
    let mut shedding = LoadShedding::begin(
        state.fold.last_frame.as_ref().map_or(WorkloadLevel::Full, |frame| frame.workload),
    );
    ports.begin_epoch(state.fold.tracker.next_index())?;
    set_workload(&shedding, ports)?;
    // Before its first frame it waits for others to start.
    let mut has_waited = true;
    ports.notify_optimiser();
    let mut posed = await_posed(state, ports)?;
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
        if posed.is_none() && apply_oldest_correction(state, ports, next)? {
            continue;
        }
        let first = state.fold.tracker.first_recent_index().min(next);
        ports.inbox.release_below(first);
        ports.inbox.fill(first, None, &mut ports.pulse)?;
        let Some(index) = posed.take().or_else(|| ports.inbox.newest(next)) else {
            ports.wait(WaitingOn::Surfaces)?;
            has_waited = true;
            continue;
        };
        let pace = FramePace { n_left_out: index - next, has_waited: std::mem::take(&mut has_waited) };
        let before = shedding.workload();
        if context.settings.flow.load_shedding && shedding.note(&pace) {
            log_workload(before, shedding.workload(), index);
            set_workload(&shedding, ports)?;
        }
        process_frame(context, &POLICY, state, ports, index)?;
        state.checkpoint_if_due(context, index);
        n_done += 1;
        if forget_every > 0 && n_done >= forget_every && state.fold.end.is_none() {
            return Ok(Pause::Forget);
        }
    }
}

/// Waits for the frame whose pose a predecessor had sent; `None`: there is none, or newer ones alone are left.
fn await_posed(state: &JournaledAligner, ports: &mut Ports) -> Result<Option<u64>, StageError> {
    let next = state.fold.tracker.next_index();
    let Some(posed) = state.posed.due(next) else { return Ok(None) };
    let (first, mut wait) = (state.fold.tracker.first_recent_index().min(next), AwakeDeadline::after(POSED));
    loop {
        ports.inbox.fill(first, None, &mut ports.pulse)?;
        if ports.inbox.newest(posed).is_some() || wait.is_over() {
            return Ok(ports.inbox.get(posed).map(|_| posed));
        }
        ports.wait(WaitingOn::Surfaces)?;
    }
}

/// Publishes the workload of the frames from now on, in the flow and in the pulse.
fn set_workload(shedding: &LoadShedding, ports: &mut Ports) -> Result<(), StageError> {
    ports.control.set_workload(shedding.workload());
    ports.pulse.beat.workload = shedding.workload().level() as u64;
    ports.notify_sensor()
}

fn log_workload(before: WorkloadLevel, now: WorkloadLevel, frame: u64) {
    let (level, last) = (now.level(), WorkloadLevel::Least.level());
    if now > before {
        tracing::warn!(frame, "workload is lowered to level {level} of {last}: {}", now.describe());
    } else {
        tracing::info!(frame, "workload is raised to level {level} of {last}: {}", now.describe());
    }
}
