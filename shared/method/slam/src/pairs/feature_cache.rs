//! Feature matches of pairs of keyframes, kept from one optimisation to the next.
//!
//! All of it is a function of two keyframes, of the colour model and of a rounded initial guess, so that
//! it makes no difference what is kept and what is found anew.

use crate::estimation::colour_model::ColourModel;
use crate::map::rounded_pose::RoundedPose;
use crate::pairs::verification::Tested;
use crate::pairs::weighted_pair::FeaturePair;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tessera_geometry::Pose;
use tessera_graph::PairBlock;

/// Ids of the newer and the older keyframe.
pub(crate) type PairIds = (u32, u32);

/// The relative pose about which features are matched: half a step is 8 px at 1 m, well within reach of the search.
pub(crate) type RoundedGuess = RoundedPose<32>;

/// Two keyframes that look alike, aligned by themselves, with the tests of that pose.
#[derive(Debug)]
pub(crate) struct AlikePair {
    pub(crate) older_from_newer: Pose,
    pub(crate) block: PairBlock,
    pub(crate) tested: Tested,
}

/// The features that pairs of keyframes share, and pairs that look alike with their tests.
#[derive(Debug, Default)]
pub(crate) struct FeatureCache(Mutex<CachedPairs>);

#[derive(Debug, Default)]
struct CachedPairs {
    model: ColourModel,
    shared: BTreeMap<PairIds, (RoundedGuess, Option<Arc<FeaturePair>>)>,
    alike: BTreeMap<PairIds, Option<Arc<AlikePair>>>,
}

impl FeatureCache {
    /// Forgets what another colour model gave, and all keyframes but those with these ids, which rise.
    pub(crate) fn begin(&self, model: ColourModel, ids: &[u32]) {
        let mut kept = self.kept();
        if kept.model != model {
            *kept = CachedPairs { model, ..CachedPairs::default() };
        }
        kept.keep_only(ids);
    }

    /// Forgets all keyframes but those with these ids, which rise.
    pub(crate) fn keep_only(&self, ids: &[u32]) {
        self.kept().keep_only(ids);
    }

    /// The features that a pair shares near a guess, by `find` where they are not known.
    pub(crate) fn shared(
        &self,
        pair: PairIds,
        guess: RoundedGuess,
        find: impl FnOnce() -> Option<Arc<FeaturePair>>,
    ) -> Option<Arc<FeaturePair>> {
        let known = self.kept().shared.get(&pair).filter(|(at, _)| *at == guess).cloned();
        known.map(|(_, shared)| shared).unwrap_or_else(|| {
            let found = find();
            self.kept().shared.insert(pair, (guess, found.clone()));
            found
        })
    }

    /// A pair that looks alike, aligned and tested, by `find` where that is not known.
    pub(crate) fn alike(
        &self,
        pair: PairIds,
        find: impl FnOnce() -> Option<Arc<AlikePair>>,
    ) -> Option<Arc<AlikePair>> {
        let known = self.kept().alike.get(&pair).cloned();
        known.unwrap_or_else(|| {
            let found = find();
            self.kept().alike.insert(pair, found.clone());
            found
        })
    }

    fn kept(&self) -> MutexGuard<'_, CachedPairs> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl CachedPairs {
    fn keep_only(&mut self, ids: &[u32]) {
        let is_held = |pair: &PairIds| [pair.0, pair.1].iter().all(|id| ids.binary_search(id).is_ok());
        self.shared.retain(|pair, _| is_held(pair));
        self.alike.retain(|pair, _| is_held(pair));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_graph::BlockSums;

    fn found(n: u32) -> Option<Arc<FeaturePair>> {
        let sums = BlockSums { n, ..BlockSums::default() };
        let target_from_query = Pose::identity();
        Some(Arc::new(FeaturePair { target_from_query, inliers: Vec::new(), variance_factor: 1.0, sums }))
    }

    #[test]
    fn a_pair_is_found_once_for_each_guess_and_model() {
        let cache = FeatureCache::default();
        let [guess, other] = [0.0, 0.04].map(|x_m| RoundedGuess::of(&Pose::translation(x_m, 0.0, 0.0)));
        let n = |cache: &FeatureCache, at, n| cache.shared((7, 3), at, || found(n)).map(|pair| pair.sums.n);
        cache.begin(ColourModel::default(), &[3, 7]);
        assert_eq!([n(&cache, guess, 1), n(&cache, guess, 2)], [Some(1); 2]);
        assert_eq!(n(&cache, other, 3), Some(3));
        cache.begin(ColourModel { lag_s: 0.01, ..ColourModel::default() }, &[3, 7]);
        assert_eq!(n(&cache, other, 4), Some(4));
        cache.begin(ColourModel { lag_s: 0.01, ..ColourModel::default() }, &[7]);
        assert_eq!(n(&cache, other, 5), Some(5));
    }
}
