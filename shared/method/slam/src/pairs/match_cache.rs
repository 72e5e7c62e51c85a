//! Matches of pairs of keyframes, kept from one optimisation to the next.
//!
//! All of it is a function of two keyframes, of the features that both see and of the pose of the search, so that it
//! makes no difference what is kept and what is found anew.

use crate::map::records::MatchPose;
use crate::map::sorted_keys::values_of;
use crate::pairs::feature_cache::PairIds;
use crate::pairs::keyframe_pair::{MIN_FEATURES, SurfaceMatches};
use crate::pairs::weighted_pair::{FeaturePair, WeightedPair};
use crate::settings::GlobalSettings;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use tessera_geometry::{Pose, translation_rotation_norms};
use tessera_graph::{PairBlock, own_cost};

/// Mean displacement of its matches along their normals below which a pair is not searched again, standard deviations
/// of depth.
const MOST_MOVED_SIGMAS: f64 = 0.25;

/// Whether a pair moved so far from a pose, in directions that its matches leave open as well, that another share of its
/// points match: by the standard deviation of the drift that the first limit allows, in metres or radians.
pub(crate) fn has_left(at: &Pose, target_from_query: &Pose) -> bool {
    let most = GlobalSettings::FIRST_DISTANCE_M / 3.0;
    let (moved_m, turned_rad) = translation_rotation_norms(&(at.inverse() * target_from_query));
    !(moved_m <= most && turned_rad <= most)
}

/// The features that both keyframes of a pair see, with the factor of their information in the units of the blocks.
pub(crate) type PairFeatures = (Option<Arc<FeaturePair>>, f64);

/// A pair with the matches that were found at a pose.
#[derive(Debug)]
pub(crate) struct MatchedPair {
    pub(crate) at: MatchPose,
    pose: Pose,
    surfaces: SurfaceMatches,
    features: PairFeatures,
    /// Cost of both.
    pub(crate) block: PairBlock,
    own_cost: OnceLock<f64>,
}

impl MatchedPair {
    pub(crate) fn new(
        (at, pose): (MatchPose, Pose),
        surfaces: SurfaceMatches,
        features: PairFeatures,
    ) -> Self {
        let mut sums = surfaces.sums;
        if let (Some(found), weight) = &features {
            // At their own pose: a loop may be far from where the poses have it.
            WeightedPair::new(Arc::clone(found), *weight, &found.target_from_query).add_to(&mut sums, &pose);
        }
        let block = PairBlock::new(&pose, &sums);
        Self { at, pose, surfaces, features, block, own_cost: OnceLock::new() }
    }

    /// The matches of a pair at a pose: those that are known, or by `find` where those of its surfaces are not known
    /// there.
    pub(crate) fn known_or(
        known: Option<Arc<Self>>,
        (at, pose): (MatchPose, Pose),
        features: PairFeatures,
        find: impl FnOnce(&Pose) -> SurfaceMatches,
    ) -> Arc<Self> {
        match known {
            Some(known) if known.has(&at, &features) => known,
            known => {
                let surfaces = known.filter(|known| known.at == at).map(|known| known.surfaces);
                Arc::new(Self::new((at, pose), surfaces.unwrap_or_else(|| find(&pose)), features))
            }
        }
    }

    /// A relative pose, which mostly is that of the matches.
    pub(crate) fn pose_at(&self, at: &MatchPose) -> Pose {
        if self.at == *at { self.pose } else { at.pose() }
    }

    fn has(&self, at: &MatchPose, (seen, weight): &PairFeatures) -> bool {
        let is_same = match (&self.features.0, seen) {
            (Some(kept), Some(seen)) => Arc::ptr_eq(kept, seen) && self.features.1 == *weight,
            (None, None) => true,
            _ => false,
        };
        self.at == *at && is_same
    }

    /// Whether the pair counts: it overlaps enough, links two consecutive keyframes, or features are seen by both.
    pub(crate) fn counts(&self, is_consecutive: bool) -> bool {
        let is_seen = self.features.0.as_ref().is_some_and(|found| found.sums.n >= MIN_FEATURES);
        is_seen || self.surfaces.overlap_enough(is_consecutive)
    }

    /// Whether it must be searched again where the pair is now.
    pub(crate) fn has_moved(&self, target_from_query: &Pose, metric_factor: f64) -> bool {
        let mean_sq = self.block.displacement(target_from_query)
            / (metric_factor * f64::from(self.block.n_matches().max(1)));
        !(mean_sq <= MOST_MOVED_SIGMAS * MOST_MOVED_SIGMAS)
    }

