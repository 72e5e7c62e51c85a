//! Every frame exactly once and in order; corrections take effect before the frame fixed for them.

use crate::Pause;
use crate::desk::Desk;
use crate::inbox::{Seen, Surface};
use crate::known::End;
use crate::ports::Ports;
use tessera_mapping::{AlignRecord, FrameSurface, KeyframeSurfaces};
use tessera_messages::{Kind, Phase, WaitingOn};
use tessera_stage::{Context, Outcome, StageError, monotonic_nanos};
use tessera_steps::Step;

/// How long a restarted aligner waits for the history: an idle writer gives it within 10 ms.
const HISTORY_NANOS: u64 = 30_000_000;

/// Works until the run is finished, the stage is told to stop, or it is time to forget.
pub(crate) fn work(context: &Context, desk: &mut Desk, ports: &mut Ports) -> Result<Pause, StageError> {
    let forget_every = context.settings.run.forget_every;
    let mut n_done = 0;
    let next = desk.known.tracker.next_index();
    let first = desk.known.tracker.first_recent_index().min(next);
    match await_history(context, ports, first, next)? {
        Some((epoch, seen)) => ports.adopt_epoch(epoch, next, &seen)?,
        None => ports.begin_epoch(ports.inbox.first_missing(first, next))?,
    }
    // A request that was journaled may not have been noticed.
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
        if let Some(request) = desk.known.tracker.correction_due(next) {
            if !apply_answer(desk, ports, request, next)? {
                ports.wait(WaitingOn::Correction)?;
                ports.control.was_busy(monotonic_nanos());
            }
            continue;
        }
        if !receive(context, desk, ports, next)? {
            continue;
        }
        step(context, desk, ports, next)?;
        keep(context, desk, next);
        n_done += 1;
        if forget_every > 0 && n_done >= forget_every && desk.known.end.is_none() {
            return Ok(Pause::Forget);
        }
    }
}

