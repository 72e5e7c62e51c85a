//! Frames at the camera's own rate: the newest wins, what is left out is written down.

use crate::Pause;
use crate::desk::Desk;
use crate::ladder::{Ladder, Pace};
use crate::lossless::{finish, keep, probe};
use crate::ports::Ports;
use tessera_mapping::AlignRecord;
use tessera_messages::{Kind, Phase, WaitingOn};
use tessera_stage::{Context, Outcome, StageError, monotonic_nanos};
use tessera_steps::Step;
use tessera_surface::Effort;

/// Works until the run is finished, the stage is told to stop, or it is time to forget.
pub(crate) fn work(context: &Context, desk: &mut Desk, ports: &mut Ports) -> Result<Pause, StageError> {
    let forget_every = context.settings.run.forget_every;
    let mut n_done = 0;
    let mut ladder = Ladder::begin(desk.known.last_frame.as_ref().map_or(Effort::Full, |frame| frame.effort));
    ports.begin_epoch(desk.known.tracker.next_index())?;
    set_effort(&ladder, ports)?;
    // Before its first frame it waits for others to start.
    let mut has_waited = true;
    ports.tell_optimiser();
    loop {
        if context.lifeline.is_cut() {
            return Ok(Pause::Over(Outcome::Stopped));
        }
        if let Some(end) = desk.known.end {
            match finish(desk, ports, end)? {
                true => return Ok(Pause::Over(Outcome::Finished)),
                false => continue,
            }
        }
        let next = desk.known.tracker.next_index();
        if let Some(correction) = desk.any_answer()? {
            let request = correction.request;
            match desk.known.tracker.correction_record(correction, next) {
                Some(record) => desk.commit(&record)?,
                None => tracing::warn!(request, "a correction of other keyframes is dropped"),
            }
            ports.pulse.progress();
            continue;
        }
        let first = desk.known.tracker.first_recent_index().min(next);
        ports.inbox.let_go_below(first);
        ports.inbox.fill(first, None, &mut ports.pulse)?;
        let Some(index) = ports.inbox.newest().map(|s| s.header.index).filter(|&index| index >= next) else {
            ports.wait(WaitingOn::Surfaces)?;
            has_waited = true;
            continue;
        };
        let pace = Pace { n_left_out: index - next, has_waited: std::mem::take(&mut has_waited) };
        let before = ladder.effort();
        if context.settings.flow.ladder && ladder.note(&pace) {
            say(before, ladder.effort(), index);
            set_effort(&ladder, ports)?;
        }
        step(context, desk, ports, next, index)?;
        keep(context, desk, index);
        n_done += 1;
        if forget_every > 0 && n_done >= forget_every && desk.known.end.is_none() {
            return Ok(Pause::Forget);
        }
    }
}

/// Tells whoever makes surfaces, and whoever looks, how much work a frame gets from now on.
fn set_effort(ladder: &Ladder, ports: &mut Ports) -> Result<(), StageError> {
    ports.control.set_effort(ladder.effort());
    ports.pulse.beat.effort = ladder.effort().rung() as u64;
    ports.tell_sensor()
}

fn say(before: Effort, now: Effort, frame: u64) {
    let (rung, last) = (now.rung(), Effort::Least.rung());
    if now > before {
        tracing::warn!(frame, "effort is lowered to rung {rung} of {last}: {}", now.describe());
    } else {
        tracing::info!(frame, "effort is raised to rung {rung} of {last}: {}", now.describe());
    }
}

/// One frame, and a record for each that was left out before it.
fn step(
    context: &Context,
    desk: &mut Desk,
    ports: &mut Ports,
    next: u64,
    index: u64,
) -> Result<(), StageError> {
    ports.pulse.working(index);
    let began = monotonic_nanos();
    let Some(surface) = ports.inbox.get(index) else { return Ok(()) };
    if !context.poison.contains(&index) {
        context.kill_points.pass("received", index);
    }
    let upstream = surface.header.dropped_before;
    let (kind, mut times) = (surface.header.kind, surface.header.times);
    times.align_began = began;
    ports.pulse.phase(Phase::Transport, began.saturating_sub(times.surface_sent));
    for skipped in next..index {
        let here = skipped - next >= upstream;
        let reason = if here { "newer frames had come" } else { "left out before alignment" };
        desk.commit(&AlignRecord::Skipped(skipped, reason.to_string()))?;
        ports.pulse.beat.dropped += u64::from(here);
    }
    let Some(surface) = ports.inbox.get(index) else { return Ok(()) };
    if kind == Kind::End.to_wire() {
        let request = desk.known.tracker.final_request();
        desk.commit(&AlignRecord::End { n_frames: index, request })?;
        context.kill_points.pass("ended", index);
        ports.tell_optimiser();
        return Ok(());
    }
    if context.poison.contains(&index) {
        tracing::warn!(frame = index, "lost: it ended align again and again");
        desk.commit(&AlignRecord::Skipped(index, "it ended align again and again".to_string()))?;
        ports.pulse.beat.lost += 1;
        return Ok(());
    }
    let first = desk.known.tracker.first_recent_index();
    let recent = ports.inbox.recent(first, index);
    probe(context, desk, surface, &recent);
    let mut record = desk.known.tracker.align(&surface.view(ports.inbox.grid), &recent, &desk.keyframes);
    desk.keyframes.check()?;
    let computed = monotonic_nanos();
    ports.pulse.phase(Phase::Computing, computed.saturating_sub(began));
    context.kill_points.pass("computed", index);
    let steps = ports.pulse.steps();
    steps.enter(Step::Store);
    if let Some(keyframe) = &record.new_keyframe {
        match ports.inbox.get(keyframe.frame_index) {
            Some(kept) => desk.store_keyframe(&mut record, kept.vertices())?,
            // Lost with a predecessor: the next frame will make one.
            None => record.new_keyframe = None,
        }
    }
    let matters = record.new_keyframe.is_some() || record.request.is_some();
    let record = AlignRecord::Frame(Box::new(record));
    steps.enter(Step::Journal);
    desk.commit(&record)?;
    context.kill_points.pass("journaled", index);
    steps.enter(Step::Send);
    if let AlignRecord::Frame(frame) = &record {
        ports.publish(frame, times)?;
    }
    let now = monotonic_nanos();
    if ports.control.acknowledge(index + 1, now) {
        ports.tell_sensor()?;
    }
    if matters {
        ports.tell_optimiser();
    }
    ports.pulse.beat.keyframes = desk.keyframes.len() as u64;
    ports.pulse.beat.loops = desk.known.n_loops;
    steps.leave();
    let now = monotonic_nanos();
    ports.pulse.phase(Phase::Publishing, now.saturating_sub(computed));
    ports.pulse.done(began, now);
    Ok(())
}
