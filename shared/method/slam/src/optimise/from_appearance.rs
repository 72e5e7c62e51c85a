//! Loop closures by appearance, where drift hides them from the poses: keyframes that look alike are
//! aligned from where their features agree, or without an initial guess.

use crate::evidence::pose_agreement::apart_m;
use crate::map::context::Context;
use crate::map::detection::{self, TrackPoint};
use crate::map::records::LoopVerdict;
use crate::map::state::KeyframeState;
use crate::map::submaps::Origin;
use crate::optimise::matchables::Matchables;
use crate::pairs::feature_cache::{AlikePair, FeatureCache, PairIds};
use crate::pairs::matchable::Matchable;
use crate::pairs::matching::{PairFinder, Reach};
use crate::pairs::pair_alignment::PairAlignment;
use crate::pairs::verification::{self, Tested};
use crate::settings::{GlobalSettings, MappingSettings};
use crate::tracking::degeneracy::is_determined;
use std::sync::Arc;
use tessera_geometry::Pose;
use tessera_graph::{Pair, PairBlock, Schedule};
use tessera_numerics::parallel::map_in_parts;
use tessera_registration::{MatchLimits, Matcher};

/// The keyframes that `newer` was said to look like, in that order, as far as they are of its component
/// and far enough away to close a loop.
fn candidates(
    context: &Context,
    keyframes: &[KeyframeState],
    origins: &[Origin],
    newer: usize,
) -> impl Iterator<Item = usize> {
    let alike = keyframes[newer].alike.iter();
    let places = alike.filter_map(|id| keyframes.binary_search_by_key(id, |keyframe| keyframe.id).ok());
    places.filter(move |&older| {
        let [new, old] = [newer, older].map(|place| TrackPoint::of_keyframe(&keyframes[place]));
        older < newer
            && origins[older].component == origins[newer].component
            && detection::closes_loop(&context.mapping.loops, &new, &old)
    })
}

/// A pair found by its looks, with its matches at the pose that the pair alone found: in a graph it pulls as far
/// as it must.
pub(crate) struct RecognisedPair {
    pub(crate) pair: Pair,
    pub(crate) tested: Tested,
    /// How far that is from where the poses have it ([`apart_m`]).
    pub(crate) apart_m: f64,
}

/// Which pairs are looked for.
pub(crate) struct AskedPairs<'a> {
    /// The newer keyframes of them.
    pub(crate) newer: &'a [usize],
    pub(crate) poses: &'a [Pose],
    /// How far a pair may be from where the poses have it ([`apart_m`]).
    pub(crate) most_apart_m: f64,
    /// Whether a pair is known to be of two places that look alike.
    pub(crate) is_refused: &'a (dyn Fn(&PairIds) -> bool + Sync),
}

/// Pairs found by their looks.
pub(crate) fn pairs(
    context: &Context,
    (keyframes, origins): (&[KeyframeState], &[Origin]),
    (matchables, cache): (&Matchables<'_>, &FeatureCache),
    asked: &AskedPairs<'_>,
    progress: &mut dyn FnMut(),
) -> Vec<RecognisedPair> {
    let AskedPairs { newer, poses, most_apart_m, is_refused } = *asked;
    let found = map_in_parts(
        newer,
        || (context.matcher(), PairFinder::new(context)),
        |searchers, &query| {
            candidates(context, keyframes, origins, query).find_map(|target| {
                let ids = (keyframes[query].id, keyframes[target].id);
                if is_refused(&ids) {
                    return None;
                }
                let sides = || [query, target].map(|k| matchables.get(k));
                let found = cache.alike(ids, || alike(context, searchers, sides(), ids).map(Arc::new))?;
                let apart_m = apart_m(&(poses[target].inverse() * poses[query]), &found.older_from_newer);
                let pair = Pair { is_loop: true, ..Pair::new(query, target, found.block.clone()) };
                let recognised = RecognisedPair { pair, tested: found.tested, apart_m };
                (apart_m <= most_apart_m).then_some(recognised)
            })
        },
        progress,
    );
    found.into_iter().flatten().collect()
}

/// A pair aligned by itself; `None` where it does not pass the tests.
fn alike(
    context: &Context,
    (matcher, finder): &mut (Matcher, PairFinder),
    [newer, older]: [&Matchable<'_>; 2],
    ids: (u32, u32),
) -> Option<AlikePair> {
    let seed = u64::from(ids.0) << 32 | u64::from(ids.1);
    let guess = by_features(context, finder, newer, older, seed);
    let (at, block) = aligned(&context.mapping, matcher, [newer, older], guess);
    // Bare walls fit wherever they are tried: what they leave open only features can tell.
    if guess.is_none() && !is_determined(context, &block.linearise(&at).0) {
        return None;
    }
    let tested = verification::test(matcher, newer, older, &at);
    // No pose speaks for this pair: it must overlap well in both directions.
    let is_good = tested.verdict == LoopVerdict::Accepted && tested.overlap >= GlobalSettings::MIN_OVERLAP;
    is_good.then_some(AlikePair { older_from_newer: at, block, tested })
}

/// `older_from_newer` on which features agree.
fn by_features(
    context: &Context,
    finder: &mut PairFinder,
    newer: &Matchable<'_>,
    older: &Matchable<'_>,
    seed: u64,
) -> Option<Pose> {
    let sides = [newer, older].map(|side| side.seen(context));
    let found = finder.find(context, sides, &Pose::identity(), Reach::Anywhere, seed)?;
    Some(found.target_from_query)
}

/// `older_from_newer` from a guess or from none, and the tightest matches there.
fn aligned(
    mapping: &MappingSettings,
    matcher: &mut Matcher,
    [newer, older]: [&Matchable<'_>; 2],
    guess: Option<Pose>,
) -> (Pose, PairBlock) {
    let first_m =
        if guess.is_some() { GlobalSettings::FIRST_DISTANCE_M } else { mapping.first_distance_m()[1] };
    let alignment = PairAlignment {
        query: newer.queries(),
        target: older,
        n_queries: GlobalSettings::QUERIES_PER_PAIR,
        limits: &|tightness| MatchLimits::new(first_m, tightness),
    };
    let schedule = Schedule::shrinking(mapping.outer_iterations(), 0).tightness;
    let wider = &schedule[..schedule.len() - 1];
    let at = alignment.solve(matcher, &guess.unwrap_or_else(Pose::identity), wider).target_from_query;
    (at, alignment.search(matcher, &at, 1.0).0)
}
