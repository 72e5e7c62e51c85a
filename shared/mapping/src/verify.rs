//! Whether a loop pair may enter the graph (SPEC 7): overlap, free space, and the same answer
//! from both directions.

use crate::records::{LoopRecord, LoopVerdict};
use crate::robust::{disagreement_sigmas, own_optimum};
use crate::settings::GlobalSettings;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use tessera_geometry::Pose;
use tessera_registration::Target;
use tessera_registration::{BlockSums, MatchLimits, Matcher, PairBlock, PairReport, Queries, Selection};

/// Queries of a test: enough for shares to a few per cent.
const N_QUERIES: usize = 200;

/// A keyframe as both sides of a pair need it.
#[derive(Clone, Copy)]
pub(crate) struct Side<'a> {
    pub(crate) queries: &'a Queries,
    pub(crate) target: Target<'a>,
}

/// What the tests of a loop pair found.
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

/// Tests by the ids of the newer and the older keyframe.
pub(crate) type KnownLoops = BTreeMap<(u32, u32), Tested>;

impl Tested {
    /// What a record says of a pair that passed.
    pub(crate) fn accepted(record: &LoopRecord) -> Self {
        Self {
            overlap: record.overlap,
            in_front: record.in_front,
            inconsistency_sigmas: record.inconsistency_sigmas,
            verdict: LoopVerdict::Accepted,
        }
    }
}

/// Tests the pair at its own optimum, which it looks for from `newer`'s pose in `older`'s frame.
pub(crate) fn test(
    settings: &GlobalSettings,
    matcher: &mut Matcher,
    newer: &Side<'_>,
    older: &Side<'_>,
    older_from_newer: &Pose,
) -> Tested {
    let limits = |progress| MatchLimits::drifted(settings.first_distance_m, progress);
    let mut find = |query: &Side<'_>, target: &Side<'_>, at: &Pose, progress: f32| {
        let selection = Selection { count: N_QUERIES, shift: 0 };
        let (sums, report): (BlockSums, PairReport) =
            matcher.match_pair(query.queries, selection, &target.target, at, &limits(progress));
        let block = PairBlock::new(at, &sums);
        let (own, cost) = own_optimum(&block, at);
        (block, own, cost, report)
    };
    let (_, near, _, _) = find(newer, older, older_from_newer, 0.0);
    let (_, near, _, _) = find(newer, older, &near, 1.0);
    let (forward, forward_own, forward_cost, there) = find(newer, older, &near, 1.0);
    let (backward, backward_own, backward_cost, back) = find(older, newer, &forward_own.inverse(), 1.0);
    let factor = matcher.metric_factor();
    let share = |part: u32, whole: u32| f64::from(part) / f64::from(whole.max(1));
    let overlap = share(there.n_matches, there.n_queries).min(share(back.n_matches, back.n_queries));
    let in_front = share(there.n_in_front, there.n_in_view).max(share(back.n_in_front, back.n_in_view));
    let inconsistency_sigmas = disagreement_sigmas(&forward, forward_cost, &backward_own.inverse(), factor)
        .max(disagreement_sigmas(&backward, backward_cost, &forward_own.inverse(), factor));
    let verdict = if !(overlap >= settings.min_overlap * 0.5) {
        LoopVerdict::LittleOverlap
    } else if !(in_front <= settings.max_in_front) {
        LoopVerdict::FreeSpaceViolated
    } else if !(inconsistency_sigmas <= settings.max_inconsistency_sigmas) {
        LoopVerdict::Inconsistent
    } else {
        LoopVerdict::Accepted
    };
    Tested { overlap, in_front, inconsistency_sigmas, verdict }
}
