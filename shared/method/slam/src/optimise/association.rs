//! Data association between all keyframes: neighbours by pose, verified loop closures, and loops
//! recognised by appearance.

use crate::map::context::Context;
use crate::map::records::{LoopRecord, LoopVerdict, MatchPose};
use crate::map::state::KeyframeState;
use crate::map::submaps::Origin;
use crate::optimise::from_appearance::{self, AskedPairs};
use crate::optimise::kept_matches::KeptMatches;
use crate::optimise::keyframe_searches::PairSearcher;
use crate::optimise::known_pairs::KnownPairs;
use crate::optimise::matchables::Matchables;
use crate::optimise::named_loops::NamedLoops;
use crate::pairs::covisibility;
use crate::pairs::feature_cache::{FeatureCache, PairIds};
use crate::pairs::match_cache::{MatchCache, has_left};
use crate::pairs::matching::PairFinder;
use crate::pairs::verification::Tested;
use tessera_geometry::Pose;
use tessera_graph::{DataAssociation, OuterIteration, Pair, Solved};
use tessera_numerics::Step;
use tessera_numerics::parallel::map_in_parts_mut;

/// The pairs of all keyframes, each a vertex.
pub(crate) struct KeyframeAssociation<'a> {
    pub(crate) of: Keyframes<'a>,
    /// How far pairs by appearance may be from where the poses have them, metres.
    pub(crate) most_apart_m: f64,
    /// Those that there are, and how far each is.
    pub(crate) recognised: Vec<(PairIds, f64)>,
    /// Pairs that are part of each iteration as they are.
    pub(crate) fixed_pairs: Vec<Pair>,
    /// The pairs, and the poses at which they were chosen.
    chosen: KnownPairs,
    chosen_at: Vec<Pose>,
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
    /// Loops that earlier corrections named.
    pub(crate) named: &'a NamedLoops,
    /// Where they searched, or refused.
    pub(crate) kept: &'a KeptMatches,
}

impl<'a> KeyframeAssociation<'a> {
    pub(crate) fn new(of: Keyframes<'a>) -> Self {
        Self {
            of,
            most_apart_m: f64::INFINITY,
            recognised: Vec::new(),
            fixed_pairs: Vec::new(),
            chosen: KnownPairs::default(),
            chosen_at: Vec::new(),
            tests: Vec::new(),
            rejected: Vec::new(),
        }
    }

    /// Chooses the pairs, again where a pose moved as far as drift may have carried it.
    fn choose(&mut self, poses: &[Pose]) {
        let is_near = |(at, now)| !has_left(at, now);
        if self.chosen_at.len() == poses.len() && self.chosen_at.iter().zip(poses).all(is_near) {
            return;
        }
        let of = &self.of;
        let kept = of.kept.places(&of.keyframes.iter().map(|k| k.id).collect::<Vec<_>>());
        let places = covisibility::pairs(poses, of.origins, &kept);
        let mut chosen = KnownPairs::new(&places, of.keyframes, |places| of.closes_loop(places));
        chosen.recall(of.kept, of.named, of.matches);
        chosen.recall_from(&self.chosen);
        (self.chosen, self.chosen_at) = (chosen, poses.to_vec());
    }

    fn search(&mut self, poses: &[Pose], tightness: f32, progress: &mut dyn FnMut()) -> Vec<Option<Pair>> {
        let Self { of, chosen, .. } = self;
        let context = of.context;
        map_in_parts_mut(
            &mut chosen.pairs,
            || PairSearcher { matcher: context.matcher(), finder: PairFinder::new(context), looked_at: None },
            |searcher, known| of.search_one(searcher, poses, known, tightness),
            progress,
        )
    }

    /// Where the matches of the last iteration's pairs were searched, or their loops refused, by their ids.
    pub(crate) fn searched(&self) -> Vec<(PairIds, MatchPose)> {
        // Those of an earlier iteration have no part in the answer.
        let searched = self.chosen.in_order().filter(|known| known.is_searched);
        searched.filter_map(|known| Some((known.ids, known.at?.0))).collect()
    }

    /// Keeps the matches for the next optimisation.
    pub(crate) fn keep_matches(&self) {
        let searched = self.chosen.in_order().filter(|known| known.is_searched);
        self.of.matches.keep(searched.filter_map(|known| Some((known.ids, known.matched.clone()?))));
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
        let is_refused = |ids: &PairIds| of.named.is_contradicted(ids);
        let asked =
            AskedPairs { newer: &open, poses, most_apart_m: self.most_apart_m, is_refused: &is_refused };
        for found in from_appearance::pairs(of.context, keyframes, matchables, &asked, progress) {
            let ids = self.of.ids((found.pair.query, found.pair.target));
            self.recognised.push((ids, found.apart_m));
            pairs.push(found.pair);
            self.tests.push(Some(found.tested));
            // The poses will move: what was refused where they were may fit then.
            for known in &mut self.chosen.pairs {
                known.tested = known.tested.filter(|tested| !tested.verdict.is_of_where_it_was());
            }
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
        self.rejected.clear();
        self.tests.clear();
        for (known, pair) in self.chosen.pairs.iter().zip(&found) {
            match (pair, known.judged) {
                (Some(_), judged) => self.tests.push(judged),
                (None, Some(tested)) => self.rejected.push(loop_record(known.ids, &tested, 0.0, 0.0)),
                (None, None) => {}
            }
        }
        let mut pairs = Vec::with_capacity(found.len() + self.fixed_pairs.len());
        pairs.extend(found.into_iter().flatten());
        if iteration.index == 0 {
            self.recognise(&mut pairs, poses, progress);
        }
        pairs.extend_from_slice(&self.fixed_pairs);
        self.of.context.steps.enter(Step::Solve);
        pairs
    }
}
