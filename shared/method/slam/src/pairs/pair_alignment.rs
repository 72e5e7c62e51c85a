//! Two keyframes aligned by themselves: the multi-edge problem with one pair.

use crate::pairs::matchable::Matchable;
use crate::settings::WindowSettings;
use tessera_geometry::Pose;
use tessera_graph::{INNER_ITERATIONS, MultiEdge, OuterIteration, Pair, PairBlock, Schedule};
use tessera_registration::{MatchLimits, Matcher, PairReport, Queries, Selection, Target};

/// How two keyframes are aligned.
#[derive(Clone, Copy)]
pub(crate) struct PairAlignment<'a> {
    pub(crate) query: &'a Queries,
    pub(crate) target: &'a Matchable<'a>,
    pub(crate) n_queries: usize,
    /// Limits by tightness, from 0 to 1.
    pub(crate) limits: &'a dyn Fn(f32) -> MatchLimits,
}

/// A pair at its own optimum.
pub(crate) struct AlignedPair {
    pub(crate) target_from_query: Pose,
    /// The last matches, and their cost at `target_from_query`.
    pub(crate) block: PairBlock,
    pub(crate) cost: f64,
    pub(crate) report: PairReport,
}

impl PairAlignment<'_> {
    /// The matches at a pose.
    pub(crate) fn search(
        &self,
        matcher: &mut Matcher,
        target_from_query: &Pose,
        tightness: f32,
    ) -> (PairBlock, PairReport) {
        self.choose(matcher);
        let vertices = self.target.vertices();
        self.search_chosen(matcher, &self.target.target(&vertices), target_from_query, tightness)
    }

    fn choose(&self, matcher: &mut Matcher) {
        matcher.choose(self.query, Selection { count: self.n_queries, shift: 0 });
    }

    fn search_chosen(
        &self,
        matcher: &mut Matcher,
        target: &Target<'_>,
        target_from_query: &Pose,
        tightness: f32,
    ) -> (PairBlock, PairReport) {
        let limits = (self.limits)(tightness);
        let (sums, report) = matcher.match_chosen(target, target_from_query, &limits);
        (PairBlock::new(target_from_query, &sums.all()), report)
    }

    /// Aligns from a pose with these limits, one outer iteration each.
    pub(crate) fn solve(
        &self,
        matcher: &mut Matcher,
        target_from_query: &Pose,
        tightness: &[f32],
    ) -> AlignedPair {
        self.choose(matcher);
        let vertices = self.target.vertices();
        let target = self.target.target(&vertices);
        let mut last = None;
        let mut associate = |poses: &[Pose], iteration: OuterIteration| {
            // The target is the origin.
            let (block, report) = self.search_chosen(matcher, &target, &poses[1], iteration.tightness);
            last = Some((block.clone(), report));
            vec![Pair::new(1, 0, block)]
        };
        let schedule = Schedule {
            converged_step: WindowSettings::CONVERGED_STEP,
            ..Schedule::steps(tightness, INNER_ITERATIONS)
        };
        let solved = MultiEdge::pair(target_from_query, schedule).solve(&mut associate, &mut || ());
        let target_from_query = solved.graph.poses[1];
        let (block, report) =
            last.unwrap_or_else(|| self.search_chosen(matcher, &target, &target_from_query, 1.0));
        let cost = block.cost(&target_from_query);
        AlignedPair { target_from_query, block, cost, report }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::test_wall::{Walls, context, keyframe};
    use tessera_graph::Graph;
    use tessera_registration::Sampler;

    #[test]
    fn one_loop_does_what_the_iterations_written_out_do() {
        let keyframes = [keyframe(0, 0, 0.0), keyframe(1, 0, 0.03)];
        let context = context();
        let walls = Walls::seen_by(&context, &keyframes);
        let mut sampler = Sampler::default();
        let [target, query] = [0, 1].map(|k| Matchable::new(&context, &mut sampler, &keyframes[k], &walls));
        let mut matcher = context.matcher();
        let limits = |tightness: f32| MatchLimits::drifted(0.15, tightness);
        let alignment =
            PairAlignment { query: query.queries(), target: &target, n_queries: 200, limits: &limits };
        let start = Pose::translation(0.03, 0.0, 0.04);
        let aligned = alignment.solve(&mut matcher, &start, &[0.0, 1.0, 1.0]);
        let mut at = start;
        for tightness in [0.0, 1.0, 1.0] {
            let mut graph = Graph {
                poses: vec![Pose::identity(), at],
                is_fixed: vec![true, false],
                pairs: vec![Pair::new(1, 0, alignment.search(&mut matcher, &at, tightness).0)],
                ..Graph::default()
            };
            graph.optimise(INNER_ITERATIONS, &mut || ()).unwrap();
            at = graph.poses[1];
        }
        assert_eq!(aligned.target_from_query, at);
        assert!(at.translation.z.abs() < 1e-4 && aligned.report.n_matches > 100, "{at}");
        assert_eq!(aligned.cost, aligned.block.cost(&at));
    }
}
