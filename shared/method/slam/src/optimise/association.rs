//! Data association between all keyframes: neighbours by pose, verified loop closures, and loops
//! recognised by appearance.

use crate::map::context::Context;
use crate::map::detection::{self, TrackPoint};
use crate::map::records::{LoopRecord, LoopVerdict};
use crate::map::state::KeyframeState;
use crate::map::submaps::Origin;
use crate::optimise::from_appearance::{self, AskedPairs};
use crate::optimise::of_track::is_of_track;
use crate::pairs::covisibility;
use crate::pairs::feature_cache::{FeatureCache, PairIds, RoundedGuess};
use crate::pairs::keyframe_pair::{MIN_FEATURES, PairSearch};
use crate::pairs::matchable::Matchable;
use crate::pairs::matching::{PairFinder, Reach};
use crate::pairs::verification::{self, KnownLoops, Tested};
use crate::pairs::weighted_pair::{FeaturePair, WeightedPair};
use crate::settings::GlobalSettings;
use crate::tracking::degeneracy::is_determined;
use crate::tracking::sight::ENOUGH_FEATURES;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;
use tessera_geometry::{Matrix6, Pose};
use tessera_graph::{DataAssociation, OuterIteration, Pair, Solved};
use tessera_numerics::Step;
use tessera_numerics::parallel::map_in_parts;
use tessera_registration::{MatchLimits, Matcher};
use tessera_surface::Vertex;

/// The pairs of all keyframes, each a vertex.
pub(crate) struct KeyframeAssociation<'a> {
    pub(crate) context: &'a Context,
    pub(crate) keyframes: &'a [KeyframeState],
    pub(crate) origins: &'a [Origin],
    pub(crate) matchable: Vec<Matchable<'a>>,
    pub(crate) cache: &'a FeatureCache,
    /// Loops that are not tested again.
    pub(crate) known: KnownLoops,
    /// How far pairs by appearance may be from where the poses have them, metres.
    pub(crate) most_apart_m: f64,
    /// Those that there are, and how far each is.
    pub(crate) recognised: Vec<(PairIds, f64)>,
    /// Pairs that are part of each iteration as they are.
    pub(crate) fixed_pairs: Vec<Pair>,
    /// Features by ids of the newer and the older keyframe, where they were looked for.
    seen: SeenPairs,
    /// The tests of the present pairs; `None` for odometry.
    tests: Vec<Option<Tested>>,
    /// Loops that the present pairs do not hold.
    rejected: Vec<LoopRecord>,
}

/// Features that two keyframes share, by the ids of the newer and the older.
type SeenPairs = BTreeMap<PairIds, Option<Arc<FeaturePair>>>;

/// A pair with the tests that it had to pass, if it closes a loop.
struct SearchedPair {
    pair: Pair,
    tested: Option<Tested>,
    seen: Option<Arc<FeaturePair>>,
}

/// What looks at pairs one after the other.
struct PairSearcher<'a> {
    matcher: Matcher,
    finder: PairFinder,
    /// The place of the last target, and its vertices.
    looked_at: Option<(usize, Cow<'a, [Vertex]>)>,
}

impl<'a> KeyframeAssociation<'a> {
    pub(crate) fn new(
        context: &'a Context,
        (keyframes, origins): (&'a [KeyframeState], &'a [Origin]),
        (matchable, cache): (Vec<Matchable<'a>>, &'a FeatureCache),
        known: KnownLoops,
    ) -> Self {
        let (seen, tests, rejected) = (SeenPairs::new(), Vec::new(), Vec::new());
        let fixed_pairs = Vec::new();
        let (most_apart_m, recognised) = (f64::INFINITY, Vec::new());
        Self {
            context,
            keyframes,
            origins,
            matchable,
            cache,
            known,
            most_apart_m,
            recognised,
            fixed_pairs,
            seen,
            tests,
            rejected,
        }
    }

    fn search(&self, poses: &[Pose], tightness: f32, progress: &mut dyn FnMut()) -> Vec<SearchedPair> {
        map_in_parts(
            &covisibility::pairs(poses, self.origins),
            || PairSearcher {
                matcher: self.context.matcher(),
                finder: PairFinder::new(self.context),
                looked_at: None,
            },
            |searcher, &pair| self.search_one(searcher, poses, pair, tightness),
            progress,
        )
    }

