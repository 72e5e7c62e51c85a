//! Triggering the global optimisation: a loop closure in the window, or a new keyframe whose
//! descriptor is similar to an old one (III-G).

use crate::loops::appearance::similarity;
use crate::loops::detection;
use crate::map::records::{FrameRecord, KeyframeRecord};
use crate::tracking::input::TrackingInput;
use crate::tracking::window::Member;
use crate::tracking::window_alignment::WindowAlignment;

/// The record with a request for an optimisation, where a loop can be closed.
pub(crate) fn with_request(
    input: &TrackingInput<'_>,
    aligned: &WindowAlignment,
    mut record: FrameRecord,
) -> FrameRecord {
    if record.request.is_some() {
        return record;
    }
    let settings = &input.context.mapping.loops;
    let frame = input.frame;
    let sees_loop = aligned.members.iter().any(|m| match m {
        Member::Keyframe(id) => {
            input.map.keyframe(*id).is_some_and(|k| detection::is_loop(settings, input.map, k, frame.index))
        }
        Member::Recent(_) => false,
    });
    let is_similar = || record.new_keyframe.as_ref().is_some_and(|k| is_similar_to_old(input, k));
    if sees_loop || is_similar() {
        let n_keyframes = input.map.n_keyframes() as u32 + u32::from(record.new_keyframe.is_some());
        let is_urgent = !record.moved.is_empty();
        record.request = detection::request(settings, input.map.state(), frame.index, n_keyframes, is_urgent);
    }
    record
}

/// Whether the descriptor of a new keyframe is similar to one with which it could close a loop; the
/// optimiser verifies it.
fn is_similar_to_old(input: &TrackingInput<'_>, keyframe: &KeyframeRecord) -> bool {
    let settings = &input.context.mapping.loops;
    input.map.keyframes().any(|older| {
        older.is_active()
            && detection::is_loop(settings, input.map, older, keyframe.frame_index)
            && similarity(&keyframe.place, &older.place) >= settings.min_similarity
    })
}
