//! Triggering the global optimisation (III-G): a loop closure in the window, or a new keyframe that looks
//! like an old one.

use crate::features::matching::Reach;
use crate::loops::appearance::similarity;
use crate::loops::detection::{self, Urgency};
use crate::map::records::{FrameRecord, KeyframeRecord};
use crate::tracking::alignment::Aligner;
use crate::tracking::input::TrackingInput;
use crate::tracking::window::Member;
use crate::tracking::window_alignment::{WindowAlignment, reference};
use tessera_geometry::{Pose, translation_rotation_norms};

/// Distance from where features see the camera that is worth a correction before the end. A smaller one
/// would move the poses that are published by less than they are uncertain.
const DRIFT_M: f64 = 0.1;
const DRIFT_RAD: f64 = 5.0_f64.to_radians();
/// Features that must agree on it.
const MIN_INLIERS: usize = 20;

/// The record with a request for an optimisation, where a loop can be closed.
pub(crate) fn with_request(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    aligned: &WindowAlignment,
    mut record: FrameRecord,
) -> FrameRecord {
    let settings = &input.context.mapping.loops;
    let frame = input.frame;
    let n_keyframes = input.map.n_keyframes() as u32 + u32::from(record.new_keyframe.is_some());
    let request =
        |urgency| detection::request(settings, input.map.state(), frame.index, n_keyframes, urgency);
    let has_moved = !record.moved.is_empty();
    if record.request.is_some() || request(if has_moved { Urgency::AtOnce } else { Urgency::Soon }).is_none()
    {
        return record;
    }
    let sees_loop = aligned.members.iter().any(|m| match m {
        Member::Keyframe(id) => {
            input.map.keyframe(*id).is_some_and(|k| detection::is_loop(settings, input.map, k, frame.index))
        }
        Member::Recent(_) => false,
    });
    let at = Pose::from(&record.world_from_camera);
    record.request = if sees_loop && has_moved {
        request(Urgency::AtOnce)
    } else if record.new_keyframe.as_ref().is_some_and(|k| shows_drift(input, aligner, k, &at)) {
        request(Urgency::Soon)
    } else if sees_loop {
        request(Urgency::Later)
    } else {
        None
    };
    record
}

/// Whether a new keyframe looks like one with which it could close a loop, and the frame's features see
/// the camera elsewhere than it is; by ferns alone the looks suffice. The optimiser verifies it.
fn shows_drift(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    keyframe: &KeyframeRecord,
    world_from_camera: &Pose,
) -> bool {
    keyframe.alike.iter().any(|id| {
        let Some(older) = input.map.keyframe(*id) else { return false };
        let is_similar =
            similarity(&keyframe.place, &older.place) >= input.context.mapping.loops.min_similarity;
        is_similar || is_seen_elsewhere(input, aligner, *id, world_from_camera)
    })
}

fn is_seen_elsewhere(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    older: u32,
    world_from_camera: &Pose,
) -> bool {
    let Some(older) = reference(input, Member::Keyframe(older)) else { return false };
    let found = aligner.sight.pair(input.context, &older, world_from_camera, Reach::ANYWHERE);
    found.filter(|pair| pair.inliers.len() >= MIN_INLIERS).is_some_and(|pair| {
        let seen = older.world_from_camera * pair.target_from_query;
        let (apart_m, apart_rad) = translation_rotation_norms(&(world_from_camera.inverse() * seen));
        apart_m > DRIFT_M || apart_rad > DRIFT_RAD
    })
}