/// What a predecessor had under way comes again by the history of the living writer: then nothing
/// need be read and computed again. Answers the epoch to go on in, and what was received; `None`
/// where recent surfaces stay away.
fn await_history(
    context: &Context,
    ports: &mut Ports,
    first: u64,
    next: u64,
) -> Result<Option<(u64, Seen)>, StageError> {
    let limit = next.saturating_add(2 * u64::from(context.layout.window) + 1);
    let began = monotonic_nanos();
    let mut seen = Seen::new();
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
fn receive(context: &Context, desk: &Desk, ports: &mut Ports, next: u64) -> Result<bool, StageError> {
    let first = desk.known.tracker.first_recent_index().min(next);
    ports.inbox.let_go_below(first);
    let window = u64::from(context.layout.window);
    let limit = next.saturating_add(2 * window + 1);
    let seen = ports.inbox.fill(first, Some(limit), &mut ports.pulse)?;
    let now = monotonic_nanos();
    if ports.control.acknowledge(ports.inbox.first_missing(first, next), now) {
        ports.tell_sensor()?;
    }
    for (index, epoch) in seen {
        ports.control.saw(index, epoch, now);
    }
    if ports.inbox.first_missing(first, next + 1) > next {
        return Ok(true);
    }
    if ports.control.waited(now) {
        tracing::info!(frame = next, "asking again from frame {}", ports.control.flow().resend_from);
        ports.tell_sensor()?;
    }
    ports.wait(WaitingOn::Surfaces)?;
    Ok(false)
}

/// One frame: compute, store, journal, publish, acknowledge.
fn step(context: &Context, desk: &mut Desk, ports: &mut Ports, next: u64) -> Result<(), StageError> {
    ports.pulse.working(next);
    let began = monotonic_nanos();
    let first = desk.known.tracker.first_recent_index().min(next);
    let Some(surface) = ports.inbox.get(next) else { return Ok(()) };
    context.kill_points.pass("received", next);
    if surface.kind == Kind::End {
        let request = desk.known.tracker.final_request();
        desk.commit(&AlignRecord::End { n_frames: next, request })?;
        context.kill_points.pass("ended", next);
        ports.tell_optimiser();
        return Ok(());
    }
    let mut times = surface.header.times;
    times.align_began = began;
    ports.pulse.phase(Phase::Transport, began.saturating_sub(times.surface_sent));
    let grid = ports.inbox.grid;
    let recent = ports.inbox.recent(first, next);
    probe(context, desk, surface, &recent);
    let mut record = desk.known.tracker.align(&surface.view(grid), &recent, &desk.keyframes);
    desk.keyframes.check()?;
    let computed = monotonic_nanos();
    ports.pulse.phase(Phase::Computing, computed.saturating_sub(began));
    context.kill_points.pass("computed", next);
    let steps = ports.pulse.steps();
    if let Some(keyframe) = &record.new_keyframe {
        let of = keyframe.frame_index;
        let Some(kept) = ports.inbox.get(of) else {
            return Err(StageError::Inconsistent(format!(
                "frame {next} makes a keyframe of frame {of}, whose surface is not at hand"
            )));
        };
        steps.enter(Step::Store);
        desk.store_keyframe(&mut record, kept.vertices())?;
        context.kill_points.pass("stored", next);
    }
    let matters = record.new_keyframe.is_some() || record.request.is_some();
    let record = AlignRecord::Frame(Box::new(record));
    steps.enter(Step::Journal);
    desk.commit(&record)?;
    context.kill_points.pass("journaled", next);
    steps.enter(Step::Send);
    if let AlignRecord::Frame(frame) = &record {
        ports.publish(frame, times)?;
    }
    context.kill_points.pass("published", next);
    acknowledge(desk, ports)?;
    context.kill_points.pass("acknowledged", next);
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

/// Behind everything that others wait for.
pub(crate) fn keep(context: &Context, desk: &mut Desk, index: u64) {
    if desk.keep() {
        context.kill_points.pass("checkpointed", index);
    }
}

/// Says where lie the frame's surface, the recent ones and the last keyframe's, in tests.
pub(crate) fn probe(context: &Context, desk: &Desk, surface: &Surface, recent: &[FrameSurface<'_>]) {
    let index = surface.header.index;
    context.probe.look("the surface", index, surface.vertices());
    recent.iter().for_each(|r| context.probe.look("a recent surface", index, r.surface.vertices));
    if let Some(last) = desk.keyframes.len().checked_sub(1) {
        context.probe.look("a keyframe", index, desk.keyframes.vertices(last as u32));
    }
}

fn acknowledge(desk: &Desk, ports: &mut Ports) -> Result<(), StageError> {
    let next = desk.known.tracker.next_index();
    let first = desk.known.tracker.first_recent_index().min(next);
    ports.inbox.let_go_below(first);
    let now = monotonic_nanos();
    if ports.control.acknowledge(ports.inbox.first_missing(first, next), now) {
        ports.tell_sensor()?;
    }
    // The time of the alignment is not time without news.
    ports.control.was_busy(now);
    Ok(())
}

/// Lets the answer to `request` take effect before frame `before`, if it is there.
pub(crate) fn apply_answer(
    desk: &mut Desk,
    ports: &mut Ports,
    request: u64,
    before: u64,
) -> Result<bool, StageError> {
    let Some(correction) = desk.answer(request)? else { return Ok(false) };
    ports.pulse.working(before);
    let Some(record) = desk.known.tracker.correction_record(correction, before) else {
        return Err(StageError::Inconsistent(format!(
            "correction {request} was computed from other keyframes than those of the journal"
        )));
    };
    desk.commit(&record)?;
    tracing::info!(frame = before, "correction {request} takes effect");
    ports.pulse.progress();
    Ok(true)
}

/// After the end: whether the final correction has taken effect.
pub(crate) fn finish(desk: &mut Desk, ports: &mut Ports, end: End) -> Result<bool, StageError> {
    ports.control.finish();
    ports.tell_sensor()?;
    match end.request {
        Some(request) if !desk.is_applied(request.request) => {
            if !apply_answer(desk, ports, request.request, end.n_frames)? {
                ports.wait(WaitingOn::Correction)?;
            }
            Ok(false)
        }
        _ => Ok(true),
    }
}
