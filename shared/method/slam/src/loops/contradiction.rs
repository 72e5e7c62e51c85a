//! Whether what two components saw contradicts their join: rooms that look alike agree in themselves, but what
//! is about them does not (method 12.9).

use crate::loops::covisibility;
use crate::loops::matchable::Matchable;
use crate::loops::track_ends::at_track_ends;
use crate::loops::verification::{self, InFront};
use crate::map::context::Context;
use crate::map::records::{JoinRecord, LoopVerdict};
use crate::map::state::{KeyframeState, TrackerState};
use crate::map::submaps::Origin;
use crate::map::surfaces::KeyframeSurfaces;
use crate::settings::GlobalSettings;
use nalgebra::Vector3;
use tessera_geometry::{Pose, translation_rotation_norms};
use tessera_numerics::parallel::map_in_parts;
use tessera_registration::{Matcher, Sampler};

/// Pairs of keyframes by which a join is tested, at most.
const MOST_TESTED: usize = 200;

/// What of pairs of keyframes says that a join is wrong, but for what passes by.
#[derive(Clone, Copy)]
pub(crate) struct Evidence {
    /// Share of what the one saw that floats in front of what the other saw, by which a pair says so.
    in_front: f64,
    /// Whether pairs that agree as loops are asked too, where they overlap enough to be sure of their optimum.
    is_of_all: bool,
    /// At least so many pairs, and more than this share of those that agree.
    least: usize,
    most_share: f64,
}

/// In a run, whose frames wait: pairs that violate free space as loops. Right joins were seen to have none, joins of
/// rooms that look alike 4.5 to 7.7 %.
pub(crate) const IN_RUN: Evidence =
    Evidence { in_front: GlobalSettings::MAX_IN_FRONT, is_of_all: false, least: 3, most_share: 0.025 };
/// In a base, which has thinned surfaces: of them too little floats where another room is seen through a door. Right
/// joins were seen to have up to 2.7 %, joins of rooms that look alike 7.5 % and more.
pub(crate) const IN_BASE: Evidence =
    Evidence { in_front: 0.5 * GlobalSettings::MAX_IN_FRONT, is_of_all: true, least: 4, most_share: 0.05 };

/// Part of [`Evidence::in_front`] that another keyframe of its own component saw through of what one saw, by which it
/// is told that something moves. Where a person walks, most neighbours see a half of what floats or more; what stays
/// where it is they do not see through at all.
const SEEN_THROUGH: f64 = 0.5;
/// What is about the place at which two components of one run are joined, metres.
const ABOUT_M: f64 = 6.0;
/// Joins that differ by more bring two components to different places, metres and radians.
const APART_M: f64 = 1.0;
const APART_RAD: f64 = 0.5;

/// A keyframe where it is tested.
pub(crate) struct PlacedKeyframe<'a> {
    pub(crate) keyframe: &'a KeyframeState,
    pub(crate) world_from_camera: Pose,
}

/// A keyframe of either component of a join, where that puts it.
struct JoinedKeyframe<'a> {
    placed: PlacedKeyframe<'a>,
    is_moved: bool,
}

impl JoinedKeyframe<'_> {
    fn origin(&self, component: u32) -> Origin {
        let KeyframeState { session, submap, .. } = *self.placed.keyframe;
        Origin { session, submap, component }
    }
}

/// Whether keyframes of both components, which a join brings near each other, say that it is wrong. The same for
/// any number of threads. With a place in the gauge that stays, what is farther than [`ABOUT_M`] from it says nothing:
/// components have drifted in themselves. Without one, what is at the end of its track says nothing.
pub(crate) fn is_contradicted(
    context: &Context,
    state: &TrackerState,
    surfaces: &dyn KeyframeSurfaces,
    joined: &JoinRecord,
    place: Option<&Vector3<f64>>,
) -> bool {
    let mut both = keyframes_of_both(state, joined);
    let evidence = if let Some(place) = place {
        both.retain(|k| (k.placed.world_from_camera.translation.vector - place).norm() <= ABOUT_M);
        IN_RUN
    } else {
        let ends = at_track_ends(&state.keyframes);
        both.retain(|k| ends.get(k.placed.keyframe.id as usize) != Some(&true));
        IN_BASE
    };
    let across = pairs_across(&both, joined.kept);
    let own = own_pairs(&both);
    let placed: Vec<PlacedKeyframe<'_>> = both.into_iter().map(|joined| joined.placed).collect();
    contradict(context, evidence, &placed, surfaces, across, || OwnNeighbours::of(own))
}

