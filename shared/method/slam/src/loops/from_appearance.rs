//! Loop closures by appearance, where drift hides them from the poses: keyframes with similar
//! descriptors are aligned without an initial guess.

use crate::loops::appearance::similarity;
use crate::loops::detection::{self, TrackPoint};
use crate::loops::matchable::Matchable;
use crate::loops::pair_alignment::PairAlignment;
use crate::loops::verification::{self, Tested};
use crate::map::context::Context;
use crate::map::records::LoopVerdict;
use crate::map::state::KeyframeState;
use crate::map::submaps::Origin;
use crate::settings::GlobalSettings;
use tessera_geometry::Pose;
use tessera_graph::{Pair, PairBlock, Schedule};
use tessera_numerics::parallel::map_in_parts;
use tessera_registration::{MatchLimits, Matcher};

/// First distance limit of an alignment from scratch, metres.
const FIRST_DISTANCE_M: f64 = 0.5;
/// Outer iterations of an alignment from scratch.
const ITERATIONS: u32 = 6;

/// The keyframe before `newer` in its component that looks most like it and is far enough away to close
/// a loop.
pub(crate) fn most_alike(
    context: &Context,
    keyframes: &[KeyframeState],
    origins: &[Origin],
    newer: usize,
) -> Option<usize> {
    let mapping = &context.mapping;
    let (similarity, older) = keyframes[..newer]
        .iter()
        .enumerate()
        .filter(|(place, older)| {
            origins[*place].component == origins[newer].component
                && detection::closes_loop(
                    &mapping.loops,
                    &TrackPoint::of_keyframe(&keyframes[newer]),
                    &TrackPoint::of_keyframe(older),
                )
        })
        .map(|(place, older)| (similarity(&keyframes[newer].place, &older.place), place))
        // The first among equals.
        .fold((0.0, None), |best, next| if next.0 > best.0 { (next.0, Some(next.1)) } else { best });
    older.filter(|_| similarity >= mapping.loops.min_similarity)
}

/// Pairs found by their looks among `newer`, with their matches at the pose that the pair alone
/// found: in a graph they pull as far as they must.
pub(crate) fn pairs(
    context: &Context,
    (keyframes, origins): (&[KeyframeState], &[Origin]),
    matchable: &[Matchable<'_>],
    newer: &[usize],
    progress: &mut dyn FnMut(),
) -> Vec<(Pair, Tested)> {
    let found = map_in_parts(
        newer,
        || context.matcher(),
        |matcher, &query| {
            let target = most_alike(context, keyframes, origins, query)?;
            let (newer, older) = (&matchable[query], &matchable[target]);
            let (at, block) = from_scratch(matcher, newer, older);
            let settings = &context.mapping.global;
            let tested = verification::test(settings, matcher, newer, older, &at);
            // No pose speaks for this pair: it must overlap well in both directions.
            let is_good = tested.verdict == LoopVerdict::Accepted && tested.overlap >= settings.min_overlap;
            is_good.then(|| (Pair { is_loop: true, ..Pair::new(query, target, block) }, tested))
        },
        progress,
    );
    found.into_iter().flatten().collect()
}

/// `older_from_newer` from no initial guess, and the tightest matches there.
fn from_scratch(matcher: &mut Matcher, newer: &Matchable<'_>, older: &Matchable<'_>) -> (Pose, PairBlock) {
    let alignment = PairAlignment {
        query: newer,
        target: older,
        n_queries: GlobalSettings::QUERIES_PER_PAIR,
        limits: &|tightness| MatchLimits::new(FIRST_DISTANCE_M, tightness),
    };
    let schedule = Schedule::shrinking(ITERATIONS, 0).tightness;
    let wider = &schedule[..schedule.len() - 1];
    let at = alignment.solve(matcher, &Pose::identity(), wider).target_from_query;
    (at, alignment.search(matcher, &at, 1.0).0)
}
