//! Whether what two components saw contradicts their join: rooms that look alike agree in themselves, but what
//! is about them does not (method 12.9).

use crate::loops::covisibility;
use crate::loops::matchable::Matchable;
use crate::loops::verification;
use crate::map::context::Context;
use crate::map::records::{JoinRecord, LoopVerdict};
use crate::map::state::{KeyframeState, TrackerState};
use crate::map::submaps::Origin;
use crate::map::surfaces::KeyframeSurfaces;
use tessera_geometry::{Pose, translation_rotation_norms};
use tessera_numerics::parallel::map_in_parts;
use tessera_registration::Sampler;

/// Pairs of keyframes by which a join is tested, at most.
const MOST_TESTED: usize = 200;
/// Pairs that violate free space in a join that is contradicted: at least so many, and more than this share of
/// those that agree. Right joins were seen to have none, joins of rooms that look alike 7 %.
const LEAST_VIOLATED: usize = 3;
const MOST_VIOLATED: f64 = 0.025;
/// Joins that differ by more bring two components to different places, metres and radians.
const APART_M: f64 = 1.0;
const APART_RAD: f64 = 0.5;

/// A keyframe of either component of a join.
struct JoinedKeyframe<'a> {
    keyframe: &'a KeyframeState,
    is_moved: bool,
    /// Where the join puts it.
    world_from_camera: Pose,
}

/// Whether keyframes of both components, which a join brings near each other, say that it is wrong: what the
/// one saw floats in front of what the other saw. The same for any number of threads.
pub(crate) fn is_contradicted(
    context: &Context,
    state: &TrackerState,
    surfaces: &dyn KeyframeSurfaces,
    joined: &JoinRecord,
) -> bool {
    let both = keyframes_of_both(state, joined);
    let across = pairs_across(&both, joined.kept);
    let settings = &context.mapping.global;
    let verdicts = map_in_parts(
        &across,
        || (context.matcher(), Sampler::default()),
        |(matcher, sampler), &(newer, older)| {
            let sides =
                [newer, older].map(|at| Matchable::new(context, sampler, both[at].keyframe, surfaces));
            let older_from_newer = both[older].world_from_camera.inverse() * both[newer].world_from_camera;
            verification::test(settings, matcher, &sides[0], &sides[1], &older_from_newer).verdict
        },
        &mut || (),
    );
    let n = |verdict: LoopVerdict| verdicts.iter().filter(|found| **found == verdict).count();
    let n_violated = n(LoopVerdict::FreeSpaceViolated);
    n_violated >= LEAST_VIOLATED && n_violated as f64 > MOST_VIOLATED * n(LoopVerdict::Accepted) as f64
}

fn keyframes_of_both<'a>(state: &'a TrackerState, joined: &JoinRecord) -> Vec<JoinedKeyframe<'a>> {
    let kept_from_moved = Pose::from(&joined.kept_from_moved);
    let place = |keyframe: &'a KeyframeState| {
        let (component, pose) =
            (state.submaps.component(keyframe.submap), Pose::from(&keyframe.world_from_camera));
        let is_moved = component == joined.moved;
        let world_from_camera = if is_moved { kept_from_moved * pose } else { pose };
        (is_moved || component == joined.kept).then_some(JoinedKeyframe {
            keyframe,
            is_moved,
            world_from_camera,
        })
    };
    state.keyframes.iter().filter(|k| k.is_active()).filter_map(place).collect()
}

/// Pairs of neighbours of which one is of either component, evenly chosen from all.
fn pairs_across(both: &[JoinedKeyframe<'_>], component: u32) -> Vec<(usize, usize)> {
    let poses: Vec<Pose> = both.iter().map(|k| k.world_from_camera).collect();
    let origin = |k: &JoinedKeyframe<'_>| {
        let KeyframeState { session, submap, .. } = *k.keyframe;
        Origin { session, submap, component }
    };
    let origins: Vec<Origin> = both.iter().map(origin).collect();
    let mut across = covisibility::pairs(&poses, &origins);
    across.retain(|(newer, older)| both[*newer].is_moved != both[*older].is_moved);
    let step = across.len().div_ceil(MOST_TESTED).max(1);
    across.into_iter().step_by(step).collect()
}

/// Whether two joins bring the same components to the same place.
pub(crate) fn is_same_join(a: &JoinRecord, b: &JoinRecord) -> bool {
    let [motion_a, motion_b] = [a, b].map(|join| Pose::from(&join.kept_from_moved));
    let apart = translation_rotation_norms(&(motion_a.inverse() * motion_b));
    (a.kept, a.moved) == (b.kept, b.moved) && apart.0 < APART_M && apart.1 < APART_RAD
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loops::test_wall::keyframe;
    use tessera_geometry::PoseBits;

    fn joined(moved: u32, x_m: f64) -> JoinRecord {
        let kept_from_moved = PoseBits::from(&Pose::translation(x_m, 0.0, 0.0));
        JoinRecord { kept: 0, moved, kept_from_moved }
    }

    #[test]
    fn a_join_is_the_same_where_it_brings_the_same_components_near_the_same_place() {
        assert!(is_same_join(&joined(1, 0.0), &joined(1, 0.9)));
        assert!(!is_same_join(&joined(1, 0.0), &joined(1, 1.1)));
        assert!(!is_same_join(&joined(1, 0.0), &joined(2, 0.0)));
    }

    #[test]
    fn pairs_are_of_both_components_and_bounded() {
        let mut state = TrackerState::default();
        state.submaps.extend_to(2);
        let number = |id: u32| KeyframeState { submap: id % 3, session: id % 3, ..keyframe(id, 0, 0.0) };
        state.keyframes = (0..900).map(number).collect();
        let both = keyframes_of_both(&state, &joined(1, 0.0));
        assert_eq!(both.len(), 600, "the third component takes no part");
        let pairs = pairs_across(&both, 0);
        assert!(pairs.len() > MOST_TESTED / 2 && pairs.len() <= MOST_TESTED, "{}", pairs.len());
        assert!(pairs.iter().all(|(a, b)| both[*a].is_moved != both[*b].is_moved));
    }
}
