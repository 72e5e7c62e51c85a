//! Loops that the poses do not show because drift has carried them too far: keyframes that look
//! alike are aligned from scratch.

use crate::context::Context;
use crate::global::Prepared;
use crate::loops;
use crate::parts::map_in_parts;
use crate::records::LoopVerdict;
use crate::robust::own_optimum;
use crate::state::KeyframeState;
use crate::verify::{self, Tested};
use tessera_geometry::Pose;
use tessera_recognition::similarity;
use tessera_registration::{MatchLimits, Matcher, Pair, PairBlock, Selection};

/// First distance limit of an alignment from scratch, metres.
const FIRST_DISTANCE_M: f64 = 0.5;
/// Outer iterations of an alignment from scratch.
const ITERATIONS: usize = 6;

/// The keyframe before `newer` that looks most like it and is far enough away to close a loop.
pub(crate) fn most_alike(context: &Context, keyframes: &[KeyframeState], newer: usize) -> Option<usize> {
    let mapping = &context.mapping;
    let (similarity, older) = keyframes[..newer]
        .iter()
        .enumerate()
        .filter(|(_, older)| loops::are_far(&mapping.loops, &keyframes[newer], older))
        .map(|(place, older)| (similarity(&keyframes[newer].place, &older.place), place))
        // The first among equals.
        .fold((0.0, None), |best, next| if next.0 > best.0 { (next.0, Some(next.1)) } else { best });
    older.filter(|_| similarity >= mapping.loops.min_similarity)
}

/// Pairs found by their looks among `newer`, with their matches at the pose that the pair alone
/// found: in a graph they pull as far as they must.
pub(crate) fn pairs(
    context: &Context,
    keyframes: &[KeyframeState],
    prepared: &[Prepared<'_>],
    newer: &[usize],
    progress: &mut dyn FnMut(),
) -> Vec<(Pair, Tested)> {
    let found = map_in_parts(
        newer,
        || context.matcher(),
        |matcher, &query| {
            let target = most_alike(context, keyframes, query)?;
            let (at, block) = from_scratch(context, matcher, &prepared[query], &prepared[target]);
            let settings = &context.mapping.global;
            let (newer, older) = (prepared[query].side(), prepared[target].side());
            let tested = verify::test(settings, matcher, &newer, &older, &at);
            // No pose speaks for this pair: it must overlap well in both directions.
            let is_good = tested.verdict == LoopVerdict::Accepted && tested.overlap >= settings.min_overlap;
            is_good.then_some((Pair { query, target, block, weight: 1.0 }, tested))
        },
        progress,
    );
    found.into_iter().flatten().collect()
}

fn from_scratch(
    context: &Context,
    matcher: &mut Matcher,
    newer: &Prepared<'_>,
    older: &Prepared<'_>,
) -> (Pose, PairBlock) {
    let selection = Selection { count: context.mapping.global.queries_per_pair as usize, shift: 0 };
    let target = older.target();
    let mut at = Pose::identity();
    let mut k = 0;
    loop {
        let progress = k as f32 / (ITERATIONS - 1) as f32;
        let limits = MatchLimits::new(FIRST_DISTANCE_M, progress);
        let (sums, _) = matcher.match_pair(&newer.queries, selection, &target, &at, &limits);
        let block = PairBlock::new(&at, &sums);
        k += 1;
        if k == ITERATIONS {
            return (at, block);
        }
        at = own_optimum(&block, &at).0;
    }
}
