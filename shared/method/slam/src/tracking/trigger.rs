//! Triggering the global optimisation (III-G): a loop closure in the window, or a new keyframe that looks
//! like an old one.

use crate::map::appearance::similarity;
use crate::map::detection::{self, Urgency};
use crate::map::records::{FrameRecord, KeyframeRecord};
use crate::map::state::KeyframeState;
use crate::pairs::matching::Reach;
use crate::tracking::alignment::Aligner;
use crate::tracking::in_place::{is_in_place, old_members};
use crate::tracking::input::TrackingInput;
use crate::tracking::prediction::Reference;
use crate::tracking::seen_pose::known_and_seen;
use crate::tracking::sight::ENOUGH_FEATURES;
use crate::tracking::window::{Member, WINDOW_VIEWS};
use crate::tracking::window_alignment::{WindowAlignment, reference};
use tessera_geometry::Pose;

/// The record with a request for an optimisation, where a loop can be closed.
pub(crate) fn with_request(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    aligned: &WindowAlignment,
    mut record: FrameRecord,
) -> FrameRecord {
    let settings = &input.context.mapping.loops;
    let frame = input.frame;
    let n_keyframes = input.map.n_keyframes() as u32 + u32::from(record.change.new_keyframe.is_some());
    let request =
        |urgency| detection::request(settings, input.map.state(), frame.index, n_keyframes, urgency);
    if record.change.request.is_some() || request(Urgency::Soon).is_none() {
        return record;
    }
    let sees_loop = old_members(input, aligned).next().is_some();
    // What is seen where it should be is not also elsewhere: that is a place that looks alike.
    let is_in_place = is_in_place(input, aligner, aligned);
    record.change.request = if !is_in_place
        && record.change.new_keyframe.as_ref().is_some_and(|k| shows_drift(input, aligner, k, &record))
    {
        request(Urgency::Soon)
    } else if sees_loop {
        request(Urgency::Later)
    } else {
        None
    };
    record
}

/// Whether a new keyframe looks like one with which it could close a loop, at another pose than the camera's. The
/// optimiser verifies it.
fn shows_drift(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    keyframe: &KeyframeRecord,
    record: &FrameRecord,
) -> bool {
    keyframe.alike.iter().any(|id| {
        let Some(older) = input.map.keyframe(*id) else { return false };
        let Some(there) = reference(input, Member::Keyframe(*id)) else { return false };
        let has_features = |n: usize| n >= ENOUGH_FEATURES && input.context.is_colour_trusted;
        // Where both have features, appearance alone is no evidence: all views of bare walls are similar.
        if has_features(aligner.sight.n_features()) && has_features(there.features.len()) {
            return is_seen_elsewhere(input, aligner, (older, &there), record);
        }
        let is_similar =
            similarity(&keyframe.place, &older.place) >= input.context.mapping.loops.min_similarity;
        is_similar && !is_near(older, &Pose::from(&record.pose.world_from_camera))
    })
}

/// Whether features see the camera farther from an older keyframe than both are uncertain: a smaller correction before
/// the end would move the poses that are published by less than that.
fn is_seen_elsewhere(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    (older, there): (&KeyframeState, &Reference<'_>),
    record: &FrameRecord,
) -> bool {
    let world_from_camera = Pose::from(&record.pose.world_from_camera);
    let Some(pair) = aligner.sight.pair(input.context, there, &world_from_camera, Reach::Anywhere) else {
        return false;
    };
    known_and_seen(input, older, &pair, &record.pose).is_some_and(|[known, seen]| !known.agrees(&seen))
}

/// Whether a keyframe stands near enough for the window to see it: to such a one the frame is aligned.
fn is_near(older: &KeyframeState, world_from_camera: &Pose) -> bool {
    WINDOW_VIEWS.hold(world_from_camera, &Pose::from(&older.world_from_camera))
}
