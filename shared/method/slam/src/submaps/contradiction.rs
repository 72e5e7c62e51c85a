//! Whether what two parts of a map saw contradicts that they are one place: rooms that look alike agree in themselves,
//! but what is about them does not (method 12.8).

use crate::evidence::contradiction::{AskedPair, PairAnswer, one_place_nats};
use crate::evidence::pose_agreement::{FAR_M, apart_m};
use crate::evidence::sequential::{SequentialTest, TestVerdict};
use crate::map::context::Context;
use crate::map::records::{JoinRecord, LoopVerdict};
use crate::map::state::{KeyframeState, TrackerState};
use crate::map::submaps::Origin;
use crate::map::surfaces::KeyframeSurfaces;
use crate::map::view_limits::SAME_VIEW;
use crate::pairs::covisibility;
use crate::pairs::matchable::Matchable;
use crate::pairs::matching::{PairFinder, Reach};
use crate::pairs::verification;
use crate::settings::GlobalSettings;
use crate::tracking::acceptance::STRICT;
use crate::tracking::sight::ENOUGH_FEATURES;
use nalgebra::Vector3;
use tessera_geometry::Pose;
use tessera_numerics::parallel::map_in_parts;
use tessera_registration::{Matcher, Sampler};

/// Pairs of keyframes that are asked across a join, and as many of both parts by themselves, at most.
const MOST_ASKED: usize = 100;
/// What is about the place at which two components are joined, metres: both have drifted in themselves.
const ABOUT_M: f64 = 6.0;

/// A keyframe where it is tested.
pub(crate) struct PlacedKeyframe<'a> {
    pub(crate) keyframe: &'a KeyframeState,
    pub(crate) world_from_camera: Pose,
    /// Of which of the two parts.
    pub(crate) is_moved: bool,
}

/// Log-likelihood ratio of a join against another place that looks alike, nats: by keyframes of both components, which
/// it brings near each other, within some metres of `place` in the gauge that stays. The same for any number of threads.
pub(crate) fn join_nats(
    context: &Context,
    state: &TrackerState,
    surfaces: &dyn KeyframeSurfaces,
    joined: &JoinRecord,
    place: &Vector3<f64>,
) -> f64 {
    let mut both = keyframes_of_both(state, joined);
    both.retain(|k| (k.world_from_camera.translation.vector - place).norm() <= ABOUT_M);
    let across = neighbours(&both, |_| 0).into_iter().filter_map(|(newer, older)| {
        let pair = if both[newer].is_moved { (newer, older) } else { (older, newer) };
        (both[newer].is_moved != both[older].is_moved).then_some(pair)
    });
    let across = across.collect();
    let own = neighbours(&both, |k| u32::from(k.is_moved));
    nats(context, &both, surfaces, across, own)
}

/// The decision on a join from the evidence of the views that showed the place and of what surrounds it, nats each.
pub(crate) fn verdict(place_nats: f64, nats: f64) -> TestVerdict {
    if SequentialTest::refutes(nats) {
        TestVerdict::Rejected
    } else if nats > 0.0 && place_nats + nats >= SequentialTest::accepted_nats() {
        TestVerdict::Accepted
    } else {
        TestVerdict::Undecided
    }
}

/// The same of keyframes that were placed, by pairs across and pairs of one part.
pub(crate) fn nats(
    context: &Context,
    placed: &[PlacedKeyframe<'_>],
    surfaces: &dyn KeyframeSurfaces,
    across: Vec<(usize, usize)>,
    mut own: Vec<(usize, usize)>,
) -> f64 {
    let across = evenly(across);
    let mut is_asked = vec![false; placed.len()];
    across.iter().for_each(|(a, b)| (is_asked[*a], is_asked[*b]) = (true, true));
    own.retain(|(a, b)| is_asked[*a] || is_asked[*b]);
    let tester = || PairTester::new(context, placed, surfaces);
    let answers = |pairs: &[(usize, usize)]| -> Vec<AskedPair> {
        let ask = |tester: &mut PairTester<'_>, pair: &(usize, usize)| (*pair, tester.answer(*pair));
        map_in_parts(pairs, tester, ask, &mut || ())
    };
    let (own, across) = (answers(&evenly(own)), answers(&across));
    one_place_nats(placed.len(), &own, &across)
}

/// Asks pairs of keyframes; holds the buffers.
struct PairTester<'a> {
    context: &'a Context,
    placed: &'a [PlacedKeyframe<'a>],
    surfaces: &'a dyn KeyframeSurfaces,
    matcher: Matcher,
    sampler: Sampler,
    finder: PairFinder,
}

