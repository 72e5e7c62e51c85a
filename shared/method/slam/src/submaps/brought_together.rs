//! Whether keyframes that a global optimisation brings together contradict each other (method 8.4).
//!
//! Rooms that look alike pass every test of a pair by appearance. What is about them does not: a map whose one
//! room was brought over another has doors and corridors in each other, and what one keyframe saw there floats in
//! front of what another one saw.

use crate::map::context::Context;
use crate::map::state::KeyframeState;
use crate::map::submaps::Origin;
use crate::map::surfaces::KeyframeSurfaces;
use crate::pairs::covisibility;
use crate::submaps::contradiction::{self, PlacedKeyframe};
use tessera_geometry::{Pose, translation_rotation_norms};

/// Motion of two keyframes against each other beyond which they were brought together, metres, half a radian as
/// a metre. Drift that is smaller brings no other room.
pub(crate) const FAR_M: f64 = 1.0;
const METRES_PER_RADIAN: f64 = 2.0;
/// Volume of the poses that are not far, metres and radians, each cubed: a ball of either.
pub(crate) const FAR_VOLUME: f64 = {
    let ball = 4.0 / 3.0 * std::f64::consts::PI;
    let (far_m, far_rad) = (FAR_M, FAR_M / METRES_PER_RADIAN);
    ball * far_m * far_m * far_m * ball * far_rad * far_rad * far_rad
};

/// How far apart two poses of a keyframe in another one are, metres, half a radian as a metre.
pub(crate) fn apart_m(a: &Pose, b: &Pose) -> f64 {
    let (metres, radians) = translation_rotation_norms(&(a.inverse() * b));
    metres.max(METRES_PER_RADIAN * radians)
}

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
        covisibility::pairs(after, origins).into_iter().partition(|pair| is_far(pair));
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
