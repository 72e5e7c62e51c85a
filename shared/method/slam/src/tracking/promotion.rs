//! The previous frame becomes a keyframe, relative to which the alignment counts from there on (III-H, method 9).

use crate::map::culling;
use crate::map::detection;
use crate::map::records::{EdgeRecord, FrameRecord, KeyframeRecord, State};
use crate::map::state::{KeyframeState, MOST_COASTED_S, RecentFrame};
use crate::tracking::alignment::Aligner;
use crate::tracking::alike::alike;
use crate::tracking::frame_record::frame_record;
use crate::tracking::in_place::is_in_place;
use crate::tracking::input::TrackingInput;
use crate::tracking::keyframe_test::{self, Distance};
use crate::tracking::sight::NEAR_IN_TIME;
use crate::tracking::window::Member;
use crate::tracking::window_alignment::WindowAlignment;
use tessera_geometry::{Pose, log};

/// A frame behind the keyframe test.
pub(crate) struct Promoted {
    /// Its alignment; a new keyframe replaces the previous frame in it.
    pub(crate) aligned: WindowAlignment,
    /// Its record, a new keyframe without what it means for others.
    pub(crate) record: FrameRecord,
    /// Whether the new keyframe is looked for among all others.
    pub(crate) is_looked_for: bool,
}

/// Makes the previous frame a keyframe where the keyframe test asks for it.
pub(crate) fn with_keyframe(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    aligned: WindowAlignment,
    record: FrameRecord,
) -> Promoted {
    let Some(keyframe) = new_keyframe(input, aligner, &record) else {
        return Promoted { aligned, record, is_looked_for: false };
    };
    // While features confirm the camera's pose, the window has closed what loops there are.
    let is_looked_for = keyframe.id.is_multiple_of(NEAR_IN_TIME) || !is_in_place(input, aligner, &aligned);
    let (aligned, record) = relative_to(input, aligner, aligned, keyframe);
    Promoted { aligned, record, is_looked_for }
}

/// The record with what a new keyframe means for others: those that it looks like, and those that leave the
/// working map for it.
pub(crate) fn with_place(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    is_looked_for: bool,
    mut record: FrameRecord,
) -> FrameRecord {
    let Some(keyframe) = &mut record.change.new_keyframe else { return record };
    let surface = input.surfaces.recent.iter().find(|s| s.index == keyframe.frame_index);
    if let Some(surface) = surface.filter(|_| is_looked_for) {
        keyframe.alike = alike(input, &mut aligner.sight, surface, &keyframe.place);
    }
    keyframe.retires = culling::culled(input.map.state(), &input.context.mapping);
    record
}

/// The previous frame as a keyframe, where the new one is too far from the last (method 9.1).
fn new_keyframe(
    input: &TrackingInput<'_>,
    aligner: &Aligner,
    record: &FrameRecord,
) -> Option<KeyframeRecord> {
    if input.context.mapping.only_localise {
        return None;
    }
    let state = input.map.state();
    let last_keyframe = input.map.last_keyframe()?;
    let previous = state.recent.last()?;
    let distance = Distance {
        keyframe_from_camera: &Pose::from(&record.pose.keyframe_from_camera),
        entropy_nats: record.pose.entropy_nats,
        reference_entropy: state.reference_entropy,
    };
    let surface = input.surfaces.recent.iter().find(|s| s.index == previous.index)?;
    if (input.map.is_own(last_keyframe) && previous.index == last_keyframe.frame_index)
        || previous.state != State::Tracking
        // Its features would be those of a frame before; the next frame has its own.
        || (previous.repeats_colour && !aligner.sight.is_repeated)
        || !keyframe_test::is_due(&input.context.mapping, &distance)
    {
        return None;
    }
    let (id, frame) = (input.map.n_keyframes() as u32, (previous.index, previous.stamp_nanos));
    let place = input.ferns.code(&surface.surface);
    let velocity = central_velocity(input, previous, &Pose::from(&record.pose.world_from_camera));
    Some(KeyframeRecord { velocity, ..KeyframeRecord::new(id, frame, previous.world_from_camera, place) })
}

/// Velocity of the previous frame from its neighbours on both sides.
fn central_velocity(input: &TrackingInput<'_>, previous: &RecentFrame, world_from_camera: &Pose) -> [f64; 6] {
    let before = match input.map.state().recent.as_slice() {
        [before, _] if before.state == State::Tracking => before,
        _ => previous,
    };
    let seconds = input.frame.stamp_nanos.saturating_sub(before.stamp_nanos) as f64 * 1e-9;
    if !(seconds > 0.0 && seconds < MOST_COASTED_S) {
        return previous.velocity;
    }
    let step = log(&(Pose::from(&before.world_from_camera).inverse() * world_from_camera));
    step.scaled(1.0 / seconds).to_vector().into()
}

/// The alignment and its record relative to the new keyframe: it is the frame before, which was in the window.
fn relative_to(
    input: &TrackingInput<'_>,
    aligner: &Aligner,
    mut aligned: WindowAlignment,
    mut keyframe: KeyframeRecord,
) -> (WindowAlignment, FrameRecord) {
    let recent = &input.map.state().recent;
    for member in &mut aligned.members {
        if matches!(member, Member::Recent(place) if recent[*place].index == keyframe.frame_index) {
            *member = Member::Keyframe(keyframe.id);
        }
    }
    let state = input.map.state();
    let covariance = state.recent.last().map_or(Vec::new(), |r| r.covariance.clone());
    // As the state will hold it once the record is applied.
    let candidate = KeyframeState::made(&keyframe, state.session, input.map.submap());
    let candidate = KeyframeState { covariance, ..candidate };
    let input = &TrackingInput { map: input.map.with_candidate(&candidate), ..*input };
    keyframe.edges = edges(input, &aligned);
    let record = frame_record(input, aligner, &aligned, Some(keyframe));
    (aligned, record)
}

/// The keyframes that share the window with the new one.
fn edges(input: &TrackingInput<'_>, aligned: &WindowAlignment) -> Vec<EdgeRecord> {
    let newest = input.map.last_keyframe().map_or(0, |k| k.id);
    let older = aligned.keyframes(input.map).filter(|k| k.id != newest);
    let settings = &input.context.mapping.loops;
    let index = input.frame.index;
    let mut edges: Vec<EdgeRecord> = older
        .map(|k| EdgeRecord { to: k.id, is_loop: detection::is_loop(settings, input.map, k, index) })
        .collect();
    edges.sort_by_key(|e| e.to);
    edges
}
