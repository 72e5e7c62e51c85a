//! The pairs of an optimisation with what is known of each, so that an iteration looks nothing up: kept in the order of
//! the search and filled once from what earlier corrections named.

use crate::map::records::MatchPose;
use crate::map::sorted_keys::values_of;
use crate::map::state::KeyframeState;
use crate::optimise::kept_matches::KeptMatches;
use crate::optimise::named_loops::NamedLoops;
use crate::pairs::feature_cache::PairIds;
use crate::pairs::match_cache::{MatchCache, MatchedPair};
use crate::pairs::verification::Tested;
use crate::pairs::weighted_pair::FeaturePair;
use std::iter::zip;
use std::sync::Arc;
use tessera_geometry::Pose;

/// A pair of keyframes with what is known of it.
#[derive(Clone, Debug, Default)]
pub(crate) struct KnownPair {
    /// The places of the newer keyframe and of the older one.
    pub(crate) places: (usize, usize),
    pub(crate) ids: PairIds,
    pub(crate) is_loop: bool,
    /// Where its matches were searched under the last limits, or its loop was refused.
    pub(crate) at: Option<(MatchPose, Pose)>,
    /// Whether that is of the last iteration.
    pub(crate) is_searched: bool,
    /// What the last correction that named it found.
    pub(crate) named: Option<Tested>,
    /// Its tests in this optimisation.
    pub(crate) tested: Option<Tested>,
    /// Those of the last iteration; `None` for odometry.
    pub(crate) judged: Option<Tested>,
    /// The features that both see, once they were looked for.
    pub(crate) seen: Option<Option<Arc<FeaturePair>>>,
    pub(crate) matched: Option<Arc<MatchedPair>>,
}

/// Pairs in the order of the search.
#[derive(Debug, Default)]
pub(crate) struct KnownPairs {
    pub(crate) pairs: Vec<KnownPair>,
    /// Their places in the order of their ids.
    by_ids: Vec<usize>,
}

impl KnownPairs {
    /// Pairs by the places of their keyframes, of which nothing is known.
    pub(crate) fn new(
        places: &[(usize, usize)],
        keyframes: &[KeyframeState],
        closes_loop: impl Fn((usize, usize)) -> bool,
    ) -> Self {
        let pair = |&places: &(usize, usize)| KnownPair {
            places,
            ids: (keyframes[places.0].id, keyframes[places.1].id),
            is_loop: closes_loop(places),
            ..KnownPair::default()
        };
        let mut by_ids: Vec<usize> = (0..places.len()).collect();
        by_ids.sort_unstable_by_key(|&k| places[k]);
        Self { pairs: places.iter().map(pair).collect(), by_ids }
    }

    /// Takes in what earlier optimisations left.
    pub(crate) fn recall(&mut self, kept: &KeptMatches, named: &NamedLoops, matches: &MatchCache) {
        let ids: Vec<PairIds> = self.in_order().map(|pair| pair.ids).collect();
        let known = zip(zip(kept.of(&ids), named.of(&ids)), matches.of(&ids));
        for (&k, ((at, named), matched)) in zip(&self.by_ids, known) {
            let at =
                at.map(|at| (at, matched.as_ref().map_or_else(|| at.pose(), |known| known.pose_at(&at))));
            self.pairs[k] = KnownPair { at, named, matched, ..std::mem::take(&mut self.pairs[k]) };
        }
    }

    /// Takes in what was found out of pairs that were chosen before.
    pub(crate) fn recall_from(&mut self, before: &Self) {
        let ids: Vec<PairIds> = self.in_order().map(|pair| pair.ids).collect();
        let known = values_of(ids.into_iter(), before.in_order().map(|pair| (&pair.ids, pair)));
        for (&k, known) in zip(&self.by_ids, known) {
            if let Some(known) = known {
                self.pairs[k] = KnownPair { places: self.pairs[k].places, ..known.clone() };
            }
        }
    }

    /// The pairs by their ids.
    pub(crate) fn in_order(&self) -> impl Iterator<Item = &KnownPair> {
        self.by_ids.iter().map(|&k| &self.pairs[k])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::records::{Correction, KeyframePose, LoopRecord, LoopVerdict};
    use crate::map::test_wall::keyframe;
    use tessera_geometry::PoseBits;

    fn named(pairs: &[(PairIds, f64)]) -> NamedLoops {
        let record = |&((newer, older), overlap): &(PairIds, f64)| LoopRecord {
            newer,
            older,
            overlap,
            in_front: 0.0,
            inconsistency_sigmas: 0.0,
            residual_sigmas: 0.0,
            weight: 1.0,
            verdict: LoopVerdict::Accepted,
        };
        let pose = |id| KeyframePose { id, world_from_camera: PoseBits::IDENTITY };
        let mut named = NamedLoops::default();
        named.take(&Correction {
            keyframes: (0..10).map(pose).collect(),
            loops: pairs.iter().map(record).collect(),
            ..Correction::default()
        });
        named
    }

    #[test]
    fn pairs_in_the_order_of_the_search_know_what_was_said_of_them_by_their_ids() {
        let keyframes = [2, 5, 7, 9].map(|id| keyframe(id, 0, 0.0));
        let named = named(&[((7, 2), 0.2), ((9, 2), 0.3), ((9, 7), 0.4)]);
        let overlaps = |pairs: &KnownPairs| -> Vec<Option<f64>> {
            pairs.pairs.iter().map(|pair| Some(pair.named?.overlap)).collect()
        };
        // By the older keyframe.
        let mut pairs = KnownPairs::new(&[(2, 0), (3, 0), (2, 1), (3, 2)], &keyframes, |_| true);
        pairs.recall(&KeptMatches::default(), &named, &MatchCache::default());
        assert_eq!(overlaps(&pairs), [Some(0.2), Some(0.3), None, Some(0.4)]);
        let in_order: Vec<PairIds> = pairs.in_order().map(|pair| pair.ids).collect();
        assert_eq!(in_order, [(7, 2), (7, 5), (9, 2), (9, 7)]);
        // Other pairs, of which two were among those.
        let mut others = KnownPairs::new(&[(1, 0), (3, 0), (3, 2)], &keyframes, |_| true);
        others.recall_from(&pairs);
        assert_eq!(overlaps(&others), [None, Some(0.3), Some(0.4)]);
        assert_eq!(others.pairs[0].ids, (5, 2));
    }
}
