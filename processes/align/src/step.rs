//! Work on one frame, the same in a lossless and in a live run but for a [`Policy`]: skip, align,
//! store, journal, publish, acknowledge. A pose that much is left to do behind goes out before it.

use crate::durable_state::JournaledAligner;
use crate::inbox::ReceivedSurface;
use crate::ports::Ports;
use tessera_messages::{Kind, Phase, StepTimes};
use tessera_numerics::Step;
use tessera_slam::{AlignRecord, FrameRecord, FrameSurface, SkippedFrames, State};
use tessera_stage::{StageContext, StageError, monotonic_nanos};

/// Treatment of a frame by the kind of run.
#[derive(Debug)]
pub(crate) struct Policy {
    /// Whether a frame that ended this stage again and again is left out.
    pub(crate) skips_poison: bool,
    /// A new keyframe's frame whose surface was lost with a predecessor.
    pub(crate) missing_surface: MissingSurface,
    /// Extent of an acknowledgement.
    pub(crate) acknowledge: Acknowledge,
}

/// Treatment of a new keyframe without its surface.
#[derive(Debug)]
pub(crate) enum MissingSurface {
    /// An error: the flow brings every recent surface again.
    Fail,
    /// No keyframe: the next frame will make one.
    Postpone,
}

/// What is acknowledged once a frame is journaled.
#[derive(Debug)]
pub(crate) enum Acknowledge {
    /// Everything below the first recent surface that is missing: all others are in hand.
    RecentSurfaces,
    /// Every frame up to this one.
    Frame,
}

/// Processes the surface of frame `index`; the frames left out before it get a record each.
pub(crate) fn process_frame(
    context: &StageContext,
    policy: &Policy,
    state: &mut JournaledAligner,
    ports: &mut Ports,
    index: u64,
) -> Result<(), StageError> {
    ports.pulse.working(index);
    let began = monotonic_nanos();
    let Some(surface) = ports.inbox.get(index) else { return Ok(()) };
    let (kind, mut times) = (surface.kind, surface.header.times);
    let dropped_upstream = surface.header.dropped_before;
    if policy.skips_poison && context.poison.contains(&index) {
        // First of all: what ended this stage may be any part of the work on this frame.
        return lose_frame(state, ports, index, dropped_upstream);
    }
    context.kill_points.pass("received", index);
    skip_frames(state, ports, index, dropped_upstream)?;
    if kind == Kind::End {
        let request = state.fold.tracker.final_request();
        state.commit(AlignRecord::End { n_frames: index, request })?;
        context.kill_points.pass("ended", index);
        ports.notify_optimiser();
        return Ok(());
    }
    times.align_began = began;
    ports.pulse.phase(Phase::Transport, began.saturating_sub(times.surface_sent));
    let (mut record, sent_ahead) = align(context, state, ports, index, times)?;
    context.kill_points.pass("computed", index);
    let computed = monotonic_nanos();
    if sent_ahead.is_none() {
        ports.pulse.phase(Phase::Computing, computed.saturating_sub(began));
    }
    let steps = ports.pulse.steps();
    if record.change.new_keyframe.is_some() {
        // Only a frame that stores a surface spends time in this step.
        steps.enter(Step::Store);
        store_keyframe(policy, state, ports, &mut record)?;
        context.kill_points.pass("stored", index);
    }
    let concerns_optimiser = record.change.new_keyframe.is_some() || record.change.request.is_some();
    steps.enter(Step::Journal);
    log_change(state.fold.last_frame.as_ref(), &record);
    state.commit(AlignRecord::Frame(Box::new(record)))?;
    context.kill_points.pass("journaled", index);
    steps.enter(Step::Send);
    if let (None, Some(record)) = (sent_ahead, &state.fold.last_frame) {
        ports.poses.publish(&mut ports.pulse, record, times)?;
        context.kill_points.pass("published", index);
    }
    acknowledge(policy, state, ports)?;
    context.kill_points.pass("acknowledged", index);
    if concerns_optimiser {
        ports.notify_optimiser();
    }
    ports.pulse.beat.keyframes = state.keyframes.len() as u64;
    ports.pulse.beat.loops = state.fold.n_loops;
    ports.pulse.beat.left_out = state.fold.n_left_out;
    steps.leave();
    let now = monotonic_nanos();
    match sent_ahead {
        Some(sent) => ports.pulse.phase(Phase::Mapping, now.saturating_sub(sent)),
        None => ports.pulse.phase(Phase::Publishing, now.saturating_sub(computed)),
    }
    ports.pulse.done(began, now);
    Ok(())
}

/// Leaves out a frame that ended this stage again and again.
fn lose_frame(
    state: &mut JournaledAligner,
    ports: &mut Ports,
    index: u64,
    dropped_upstream: u64,
) -> Result<(), StageError> {
    tracing::warn!(frame = index, "lost: it ended align again and again");
    skip_frames(state, ports, index, dropped_upstream)?;
    let frames = index..index.saturating_add(1);
    let reason = "it ended align again and again".to_owned();
    state.commit(AlignRecord::Skipped(SkippedFrames { frames, reason }))?;
    ports.pulse.beat.lost += 1;
    Ok(())
}

