//! Data association between all keyframes: neighbours by pose, verified loop closures, and loops
//! recognised by appearance.

use crate::map::context::Context;
use crate::map::records::{LoopRecord, LoopVerdict, MatchPose};
use crate::map::state::KeyframeState;
use crate::map::submaps::Origin;
use crate::optimise::from_appearance::{self, AskedPairs};
use crate::optimise::kept_matches::KeptMatches;
use crate::optimise::keyframe_searches::PairSearcher;
use crate::optimise::matchables::Matchables;
use crate::optimise::of_track::is_of_track;
use crate::pairs::covisibility;
use crate::pairs::feature_cache::{FeatureCache, PairIds};
use crate::pairs::keyframe_pair::MIN_FEATURES;
use crate::pairs::match_cache::{MatchCache, has_left};
use crate::pairs::matching::{PairFinder, Reach};
use crate::pairs::verification::{KnownLoops, Tested};
use crate::pairs::weighted_pair::FeaturePair;
use std::collections::BTreeMap;
use std::sync::Arc;
use tessera_geometry::Pose;
use tessera_graph::{DataAssociation, OuterIteration, Pair, Solved};
use tessera_numerics::Step;
use tessera_numerics::parallel::map_in_parts;

/// The pairs of all keyframes, each a vertex.
pub(crate) struct KeyframeAssociation<'a> {
    pub(crate) of: Keyframes<'a>,
    /// Tests of loops in this optimisation.
    known: KnownLoops,
    /// How far pairs by appearance may be from where the poses have them, metres.
    pub(crate) most_apart_m: f64,
    /// Those that there are, and how far each is.
    pub(crate) recognised: Vec<(PairIds, f64)>,
    /// Pairs that are part of each iteration as they are.
    pub(crate) fixed_pairs: Vec<Pair>,
    /// Where the matches of pairs were searched, or their loops refused, in this optimisation.
    pub(crate) searched: BTreeMap<PairIds, MatchPose>,
    /// The poses at which the pairs were chosen, and these.
    chosen: (Vec<Pose>, Vec<(usize, usize)>),
    /// Features by ids of the newer and the older keyframe, where they were looked for.
    seen: SeenPairs,
    /// The tests of the present pairs; `None` for odometry.
    tests: Vec<Option<Tested>>,
    /// Loops that the present pairs do not hold.
    rejected: Vec<LoopRecord>,
}

/// What pairs are made of, and what is known of them.
pub(crate) struct Keyframes<'a> {
    pub(crate) context: &'a Context,
    pub(crate) keyframes: &'a [KeyframeState],
    pub(crate) origins: &'a [Origin],
    pub(crate) matchables: Matchables<'a>,
    pub(crate) cache: &'a FeatureCache,
    pub(crate) matches: &'a MatchCache,
    /// Loops that are not tested again.
    pub(crate) settled: &'a KnownLoops,
    /// Where earlier optimisations searched, and what they refused there.
    pub(crate) kept: &'a KeptMatches,
    pub(crate) refused: &'a KnownLoops,
}

/// Features that two keyframes share, by the ids of the newer and the older.
type SeenPairs = BTreeMap<PairIds, Option<Arc<FeaturePair>>>;

/// A pair of keyframes that one outer iteration looked at.
struct SearchedPair {
    ids: PairIds,
    /// As a pair of the graph; `None` where it does not count.
    pair: Option<Pair>,
    /// The tests that it had to pass, if it closes a loop.
    tested: Option<Tested>,
    /// Whether these were known.
    is_known: bool,
    seen: Option<Arc<FeaturePair>>,
    /// Where its matches were searched under the last limits, or its loop was refused.
    at: Option<MatchPose>,
}

impl<'a> KeyframeAssociation<'a> {
    pub(crate) fn new(of: Keyframes<'a>) -> Self {
        Self {
            of,
            known: KnownLoops::new(),
            most_apart_m: f64::INFINITY,
            recognised: Vec::new(),
            fixed_pairs: Vec::new(),
            searched: BTreeMap::new(),
            chosen: Default::default(),
            seen: SeenPairs::new(),
            tests: Vec::new(),
            rejected: Vec::new(),
        }
    }