impl<'a> PairTester<'a> {
    fn new(
        context: &'a Context,
        placed: &'a [PlacedKeyframe<'a>],
        surfaces: &'a dyn KeyframeSurfaces,
    ) -> Self {
        let (matcher, finder) = (context.matcher(), PairFinder::new(context));
        Self { context, placed, surfaces, matcher, sampler: Sampler::default(), finder }
    }

    fn answer(&mut self, (a, b): (usize, usize)) -> PairAnswer {
        let Self { context, placed, surfaces, sampler, .. } = self;
        let sides = [a, b].map(|at| {
            let keyframe = placed[at].keyframe;
            let features = surfaces.features_once(keyframe.id);
            Matchable::new(context, sampler, keyframe, *surfaces).with_features(context, features)
        });
        let b_from_a = placed[b].world_from_camera.inverse() * placed[a].world_from_camera;
        let tested = verification::test(&mut self.matcher, &sides[0], &sides[1], &b_from_a);
        let is_enough =
            tested.overlap >= GlobalSettings::MIN_OVERLAP || tested.verdict == LoopVerdict::FreeSpaceViolated;
        let directions = [(0, 1, b_from_a), (1, 0, b_from_a.inverse())];
        let matcher = &mut self.matcher;
        let floats = is_enough
            && directions.into_iter().any(|(query, target, pose)| {
                let (query, target) = (&sides[query], &sides[target]);
                verification::least_in_front(matcher, query, target, &pose) > STRICT.in_front
            });
        if floats || self.shares_nothing((a, b), &sides, &b_from_a) {
            PairAnswer::Contradicts
        } else if tested.verdict == LoopVerdict::Accepted {
            PairAnswer::Agrees
        } else {
            PairAnswer::Silent
        }
    }

    /// Whether two that have the same view share no features, wherever they are looked for.
    fn shares_nothing(
        &mut self,
        (a, b): (usize, usize),
        sides: &[Matchable<'_>; 2],
        b_from_a: &Pose,
    ) -> bool {
        let [pose, other] = [a, b].map(|at| self.placed[at].world_from_camera);
        if !self.context.is_colour_trusted || !SAME_VIEW.hold(&pose, &other) {
            return false;
        }
        let seen = [&sides[0], &sides[1]].map(|side| side.seen(self.context));
        if seen.iter().any(|seen| seen.features.len() < ENOUGH_FEATURES) {
            return false;
        }
        let seed = (self.placed[a].keyframe.id as u64) << 32 | self.placed[b].keyframe.id as u64;
        let mut finds = |reach: Reach| self.finder.find(self.context, seen, b_from_a, reach, seed).is_some();
        !finds(Reach::Near) && !finds(Reach::Anywhere)
    }
}

fn keyframes_of_both<'a>(state: &'a TrackerState, joined: &JoinRecord) -> Vec<PlacedKeyframe<'a>> {
    let kept_from_moved = Pose::from(&joined.kept_from_moved);
    let place = |keyframe: &'a KeyframeState| {
        let (component, pose) =
            (state.submaps.component(keyframe.submap), Pose::from(&keyframe.world_from_camera));
        let is_moved = component == joined.moved;
        let world_from_camera = if is_moved { kept_from_moved * pose } else { pose };
        let placed = PlacedKeyframe { keyframe, world_from_camera, is_moved };
        (is_moved || component == joined.kept).then_some(placed)
    };
    state.active().filter_map(place).collect()
}

fn neighbours(
    both: &[PlacedKeyframe<'_>],
    component: impl Fn(&PlacedKeyframe<'_>) -> u32,
) -> Vec<(usize, usize)> {
    let poses: Vec<Pose> = both.iter().map(|k| k.world_from_camera).collect();
    let origin = |k: &PlacedKeyframe<'_>| {
        let KeyframeState { session, submap, .. } = *k.keyframe;
        Origin { session, submap, component: component(k) }
    };
    covisibility::pairs(&poses, &both.iter().map(origin).collect::<Vec<_>>(), &[])
}

/// As many of these pairs as are asked.
fn evenly(pairs: Vec<(usize, usize)>) -> Vec<(usize, usize)> {
    let step = pairs.len().div_ceil(MOST_ASKED).max(1);
    pairs.into_iter().step_by(step).collect()
}

/// Whether two joins bring the same components to the same place.
pub(crate) fn is_same_join(a: &JoinRecord, b: &JoinRecord) -> bool {
    let [motion_a, motion_b] = [a, b].map(|join| Pose::from(&join.kept_from_moved));
    (a.kept, a.moved) == (b.kept, b.moved) && apart_m(&motion_a, &motion_b) < FAR_M
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::test_wall::keyframe;
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
    fn a_third_component_takes_no_part() {
        let mut state = TrackerState::default();
        state.submaps.extend_to(2);
        let number = |id: u32| KeyframeState { submap: id % 3, session: id % 3, ..keyframe(id, 0, 0.0) };
        state.keyframes = (0..900).map(number).collect();
        let both = keyframes_of_both(&state, &joined(1, 0.0));
        assert_eq!(both.len(), 600);
        let pairs = evenly(neighbours(&both, |_| 0));
        assert!(pairs.len() > MOST_ASKED / 2 && pairs.len() <= MOST_ASKED, "{}", pairs.len());
    }
}
