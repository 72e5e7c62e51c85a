//! Whether keyframes that a global optimisation brings together contradict each other (method 8.4).
//!
//! Rooms that look alike pass every test of a pair by appearance. What is about them does not: a map whose one
//! room was brought over another has doors and corridors in each other, and what one keyframe saw there floats in
//! front of what another one saw.

use crate::evidence::pose_agreement::{FAR_M, apart_m, is_allowed};
use crate::evidence::sequential::{SequentialTest, TestVerdict};
use crate::map::context::Context;
use crate::map::state::KeyframeState;
use crate::map::submaps::Origin;
use crate::map::surfaces::KeyframeSurfaces;
use crate::pairs::covisibility;
use crate::submaps::contradiction::{self, PlacedKeyframe};
use tessera_geometry::{Matrix6, Pose};

/// Whether keyframes that stand near each other `after`, and did not `before`, are of one place, or contradict each
/// other, by the error rates of a sequential test. All by the places of `keyframes`. The same for any number of threads.
pub(crate) fn verdict(
    context: &Context,
    (keyframes, origins): (&[KeyframeState], &[Origin]),
    surfaces: &dyn KeyframeSurfaces,
    [before, after]: [&[Pose]; 2],
) -> TestVerdict {
    let relative = |poses: &[Pose], (a, b): (usize, usize)| poses[b].inverse() * poses[a];
    let is_far = |pair: &(usize, usize)| apart_m(&relative(before, *pair), &relative(after, *pair)) > FAR_M;
    let (across, own): (Vec<_>, Vec<_>) =
        covisibility::pairs(after, origins, &[]).into_iter().partition(|pair| is_far(pair));
    if across.is_empty() {
        return TestVerdict::Accepted;
    }
    let placed: Vec<PlacedKeyframe<'_>> = keyframes
        .iter()
        .zip(after)
        .map(|(keyframe, pose)| PlacedKeyframe { keyframe, world_from_camera: *pose, is_moved: false })
        .collect();
    let is_allowed = |&(a, b): &(usize, usize)| {
        is_allowed((&keyframes[a], &keyframes[b]), relative(after, (a, b)), Matrix6::zeros())
    };
    let is_of_track = across.iter().all(is_allowed);
    judged(contradiction::nats(context, &placed, surfaces, across, own), is_of_track)
}

/// The decision by so much evidence. Rooms that look alike agree until what is about them is seen: where the track does
/// not allow what is brought together, as much must agree as would refute it.
fn judged(nats: f64, is_of_track: bool) -> TestVerdict {
    match nats {
        nats if nats < 0.0 => TestVerdict::Rejected,
        nats if is_of_track || SequentialTest::refutes(-nats) => TestVerdict::Accepted,
        _ => TestVerdict::Undecided,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_track_does_not_allow_waits_for_more_evidence() {
        assert_eq!([true, false].map(|of_track| judged(-0.1, of_track)), [TestVerdict::Rejected; 2]);
        let little = [true, false].map(|of_track| judged(2.4, of_track));
        assert_eq!(little, [TestVerdict::Accepted, TestVerdict::Undecided]);
        assert_eq!(judged(4.7, false), TestVerdict::Accepted);
    }
}