/// Whether pairs of keyframes of two parts of a map contradict each other: what the one saw floats in front of
/// what the other saw. What passes by ([`passes`]) says nothing; `own`: neighbours of one part.
pub(crate) fn contradict(
    context: &Context,
    evidence: Evidence,
    both: &[PlacedKeyframe<'_>],
    surfaces: &dyn KeyframeSurfaces,
    across: Vec<(usize, usize)>,
    own: impl FnOnce() -> OwnNeighbours,
) -> bool {
    let tester = || PairTester::new(context, both, surfaces);
    let test = |tester: &mut PairTester<'_>, pair: &(usize, usize)| tester.says(evidence, pair);
    let said = map_in_parts(&across, tester, test, &mut || ());
    let n_agreed = said.iter().filter(|said| matches!(said, Said::Agrees)).count();
    let is_many = |n: usize| n >= evidence.least && n as f64 > evidence.most_share * n_agreed as f64;
    let floating = said.into_iter().filter_map(|said| match said {
        Said::Contradicts(owners) => Some(owners),
        Said::Agrees | Said::Nothing => None,
    });
    let floating: Vec<Vec<usize>> = floating.collect();
    is_many(floating.len()) && is_many(floating.len() - n_passing(&tester, evidence, &floating, &own()))
}

/// What a pair of keyframes says of a join.
enum Said {
    Agrees,
    Nothing,
    /// With the keyframes of which what they saw floats.
    Contradicts(Vec<usize>),
}

/// Of pairs in which something floats, those in which all of it passes by.
fn n_passing<'a>(
    tester: &(impl Fn() -> PairTester<'a> + Sync),
    evidence: Evidence,
    floating: &[Vec<usize>],
    neighbours: &OwnNeighbours,
) -> usize {
    let mut owners: Vec<usize> = floating.concat();
    owners.sort_unstable();
    owners.dedup();
    let seen_through = SEEN_THROUGH * evidence.in_front;
    let passes = |tester: &mut PairTester<'a>, own: &usize| passes(tester, neighbours, *own, seen_through);
    let passing = map_in_parts(&owners, tester, passes, &mut || ());
    let is_passing = |own: &usize| owners.binary_search(own).is_ok_and(|place| passing[place]);
    floating.iter().filter(|owners| !owners.is_empty() && owners.iter().all(is_passing)).count()
}

/// Whether what a keyframe saw moves: its own component saw through it before or after, as where a person
/// walks. What stays where it is was never seen through.
fn passes(tester: &mut PairTester<'_>, neighbours: &OwnNeighbours, own: usize, seen_through: f64) -> bool {
    neighbours.around(own).any(|neighbour| tester.in_front(own, neighbour).at_optimum > seen_through)
}

/// Tests pairs of keyframes where the join puts them; holds the buffers.
struct PairTester<'a> {
    context: &'a Context,
    both: &'a [PlacedKeyframe<'a>],
    surfaces: &'a dyn KeyframeSurfaces,
    matcher: Matcher,
    sampler: Sampler,
}