    fn search_one(
        &self,
        searcher: &mut PairSearcher<'a>,
        poses: &[Pose],
        (query, target): (usize, usize),
        tightness: f32,
    ) -> SearchedPair {
        let PairSearcher { matcher, finder, looked_at } = searcher;
        let [newer, older] = [query, target].map(|k| &self.keyframes[k]);
        let is_loop = detection::closes_loop(
            &self.context.mapping.loops,
            &TrackPoint::of_keyframe(newer),
            &TrackPoint::of_keyframe(older),
        );
        let [queries, surface] = [query, target].map(|k| &self.matchable[k]);
        let tested = is_loop.then(|| {
            self.known.get(&(newer.id, older.id)).copied().unwrap_or_else(|| {
                let at = poses[target].inverse() * poses[query];
                verification::test(matcher, queries, surface, &at)
            })
        });
        let reach = if is_loop { Reach::LOOP } else { Reach::KEYFRAMES };
        let seen = self.seen_by_both(finder, poses, (query, target), reach);
        let variance_scale = self.context.scales.features;
        let seen = seen.filter(|found| is_loop || is_of_track((newer, older), found, variance_scale));
        let weight = self.context.feature_weight() * matcher.metric_factor();
        let limits = if is_loop { MatchLimits::drifted } else { MatchLimits::new };
        // Pairs come by target, so that the surface of each is read once.
        if looked_at.as_ref().is_none_or(|(of, _)| *of != target) {
            *looked_at = Some((target, surface.vertices()));
        }
        let vertices = looked_at.as_ref().map_or(&[][..], |(_, vertices)| vertices);
        let search = PairSearch {
            query,
            target,
            queries: &queries.queries,
            surface: surface.target(vertices),
            is_consecutive: query == target + 1 && self.origins[query] == self.origins[target],
            limits: limits(GlobalSettings::FIRST_DISTANCE_M, tightness),
            // At their own pose: a loop may be far from where the poses have it.
            features: seen.clone().map(|found| {
                let at = found.target_from_query;
                WeightedPair::new(found, weight, &at)
            }),
        };
        let pair = Pair { is_loop, ..search.find(matcher, poses) };
        let tested = tested.map(|tested| {
            let verdict = self.by_features(tested.verdict, [queries, surface], seen.as_deref(), || {
                pair.block.linearise(&(poses[target].inverse() * poses[query])).0
            });
            Tested { verdict, ..tested }
        });
        SearchedPair { pair, tested, seen }
    }

