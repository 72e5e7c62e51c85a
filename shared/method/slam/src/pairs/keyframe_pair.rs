//! The pair builder of the global optimisation: one multi-edge between two
//! views (method 7, 8.1).

use crate::pairs::weighted_pair::WeightedPair;
use crate::settings::GlobalSettings;
use tessera_geometry::Pose;
use tessera_graph::{Pair, PairBlock};
use tessera_registration::{MatchLimits, Matcher, Queries, Selection, Target};

/// A pair to be searched.
pub(crate) struct PairSearch<'a> {
    /// Vertices of the graph.
    pub(crate) query: usize,
    pub(crate) target: usize,
    pub(crate) queries: &'a Queries,
    pub(crate) surface: Target<'a>,
    /// Whether the query is the next keyframe after the target in the same run.
    pub(crate) is_consecutive: bool,
    pub(crate) limits: MatchLimits,
    /// Features that both see.
    pub(crate) features: Option<WeightedPair>,
}

/// Features that agree on a pose, or matches of consecutive keyframes, from which on a pair counts however little its
/// surfaces overlap.
pub(crate) const MIN_FEATURES: u32 = 30;

impl PairSearch<'_> {
    /// The pair at these poses; weight 0 where it overlaps too little to count.
    pub(crate) fn find(&self, matcher: &mut Matcher, poses: &[Pose]) -> Pair {
        let target_from_query = poses[self.target].inverse() * poses[self.query];
        // Each pair takes another choice of the samples.
        let selection = Selection { count: GlobalSettings::QUERIES_PER_PAIR, shift: self.target };
        let (halves, report) =
            matcher.match_pair(self.queries, selection, &self.surface, &target_from_query, &self.limits);
        let mut sums = halves.all();
        let overlap = f64::from(report.n_matches) / f64::from(report.n_queries.max(1));
        let is_link = self.is_consecutive && report.n_matches >= MIN_FEATURES;
        let is_seen = self.features.as_ref().is_some_and(|pair| pair.found.sums.n >= MIN_FEATURES);
        let weight = if overlap >= GlobalSettings::MIN_OVERLAP || is_link || is_seen { 1.0 } else { 0.0 };
        if let Some(pair) = &self.features {
            pair.add_to(&mut sums, &target_from_query);
        }
        Pair { weight, ..Pair::new(self.query, self.target, PairBlock::new(&target_from_query, &sums)) }
    }
}