    /// The pair's own cost at its optimum, which is looked for from the pose of its matches.
    pub(crate) fn own_cost(&self) -> f64 {
        *self.own_cost.get_or_init(|| own_cost(&self.block, &self.pose))
    }
}

/// The matches of pairs at the poses at which they were last searched, by ids that rise.
#[derive(Debug, Default)]
pub(crate) struct MatchCache(Mutex<KnownMatches>);

#[derive(Debug, Default)]
struct KnownMatches {
    readout_s: f64,
    pairs: Vec<(PairIds, Arc<MatchedPair>)>,
}

impl MatchCache {
    /// Forgets what another readout gave.
    pub(crate) fn begin(&self, readout_s: f64) {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.readout_s != readout_s {
            *kept = KnownMatches { readout_s, ..KnownMatches::default() };
        }
    }

    /// What is known of these pairs, whose ids rise.
    pub(crate) fn of(&self, pairs: &[PairIds]) -> Vec<Option<Arc<MatchedPair>>> {
        let kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let entries = kept.pairs.iter().map(|(pair, matched)| (pair, matched));
        values_of(pairs.iter().copied(), entries).map(Option::<&Arc<MatchedPair>>::cloned).collect()
    }

    /// Keeps these pairs, whose ids rise, and forgets all others.
    pub(crate) fn keep(&self, pairs: impl Iterator<Item = (PairIds, Arc<MatchedPair>)>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).pairs = pairs.collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::test_wall::{Walls, context, keyframe};
    use crate::pairs::keyframe_pair::PairSearch;
    use crate::pairs::matchable::Matchable;
    use tessera_graph::BlockSums;
    use tessera_registration::{MatchLimits, Sampler};

    #[test]
    fn surfaces_are_searched_once_at_a_pose_and_again_where_they_moved_along_their_normals() {
        let (context, keyframes) = (context(), [keyframe(0, 0, 0.0), keyframe(1, 0, 0.03)]);
        let walls = Walls::seen_by(&context, &keyframes);
        let mut sampler = Sampler::default();
        let [target, query] = [0, 1].map(|k| Matchable::new(&context, &mut sampler, &keyframes[k], &walls));
        let (vertices, mut matcher) = (target.vertices(), context.matcher());
        let factor = matcher.metric_factor();
        let search = PairSearch { queries: query.queries(), surface: target.target(&vertices), target: 0 };
        let (cache, mut n_searches) = (MatchCache::default(), 0);
        let mut matched = |x_m: f64, features: PairFeatures| {
            let at = MatchPose::of(&Pose::translation(x_m, 0.0, 0.0));
            let known = cache.of(&[(1, 0), (2, 0)]);
            assert!(known[1].is_none());
            let known = known.into_iter().next().flatten();
            let matched = MatchedPair::known_or(known, (at, at.pose()), features, |pose| {
                n_searches += 1;
                search.find(&mut matcher, pose, &MatchLimits::new(GlobalSettings::FIRST_DISTANCE_M, 1.0))
            });
            cache.keep(std::iter::once(((1, 0), Arc::clone(&matched))));
            matched
        };
        let target_from_query = Pose::translation(0.03, 0.0, 0.0);
        let sums = BlockSums { n: MIN_FEATURES, ..BlockSums::default() };
        let seen =
            Arc::new(FeaturePair { target_from_query, inliers: Vec::new(), variance_factor: 1.0, sums });
        let found = matched(0.03, (None, 0.0));
        assert!(Arc::ptr_eq(&found, &matched(0.03, (None, 0.0))) && found.counts(false));
        let with_features = matched(0.03, (Some(seen), 1.0));
        assert!(!Arc::ptr_eq(&found, &with_features));
        matched(0.04, (None, 0.0));
        // Once at either pose: features cost no search.
        assert_eq!(n_searches, 2);
        let moved = |x_m, z_m| found.has_moved(&Pose::translation(0.03 + x_m, 0.0, z_m), factor);
        assert!(!moved(0.0, 0.0) && !moved(0.01, 0.0), "along the wall");
        assert!(!moved(0.0, 1e-4) && moved(0.0, 0.02), "towards it");
        assert!(has_left(&Pose::identity(), &Pose::translation(0.06, 0.0, 0.0)));
        assert!(!has_left(&Pose::identity(), &Pose::translation(0.04, 0.0, 0.0)));
    }
}
