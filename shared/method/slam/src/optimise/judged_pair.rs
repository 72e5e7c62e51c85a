//! One pair of keyframes in an iteration: from what is known of it to a pair of the graph.

use crate::map::records::{LoopVerdict, MatchPose};
use crate::optimise::association::Keyframes;
use crate::optimise::keyframe_searches::PairSearcher;
use crate::optimise::known_pairs::KnownPair;
use crate::optimise::of_track::is_of_track;
use crate::pairs::keyframe_pair::MIN_FEATURES;
use crate::pairs::match_cache::{MatchedPair, has_left};
use crate::pairs::verification::Tested;
use crate::pairs::weighted_pair::FeaturePair;
use std::sync::Arc;
use tessera_geometry::Pose;
use tessera_graph::Pair;

impl<'a> Keyframes<'a> {
    /// The pair at these poses under the limits of an iteration; `None` where it does not count.
    pub(crate) fn search_one(
        &self,
        searcher: &mut PairSearcher<'a>,
        poses: &[Pose],
        known: &mut KnownPair,
        tightness: f32,
    ) -> Option<Pair> {
        let (query, target) = known.places;
        let now = poses[target].inverse() * poses[query];
        let kept = known.at.filter(|(_, pose)| !has_left(pose, &now));
        // What was refused somewhere else is tested again.
        let named = known.named.filter(|named| kept.is_some() || !named.verdict.is_of_where_it_was());
        let before = if known.is_loop { known.tested.or(named) } else { None };
        let tested = before.or_else(|| known.is_loop.then(|| self.test(searcher, known.places, &now)));
        let verdict = tested.map_or(LoopVerdict::Accepted, |tested| tested.verdict);
        let seen = self.seen(searcher, known, verdict, &kept.map_or(now, |(_, pose)| pose));
        known.seen = Some(seen.clone());
        let is_rescued = verdict == LoopVerdict::LittleOverlap
            && seen.as_ref().is_some_and(|pair| pair.sums.n >= MIN_FEATURES);
        if verdict != LoopVerdict::Accepted && !is_rescued {
            known.at = kept.or_else(|| Some(rounded(&now)));
            (known.is_searched, known.judged) = (true, tested);
            known.tested = if before.is_none() { tested } else { known.tested };
            return None;
        }
        let (matched, has_stayed) = self.matched_now(searcher, known, (&now, kept, tightness), seen.clone());
        let tested = tested.map(|tested| {
            let verdict = match has_stayed {
                // As it was when it was searched.
                true => LoopVerdict::Accepted,
                false => self.by_features(tested.verdict, known.places, seen.as_deref(), || {
                    matched.block.linearise(&now).0
                }),
            };
            Tested { verdict, ..tested }
        });
        if before.map(|k| k.verdict) != tested.map(|t| t.verdict) {
            known.tested = tested;
        }
        known.judged = tested;
        let is_consecutive = query == target + 1 && self.origins[query] == self.origins[target];
        let is_good = tested.is_none_or(|t| t.verdict == LoopVerdict::Accepted);
        (is_good && matched.counts(is_consecutive)).then(|| {
            let own_cost = known.is_loop.then(|| matched.own_cost());
            Pair { is_loop: known.is_loop, own_cost, ..Pair::new(query, target, matched.block.clone()) }
        })
    }

    /// The features of a pair that are a part of it; those that many overlap say more than a little depth.
    fn seen(
        &self,
        searcher: &mut PairSearcher<'a>,
        known: &KnownPair,
        verdict: LoopVerdict,
        near: &Pose,
    ) -> Option<Arc<FeaturePair>> {
        if !matches!(verdict, LoopVerdict::Accepted | LoopVerdict::LittleOverlap) {
            return None;
        }
        let found = || self.shared(searcher, known.places, near);
        let seen = known.seen.clone().unwrap_or_else(found);
        let [newer, older] = [known.places.0, known.places.1].map(|k| &self.keyframes[k]);
        seen.filter(|f| known.is_loop || is_of_track((newer, older), f, self.context.scales.features))
    }

    /// The pair with its matches, and whether they are those from before: they were where they are kept.
    fn matched_now(
        &self,
        searcher: &mut PairSearcher<'a>,
        known: &mut KnownPair,
        (now, kept, tightness): (&Pose, Option<(MatchPose, Pose)>, f32),
        seen: Option<Arc<FeaturePair>>,
    ) -> (Arc<MatchedPair>, bool) {
        let factor = searcher.matcher.metric_factor();
        let features = (seen, self.context.feature_weight() * factor);
        let stays = kept.map(|at| self.matched(searcher, known, at, features.clone()));
        let stays = stays.filter(|matched| !matched.has_moved(now, factor));
        known.is_searched = stays.is_some() || tightness >= 1.0;
        match stays {
            Some(matched) => (matched, true),
            None if tightness < 1.0 => {
                (self.searched_widely(searcher, known.places, (now, tightness), features), false)
            }
            None => {
                let at = rounded(now);
                known.at = Some(at);
                (self.matched(searcher, known, at, features), false)
            }
        }
    }
}

/// A pose where matches are searched.
fn rounded(now: &Pose) -> (MatchPose, Pose) {
    let at = MatchPose::of(now);
    (at, at.pose())
}