    /// Chooses the pairs, again where a pose moved as far as drift may have carried it.
    fn choose(&mut self, poses: &[Pose]) {
        let (at, pairs) = &mut self.chosen;
        let is_near = at.len() == poses.len() && at.iter().zip(poses).all(|(at, now)| !has_left(at, now));
        if !is_near {
            let kept = self.of.kept.places(&self.of.keyframes.iter().map(|k| k.id).collect::<Vec<_>>());
            (*at, *pairs) = (poses.to_vec(), covisibility::pairs(poses, self.of.origins, &kept));
        }
    }

    fn search(&self, poses: &[Pose], tightness: f32, progress: &mut dyn FnMut()) -> Vec<SearchedPair> {
        let context = self.of.context;
        map_in_parts(
            &self.chosen.1,
            || PairSearcher { matcher: context.matcher(), finder: PairFinder::new(context), looked_at: None },
            |searcher, &places| self.search_one(searcher, poses, places, tightness),
            progress,
        )
    }

    fn tested(&self, pair: &PairIds) -> Option<&Tested> {
        self.known.get(pair).or_else(|| self.of.settled.get(pair))
    }

    fn search_one(
        &self,
        searcher: &mut PairSearcher<'a>,
        poses: &[Pose],
        places: (usize, usize),
        tightness: f32,
    ) -> SearchedPair {
        let (of, (query, target)) = (&self.of, places);
        let [newer, older] = [query, target].map(|k| &of.keyframes[k]);
        let ids = (newer.id, older.id);
        let now = poses[target].inverse() * poses[query];
        let kept = self.searched.get(&ids).copied().or_else(|| of.kept.of(ids)).map(|at| (at, at.pose()));
        let kept = kept.filter(|(_, pose)| !has_left(pose, &now));
        let is_loop = of.closes_loop(places);
        let refused = || of.refused.get(&ids).filter(|_| kept.is_some());
        let known = if is_loop { self.tested(&ids).or_else(refused).copied() } else { None };
        let tested = known.or_else(|| is_loop.then(|| of.test(searcher, places, &now)));
        let verdict = tested.map_or(LoopVerdict::Accepted, |tested| tested.verdict);
        let near = kept.map_or(now, |(_, pose)| pose);
        // Features that many overlap say more of it than a little depth.
        let seen = match verdict {
            LoopVerdict::Accepted | LoopVerdict::LittleOverlap => {
                let reach = if is_loop { Reach::LOOP } else { Reach::KEYFRAMES };
                let found = || of.shared(searcher, places, &near, reach);
                let seen = self.seen.get(&ids).cloned().unwrap_or_else(found);
                seen.filter(|f| is_loop || is_of_track((newer, older), f, of.context.scales.features))
            }
            _ => None,
        };
        let is_rescued = verdict == LoopVerdict::LittleOverlap
            && seen.as_ref().is_some_and(|pair| pair.sums.n >= MIN_FEATURES);
        if verdict != LoopVerdict::Accepted && !is_rescued {
            let at = Some(kept.map_or_else(|| MatchPose::of(&now), |(at, _)| at));
            let is_known = known.is_some();
            return SearchedPair { ids, pair: None, tested, is_known, seen, at };
        }
        let factor = searcher.matcher.metric_factor();
        let features = (seen.clone(), of.context.feature_weight() * factor);
        let stays = kept.map(|at| of.matched(searcher, places, at, features.clone()));
        let stays = stays.filter(|matched| !matched.has_moved(&now, factor));
        let has_stayed = stays.is_some();
        let (matched, at) = match stays {
            Some(matched) => (Arc::clone(&matched), Some(matched.at)),
            None if tightness < 1.0 => {
                (of.searched_widely(searcher, places, (&now, tightness), features), None)
            }
            None => {
                let at = MatchPose::of(&now);
                (of.matched(searcher, places, (at, at.pose()), features), Some(at))
            }
        };
        let tested = tested.map(|tested| {
            let verdict = match has_stayed {
                // As it was when it was searched.
                true => LoopVerdict::Accepted,
                false => of
                    .by_features(tested.verdict, places, seen.as_deref(), || matched.block.linearise(&now).0),
            };
            Tested { verdict, ..tested }
        });
        let is_consecutive = query == target + 1 && of.origins[query] == of.origins[target];
        let is_good = tested.is_none_or(|t| t.verdict == LoopVerdict::Accepted);
        let pair = (is_good && matched.counts(is_consecutive)).then(|| {
            let own_cost = is_loop.then(|| matched.own_cost());
            Pair { is_loop, own_cost, ..Pair::new(query, target, matched.block.clone()) }
        });
        let is_known = known.map(|k| k.verdict) == tested.map(|t| t.verdict);
        SearchedPair { ids, pair, tested, is_known, seen, at }
    }