impl<'a> PairTester<'a> {
    fn new(context: &'a Context, both: &'a [PlacedKeyframe<'a>], surfaces: &'a dyn KeyframeSurfaces) -> Self {
        Self { context, both, surfaces, matcher: context.matcher(), sampler: Sampler::default() }
    }

    fn says(&mut self, evidence: Evidence, &(newer, older): &(usize, usize)) -> Said {
        let (sides, older_from_newer) = self.sides(newer, older);
        let settings = &self.context.mapping.global;
        let tested = verification::test(settings, &mut self.matcher, &sides[0], &sides[1], &older_from_newer);
        let is_violated = tested.verdict == LoopVerdict::FreeSpaceViolated;
        let is_asked = is_violated || evidence.is_of_all && tested.overlap >= settings.min_overlap;
        let floating: Vec<usize> = [(newer, older), (older, newer)]
            .into_iter()
            .filter(|(own, other)| is_asked && self.floats(*own, *other, evidence))
            .map(|(own, _)| own)
            .collect();
        // A loop is refused where what floats is seen on the way from one optimum to the other.
        let contradicts = if evidence.is_of_all { !floating.is_empty() } else { is_violated };
        match tested.verdict {
            _ if contradicts => Said::Contradicts(floating),
            LoopVerdict::Accepted => Said::Agrees,
            _ => Said::Nothing,
        }
    }

    /// Whether too much of what the first one saw floats in front of what the second one saw. In a base where the
    /// join puts it, too: a pair by itself was seen to end up to 0.3 m from there, where something floats.
    fn floats(&mut self, query: usize, target: usize, evidence: Evidence) -> bool {
        let InFront { at_optimum, as_placed } = self.in_front(query, target);
        let share = if evidence.is_of_all { at_optimum.min(as_placed) } else { at_optimum };
        share > evidence.in_front
    }

    fn in_front(&mut self, query: usize, target: usize) -> InFront {
        let (sides, target_from_query) = self.sides(query, target);
        verification::in_front(&mut self.matcher, &sides[0], &sides[1], &target_from_query)
    }

    /// Both keyframes, and the pose of the first in the second one's frame.
    fn sides(&mut self, a: usize, b: usize) -> ([Matchable<'a>; 2], Pose) {
        let Self { context, both, surfaces, sampler, .. } = self;
        let sides = [a, b].map(|at| Matchable::new(context, sampler, both[at].keyframe, *surfaces));
        (sides, both[b].world_from_camera.inverse() * both[a].world_from_camera)
    }
}

/// By keyframe: those of its own part that see the same.
pub(crate) struct OwnNeighbours(Vec<(usize, usize)>);

impl OwnNeighbours {
    pub(crate) fn of(pairs: Vec<(usize, usize)>) -> Self {
        let mut both_ways: Vec<(usize, usize)> =
            pairs.into_iter().flat_map(|(a, b)| [(a, b), (b, a)]).collect();
        both_ways.sort_unstable();
        Self(both_ways)
    }

    fn around(&self, own: usize) -> impl Iterator<Item = usize> {
        let first = self.0.partition_point(|(of, _)| *of < own);
        self.0[first..].iter().take_while(move |(of, _)| *of == own).map(|(_, neighbour)| *neighbour)
    }
}

fn keyframes_of_both<'a>(state: &'a TrackerState, joined: &JoinRecord) -> Vec<JoinedKeyframe<'a>> {
    let kept_from_moved = Pose::from(&joined.kept_from_moved);
    let place = |keyframe: &'a KeyframeState| {
        let (component, pose) =
            (state.submaps.component(keyframe.submap), Pose::from(&keyframe.world_from_camera));
        let is_moved = component == joined.moved;
        let world_from_camera = if is_moved { kept_from_moved * pose } else { pose };
        let placed = PlacedKeyframe { keyframe, world_from_camera };
        (is_moved || component == joined.kept).then_some(JoinedKeyframe { placed, is_moved })
    };
    state.keyframes.iter().filter(|k| k.is_active()).filter_map(place).collect()
}

/// Pairs of neighbours of which one is of either component, evenly chosen from all.
fn pairs_across(both: &[JoinedKeyframe<'_>], component: u32) -> Vec<(usize, usize)> {
    let mut across = neighbours(both, |_| component);
    across.retain(|(newer, older)| both[*newer].is_moved != both[*older].is_moved);
    evenly(across)
}

/// Pairs of neighbours of one component.
fn own_pairs(both: &[JoinedKeyframe<'_>]) -> Vec<(usize, usize)> {
    neighbours(both, |k| u32::from(k.is_moved))
}

fn neighbours(
    both: &[JoinedKeyframe<'_>],
    component: impl Fn(&JoinedKeyframe<'_>) -> u32,
) -> Vec<(usize, usize)> {
    let poses: Vec<Pose> = both.iter().map(|k| k.placed.world_from_camera).collect();
    let origins: Vec<Origin> = both.iter().map(|k| k.origin(component(k))).collect();
    covisibility::pairs(&poses, &origins)
}

/// As many of these pairs as are tested.
pub(crate) fn evenly(pairs: Vec<(usize, usize)>) -> Vec<(usize, usize)> {
    let step = pairs.len().div_ceil(MOST_TESTED).max(1);
    pairs.into_iter().step_by(step).collect()
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
