//! The pair builder of the global optimisation: matches of the surfaces of two keyframes (method 7, 8.1).

use crate::settings::GlobalSettings;
use tessera_geometry::Pose;
use tessera_graph::BlockSums;
use tessera_registration::{MatchLimits, Matcher, Queries, Selection, Target};

/// A pair to be searched.
pub(crate) struct PairSearch<'a> {
    pub(crate) queries: &'a Queries,
    pub(crate) surface: Target<'a>,
    /// Id of the target: each pair takes another choice of the samples.
    pub(crate) target: u32,
}

/// Features that agree on a pose, or matches of consecutive keyframes, from which on a pair counts however little its
/// surfaces overlap.
pub(crate) const MIN_FEATURES: u32 = 20;

/// What a search found.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfaceMatches {
    /// About the pose of the search.
    pub(crate) sums: BlockSums,
    n_matches: u32,
    n_queries: u32,
}

impl SurfaceMatches {
    /// Whether the surfaces overlap enough for the pair to count.
    pub(crate) fn overlap_enough(&self, is_consecutive: bool) -> bool {
        let overlap = f64::from(self.n_matches) / f64::from(self.n_queries.max(1));
        overlap >= GlobalSettings::MIN_OVERLAP || is_consecutive && self.n_matches >= MIN_FEATURES
    }
}

impl PairSearch<'_> {
    /// The matches at a pose.
    pub(crate) fn find(
        &self,
        matcher: &mut Matcher,
        target_from_query: &Pose,
        limits: &MatchLimits,
    ) -> SurfaceMatches {
        let selection = Selection { count: GlobalSettings::QUERIES_PER_PAIR, shift: self.target as usize };
        let (halves, report) =
            matcher.match_pair(self.queries, selection, &self.surface, target_from_query, limits);
        SurfaceMatches { sums: halves.all(), n_matches: report.n_matches, n_queries: report.n_queries }
    }
}