    /// Pairs by appearance for the keyframes that no loop holds yet.
    fn recognise(&mut self, pairs: &mut Vec<Pair>, poses: &[Pose], progress: &mut dyn FnMut()) {
        self.of.context.steps.enter(Step::Recognise);
        let mut is_closed = vec![false; self.of.keyframes.len()];
        for pair in pairs.iter().filter(|pair| pair.is_loop) {
            (is_closed[pair.query], is_closed[pair.target]) = (true, true);
        }
        let open: Vec<usize> = (0..self.of.keyframes.len()).filter(|&i| !is_closed[i]).collect();
        let of = &self.of;
        let keyframes = (of.keyframes, of.origins);
        let matchables = (&of.matchables, of.cache);
        let is_refused =
            |ids: &PairIds| self.tested(ids).is_some_and(|known| known.verdict == LoopVerdict::Contradicted);
        let asked =
            AskedPairs { newer: &open, poses, most_apart_m: self.most_apart_m, is_refused: &is_refused };
        for found in from_appearance::pairs(of.context, keyframes, matchables, &asked, progress) {
            let ids = self.of.ids((found.pair.query, found.pair.target));
            self.recognised.push((ids, found.apart_m));
            pairs.push(found.pair);
            self.tests.push(Some(found.tested));
            // The poses will move: what was refused where they were may fit then.
            self.known.retain(|_, tested| {
                matches!(tested.verdict, LoopVerdict::Accepted | LoopVerdict::Contradicted)
            });
        }
    }

    /// All loops of the last outer iteration with their verdicts, by newer and older keyframe.
    pub(crate) fn loop_records(&mut self, solved: &Solved) -> Vec<LoopRecord> {
        let mut records = std::mem::take(&mut self.rejected);
        if solved.is_solved {
            let residuals = &solved.residuals_sigmas;
            for ((pair, tested), residual) in solved.graph.pairs.iter().zip(&self.tests).zip(residuals) {
                let ids = self.of.ids((pair.query, pair.target));
                records.extend(tested.map(|tested| loop_record(ids, &tested, *residual, pair.weight)));
            }
        }
        records.sort_by_key(|l| (l.newer, l.older));
        records
    }
}

fn loop_record((newer, older): PairIds, tested: &Tested, residual_sigmas: f64, weight: f64) -> LoopRecord {
    let verdict = match tested.verdict {
        LoopVerdict::Accepted if weight == 0.0 && residual_sigmas > 0.0 => LoopVerdict::Outvoted,
        LoopVerdict::Accepted if weight == 0.0 => LoopVerdict::LittleOverlap,
        verdict => verdict,
    };
    let Tested { overlap, in_front, inconsistency_sigmas, .. } = *tested;
    LoopRecord { newer, older, overlap, in_front, inconsistency_sigmas, residual_sigmas, weight, verdict }
}

impl DataAssociation for KeyframeAssociation<'_> {
    fn associate(
        &mut self,
        poses: &[Pose],
        iteration: OuterIteration,
        progress: &mut dyn FnMut(),
    ) -> Vec<Pair> {
        self.of.context.steps.enter(Step::Search);
        let poses = &poses[..self.of.keyframes.len()];
        self.choose(poses);
        let found = self.search(poses, iteration.tightness, progress);
        let news = found.iter().filter(|f| !f.is_known);
        self.known.extend(news.filter_map(|f| Some((f.ids, f.tested?))));
        if self.of.context.mapping.features.enabled {
            self.seen.extend(found.iter().map(|f| (f.ids, f.seen.clone())));
        }
        // Those of an earlier iteration have no part in the answer.
        self.searched = BTreeMap::from_iter(found.iter().filter_map(|f| Some((f.ids, f.at?))));
        self.rejected.clear();
        self.tests.clear();
        let mut pairs = Vec::new();
        for SearchedPair { ids, pair, tested, .. } in found {
            if let Some(pair) = pair {
                pairs.push(pair);
                self.tests.push(tested);
            } else if let Some(tested) = tested {
                self.rejected.push(loop_record(ids, &tested, 0.0, 0.0));
            }
        }
        if iteration.index == 0 {
            self.recognise(&mut pairs, poses, progress);
        }
        pairs.extend_from_slice(&self.fixed_pairs);
        self.of.context.steps.enter(Step::Solve);
        pairs
    }
}