/// Logs that the camera is lost, tracked again, or to be looked for.
fn log_change(before: Option<&FrameRecord>, frame: &FrameRecord) {
    if frame.is_relocalisation_asked() {
        let what = "a relocalisation was asked for: the place is looked for in the whole map";
        tracing::info!(frame = frame.index, "{what}");
    }
    let was_tracked = before.is_none_or(|before| before.state == State::Tracking);
    match (was_tracked, frame.state == State::Tracking) {
        (true, false) => tracing::warn!(frame = frame.index, "not tracked: {}", frame.reason()),
        (false, true) => tracing::info!(frame = frame.index, "tracked again"),
        _ => {}
    }
}

/// Journals the frames left out before `index`, at most two records: the sensor left the first
/// `dropped_upstream` of them out, this stage the rest.
fn skip_frames(
    state: &mut JournaledAligner,
    ports: &mut Ports,
    index: u64,
    dropped_upstream: u64,
) -> Result<(), StageError> {
    let next = state.fold.tracker.next_index();
    let own = next.saturating_add(dropped_upstream).min(index);
    for (frames, reason) in [(next..own, "left out before alignment"), (own..index, "newer frames had come")]
    {
        if !frames.is_empty() {
            state.commit(AlignRecord::Skipped(SkippedFrames { frames, reason: reason.to_string() }))?;
        }
    }
    ports.pulse.beat.dropped += index.saturating_sub(own);
    Ok(())
}

/// The pure step: a surface in shared memory to a record. Where much is left to do behind the pose, it is
/// published as soon as it is known; answers when.
fn align(
    context: &StageContext,
    state: &mut JournaledAligner,
    Ports { inbox, pulse, poses, .. }: &mut Ports,
    index: u64,
    times: StepTimes,
) -> Result<(FrameRecord, Option<u64>), StageError> {
    let Some(surface) = inbox.get(index) else {
        return Err(StageError::Inconsistent(format!("the surface of frame {index} is not at hand")));
    };
    let JournaledAligner { fold, keyframes, posed, .. } = state;
    let recent = inbox.recent(fold.tracker.first_recent_index(), index);
    log_addresses(context, surface, &recent);
    let mut sent: Result<Option<u64>, StageError> = Ok(None);
    let at_hand = &*keyframes;
    let mut send = |record: &FrameRecord| {
        if at_hand.is_damaged() || !posed.note(index) {
            return Ok(None);
        }
        let known = monotonic_nanos();
        pulse.steps().enter(Step::Send);
        pulse.phase(Phase::Computing, known.saturating_sub(times.align_began));
        poses.publish(pulse, record, times)?;
        context.kill_points.pass("published", index);
        let now = monotonic_nanos();
        pulse.phase(Phase::Publishing, now.saturating_sub(known));
        Ok(Some(now))
    };
    let view = surface.view(inbox.grid);
    let record = fold.tracker.align_pose_first(&view, &recent, at_hand, &mut |r| sent = send(r));
    let sent = sent?;
    keyframes.check()?;
    keyframes.check_held()?;
    Ok((record, sent))
}

/// Appends the surface of the new keyframe to the store.
fn store_keyframe(
    policy: &Policy,
    state: &mut JournaledAligner,
    ports: &Ports,
    record: &mut FrameRecord,
) -> Result<(), StageError> {
    let Some(keyframe_index) = record.change.new_keyframe.as_ref().map(|keyframe| keyframe.frame_index)
    else {
        return Ok(());
    };
    match (ports.inbox.get(keyframe_index), &policy.missing_surface) {
        (Some(surface), _) => state.store_keyframe(record, surface.payload())?,
        (None, MissingSurface::Postpone) => record.change.new_keyframe = None,
        (None, MissingSurface::Fail) => {
            return Err(StageError::Inconsistent(format!(
                "frame {} makes a keyframe of frame {keyframe_index}, whose surface is not at hand",
                record.index
            )));
        }
    }
    Ok(())
}

fn acknowledge(policy: &Policy, state: &JournaledAligner, ports: &mut Ports) -> Result<(), StageError> {
    let next = state.fold.tracker.next_index();
    let now = monotonic_nanos();
    let first_missing = match policy.acknowledge {
        Acknowledge::Frame => next,
        Acknowledge::RecentSurfaces => {
            let first = state.fold.tracker.first_recent_index().min(next);
            ports.inbox.release_below(first);
            ports.inbox.first_missing(first, next)
        }
    };
    if ports.control.acknowledge(first_missing, now) {
        ports.notify_sensor()?;
    }
    // The time of the alignment is not time without news.
    ports.control.was_busy(now);
    Ok(())
}

/// Logs the addresses of the frame's surface and the recent ones, in tests.
fn log_addresses(context: &StageContext, surface: &ReceivedSurface, recent: &[FrameSurface<'_>]) {
    let (probe, index) = (context.probe, surface.header.index);
    probe.log_place("the surface", index, surface.vertices());
    recent.iter().for_each(|r| probe.log_place("a recent surface", index, r.surface.vertices));
}
