//! Feature matches of pairs of keyframes, kept from one optimisation to the next.
//!
//! All of it is a function of two keyframes, of the colour model and of a rounded initial guess, so that
//! it makes no difference what is kept and what is found anew.

use crate::estimation::colour_model::ColourModel;
use crate::pairs::verification::Tested;
use crate::pairs::weighted_pair::FeaturePair;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tessera_geometry::{Pose, Twist, Vector6, exp, log};
use tessera_graph::PairBlock;

/// Ids of the newer and the older keyframe.
pub(crate) type PairIds = (u32, u32);

/// Step of the rounded guess, metres and radians: half of it is 8 px at 1 m, well within reach of the
/// search.
const STEP: f64 = 1.0 / 32.0;

/// A relative pose whose tangent vector is in whole steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RoundedGuess([i32; 6]);

impl RoundedGuess {
    pub(crate) fn of(target_from_query: &Pose) -> Self {
        let tangent = log(target_from_query).to_vector() / STEP;
        Self(std::array::from_fn(|k| tangent[k].round() as i32))
    }

    pub(crate) fn pose(&self) -> Pose {
        exp(&Twist::from_vector(&(Vector6::from(self.0.map(f64::from)) * STEP)))
    }
}

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
    use tessera_geometry::translation_rotation_norms;
    use tessera_graph::BlockSums;

    fn found(n: u32) -> Option<Arc<FeaturePair>> {
        let sums = BlockSums { n, ..BlockSums::default() };
        let target_from_query = Pose::identity();
        Some(Arc::new(FeaturePair { target_from_query, inliers: Vec::new(), variance_factor: 1.0, sums }))
    }

    #[test]
    fn a_rounded_guess_is_near_and_the_same_for_poses_nearby() {
        let at = |x: f64| exp(&Twist::from_vector(&Vector6::new(x, -0.4, 0.9, 0.3, -0.2, 0.1)));
        let guess = RoundedGuess::of(&at(0.195));
        assert_eq!(guess, RoundedGuess::of(&at(0.199)));
        assert_ne!(guess, RoundedGuess::of(&at(0.240)));
        assert_eq!(guess, RoundedGuess::of(&guess.pose()));
        let (apart_m, apart_rad) = translation_rotation_norms(&(guess.pose().inverse() * at(0.195)));
        assert!(apart_m < 2.0 * STEP && apart_rad < STEP, "{apart_m} m, {apart_rad} rad");
    }

    #[test]
    fn a_pair_is_found_once_for_each_guess_and_model() {
        let cache = FeatureCache::default();
        let guess = RoundedGuess([0; 6]);
        let n = |cache: &FeatureCache, at, n| cache.shared((7, 3), at, || found(n)).map(|pair| pair.sums.n);
        cache.begin(ColourModel::default(), &[3, 7]);
        assert_eq!([n(&cache, guess, 1), n(&cache, guess, 2)], [Some(1); 2]);
        assert_eq!(n(&cache, RoundedGuess([1, 0, 0, 0, 0, 0]), 3), Some(3));
        cache.begin(ColourModel { lag_s: 0.01, ..ColourModel::default() }, &[3, 7]);
        assert_eq!(n(&cache, RoundedGuess([1, 0, 0, 0, 0, 0]), 4), Some(4));
        cache.begin(ColourModel { lag_s: 0.01, ..ColourModel::default() }, &[7]);
        assert_eq!(n(&cache, RoundedGuess([1, 0, 0, 0, 0, 0]), 5), Some(5));
    }
}
