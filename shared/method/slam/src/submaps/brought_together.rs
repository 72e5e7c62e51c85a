//! Whether keyframes that a global optimisation brings together contradict each other (method 8.4).
//!
//! Rooms that look alike pass every test of a pair by appearance. What is about them does not: a map whose one
//! room was brought over another has doors and corridors in each other, and what one keyframe saw there floats in
//! front of what another one saw.

use crate::evidence::pose_agreement::{FAR_M, apart_m};
use crate::map::context::Context;
use crate::map::state::KeyframeState;
use crate::map::submaps::Origin;
use crate::map::surfaces::KeyframeSurfaces;
use crate::pairs::covisibility;
use crate::submaps::contradiction::{self, PlacedKeyframe};
use tessera_geometry::Pose;

/// Whether keyframes that stand near each other `after`, and did not `before`, contradict each other. All by the
/// places of `keyframes`. The same for any number of threads.
pub(crate) fn is_contradicted(
    context: &Context,
    (keyframes, origins): (&[KeyframeState], &[Origin]),
    surfaces: &dyn KeyframeSurfaces,
    [before, after]: [&[Pose]; 2],
) -> bool {
    let relative = |poses: &[Pose], (a, b): (usize, usize)| poses[b].inverse() * poses[a];
    let is_far = |pair: &(usize, usize)| apart_m(&relative(before, *pair), &relative(after, *pair)) > FAR_M;
    let (across, own): (Vec<_>, Vec<_>) =
        covisibility::pairs(after, origins, &[]).into_iter().partition(|pair| is_far(pair));
    if across.is_empty() {
        return false;
    }
    let placed: Vec<PlacedKeyframe<'_>> = keyframes
        .iter()
        .zip(after)
        .map(|(keyframe, pose)| PlacedKeyframe { keyframe, world_from_camera: *pose, is_moved: false })
        .collect();
    contradiction::nats(context, &placed, surfaces, across, own) < 0.0
}