    /// The verdict on a loop by its surfaces, with what features say of it: what shares many overlaps, however
    /// little depth there is, and of bare walls that fit wherever they are tried none says that two views with
    /// features, which share none, are of one place.
    fn by_features(
        &self,
        verdict: LoopVerdict,
        sides: [&Matchable<'_>; 2],
        seen: Option<&FeaturePair>,
        information: impl Fn() -> Matrix6,
    ) -> LoopVerdict {
        let have_features =
            || sides.iter().all(|side| side.seen(self.context).features.len() >= ENOUGH_FEATURES);
        match (verdict, seen) {
            (LoopVerdict::LittleOverlap, Some(pair)) if pair.sums.n >= MIN_FEATURES => LoopVerdict::Accepted,
            (LoopVerdict::Accepted, None)
                if self.context.is_colour_trusted
                    && have_features()
                    && !is_determined(self.context, &information()) =>
            {
                LoopVerdict::Inconsistent
            }
            (verdict, _) => verdict,
        }
    }

    /// Features that two keyframes share, looked for once near where their poses predict them.
    fn seen_by_both(
        &self,
        finder: &mut PairFinder,
        poses: &[Pose],
        (query, target): (usize, usize),
        reach: Reach,
    ) -> Option<Arc<FeaturePair>> {
        let ids = (self.keyframes[query].id, self.keyframes[target].id);
        if let Some(known) = self.seen.get(&ids) {
            return known.clone();
        }
        let guess = RoundedGuess::of(&(poses[target].inverse() * poses[query]));
        self.cache.shared(ids, guess, || {
            let sides = [query, target].map(|k| self.matchable[k].seen(self.context));
            let seed = u64::from(ids.0) << 32 | u64::from(ids.1);
            let found = finder.find(self.context, sides, &guess.pose(), reach, seed);
            // Their sums are all that the graph needs.
            found.map(|pair| Arc::new(FeaturePair { inliers: Vec::new(), ..pair }))
        })
    }

    /// Pairs by appearance for the keyframes that no loop holds yet.
    fn recognise(&mut self, pairs: &mut Vec<Pair>, poses: &[Pose], progress: &mut dyn FnMut()) {
        self.context.steps.enter(Step::Recognise);
        let mut is_closed = vec![false; self.keyframes.len()];
        for pair in pairs.iter().filter(|pair| pair.is_loop) {
            (is_closed[pair.query], is_closed[pair.target]) = (true, true);
        }
        let open: Vec<usize> = (0..self.keyframes.len()).filter(|&i| !is_closed[i]).collect();
        let keyframes = (self.keyframes, self.origins);
        let matchable = (&self.matchable[..], self.cache);
        let is_refused = |ids: &PairIds| {
            self.known.get(ids).is_some_and(|known| known.verdict == LoopVerdict::Contradicted)
        };
        let asked =
            AskedPairs { newer: &open, poses, most_apart_m: self.most_apart_m, is_refused: &is_refused };
        for found in from_appearance::pairs(self.context, keyframes, matchable, &asked, progress) {
            let ids = (self.keyframes[found.pair.query].id, self.keyframes[found.pair.target].id);
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
    pub(crate) fn loop_records(mut self, solved: &Solved) -> Vec<LoopRecord> {
        let mut records = std::mem::take(&mut self.rejected);
        if solved.is_solved {
            let residuals = &solved.residuals_sigmas;
            for ((pair, tested), residual) in solved.graph.pairs.iter().zip(&self.tests).zip(residuals) {
                records.extend(tested.map(|tested| self.loop_record(pair, &tested, *residual, pair.weight)));
            }
        }
        records.sort_by_key(|l| (l.newer, l.older));
        records
    }

    fn loop_record(&self, pair: &Pair, tested: &Tested, residual_sigmas: f64, weight: f64) -> LoopRecord {
        let verdict = match tested.verdict {
            LoopVerdict::Accepted if pair.weight == 0.0 && residual_sigmas > 0.0 => LoopVerdict::Outvoted,
            LoopVerdict::Accepted if pair.weight == 0.0 => LoopVerdict::LittleOverlap,
            verdict => verdict,
        };
        LoopRecord {
            newer: self.keyframes[pair.query].id,
            older: self.keyframes[pair.target].id,
            overlap: tested.overlap,
            in_front: tested.in_front,
            inconsistency_sigmas: tested.inconsistency_sigmas,
            residual_sigmas,
            weight,
            verdict,
        }
    }
}

impl DataAssociation for KeyframeAssociation<'_> {
    fn associate(
        &mut self,
        poses: &[Pose],
        iteration: OuterIteration,
        progress: &mut dyn FnMut(),
    ) -> Vec<Pair> {
        self.context.steps.enter(Step::Search);
        let poses = &poses[..self.keyframes.len()];
        let found = self.search(poses, iteration.tightness, progress);
        let ids = |pair: &Pair| (self.keyframes[pair.query].id, self.keyframes[pair.target].id);
        self.known.extend(found.iter().filter_map(|f| Some((ids(&f.pair), f.tested?))));
        self.seen.extend(found.iter().map(|f| (ids(&f.pair), f.seen.clone())));
        self.rejected.clear();
        self.tests.clear();
        let mut pairs = Vec::new();
        for SearchedPair { pair, tested, .. } in found {
            let is_good = tested.is_none_or(|t| t.verdict == LoopVerdict::Accepted);
            if pair.weight > 0.0 && is_good {
                pairs.push(pair);
                self.tests.push(tested);
            } else if let Some(tested) = tested {
                self.rejected.push(self.loop_record(&pair, &tested, 0.0, 0.0));
            }
        }
        if iteration.index == 0 {
            self.recognise(&mut pairs, poses, progress);
        }
        pairs.extend_from_slice(&self.fixed_pairs);
        self.context.steps.enter(Step::Solve);
        pairs
    }
}
