//! Verification of a loop closure before it enters the graph (method 7): overlap, free space, and
//! the same pose from both directions.

use crate::map::records::LoopVerdict;
use crate::pairs::matchable::Matchable;
use crate::pairs::pair_alignment::{AlignedPair, PairAlignment};
use crate::settings::GlobalSettings;
use serde::{Deserialize, Serialize};
use tessera_geometry::Pose;
use tessera_graph::disagreement_sigmas;
use tessera_registration::{MatchLimits, Matcher};

/// Queries of a test: enough for shares to a few per cent.
pub(crate) const N_QUERIES: usize = 200;
/// Tightness of the limits from one outer iteration to the next; back, from where that leads, the last one is enough.
pub(crate) const FORWARD: [f32; 3] = [0.0, 1.0, 1.0];

/// Results of a loop pair's tests.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct Tested {
    /// Smaller share of queries with a match, of both directions.
    pub(crate) overlap: f64,
    /// Larger share of the queries in view that float in front of what the other saw there.
    pub(crate) in_front: f64,
    /// Root mean square disagreement between both directions, standard deviations.
    pub(crate) inconsistency_sigmas: f64,
    pub(crate) verdict: LoopVerdict,
}

/// Tests the pair at its own optimum, which it looks for from `newer`'s pose in `older`'s frame.
pub(crate) fn test(
    matcher: &mut Matcher,
    newer: &Matchable<'_>,
    older: &Matchable<'_>,
    older_from_newer: &Pose,
) -> Tested {
    let limits = |tightness: f32| MatchLimits::drifted(GlobalSettings::FIRST_DISTANCE_M, tightness);
    let alignment =
        PairAlignment { query: newer.queries(), target: older, n_queries: N_QUERIES, limits: &limits };
    let forward = alignment.solve(matcher, older_from_newer, &FORWARD);
    let newer_from_older = forward.target_from_query.inverse();
    let reversed = PairAlignment { query: older.queries(), target: newer, ..alignment };
    let backward = reversed.solve(matcher, &newer_from_older, &FORWARD[FORWARD.len() - 1..]);
    let (there, back) = (&forward.report, &backward.report);
    let overlap = there.overlap().min(back.overlap());
    let in_front = there.in_front().max(back.in_front());
    let factor = matcher.metric_factor();
    let disagreement = |pair: &AlignedPair, other: &AlignedPair| {
        disagreement_sigmas(&pair.block, pair.cost, &other.target_from_query.inverse(), factor)
    };
    let inconsistency_sigmas = disagreement(&forward, &backward).max(disagreement(&backward, &forward));
    let verdict = if !(overlap >= GlobalSettings::MIN_OVERLAP * 0.5) {
        LoopVerdict::LittleOverlap
    } else if !(in_front <= GlobalSettings::MAX_IN_FRONT) {
        LoopVerdict::FreeSpaceViolated
    } else if !(inconsistency_sigmas <= GlobalSettings::LOOP_RESIDUAL_SIGMAS) {
        LoopVerdict::Inconsistent
    } else {
        LoopVerdict::Accepted
    };
    Tested { overlap, in_front, inconsistency_sigmas, verdict }
}

/// Share of the query's points in view that float in front of what the target saw: at the pair's own optimum, which is
/// looked for as in [`test`], or where it is put, whichever is less, for by itself a pair was seen to end up to 0.3 m from
/// there, where something floats.
pub(crate) fn least_in_front(
    matcher: &mut Matcher,
    query: &Matchable<'_>,
    target: &Matchable<'_>,
    target_from_query: &Pose,
) -> f64 {
    let limits = |tightness: f32| MatchLimits::drifted(GlobalSettings::FIRST_DISTANCE_M, tightness);
    let alignment = PairAlignment { query: query.queries(), target, n_queries: N_QUERIES, limits: &limits };
    let at_optimum = alignment.solve(matcher, target_from_query, &FORWARD).report;
    let (_, as_placed) = alignment.search(matcher, target_from_query, 1.0);
    at_optimum.in_front().min(as_placed.in_front())
}
