//! Searches of single pairs of keyframes: loop tests, features and surface matches.

use crate::map::detection::{self, TrackPoint};
use crate::map::records::{LoopVerdict, MatchPose};
use crate::optimise::association::Keyframes;
use crate::optimise::known_pairs::KnownPair;
use crate::pairs::feature_cache::{PairIds, RoundedGuess};
use crate::pairs::keyframe_pair::{MIN_FEATURES, PairSearch, SurfaceMatches};
use crate::pairs::match_cache::{MatchedPair, PairFeatures};
use crate::pairs::matching::{PairFinder, Reach};
use crate::pairs::verification::{self, Tested};
use crate::pairs::weighted_pair::FeaturePair;
use crate::settings::GlobalSettings;
use crate::tracking::degeneracy::is_determined;
use crate::tracking::sight::ENOUGH_FEATURES;
use std::borrow::Cow;
use std::sync::Arc;
use tessera_geometry::{Matrix6, Pose};
use tessera_registration::{MatchLimits, Matcher};
use tessera_surface::Vertex;

/// What looks at pairs one after the other.
pub(crate) struct PairSearcher<'a> {
    pub(crate) matcher: Matcher,
    pub(crate) finder: PairFinder,
    /// The place of the last target, and its vertices.
    pub(crate) looked_at: Option<(usize, Cow<'a, [Vertex]>)>,
}

impl<'a> Keyframes<'a> {
    pub(crate) fn ids(&self, (query, target): (usize, usize)) -> PairIds {
        (self.keyframes[query].id, self.keyframes[target].id)
    }

    pub(crate) fn closes_loop(&self, (query, target): (usize, usize)) -> bool {
        let [newer, older] = [query, target].map(|k| TrackPoint::of_keyframe(&self.keyframes[k]));
        detection::closes_loop(&self.context.mapping.loops, &newer, &older)
    }

    pub(crate) fn test(
        &self,
        searcher: &mut PairSearcher<'a>,
        (query, target): (usize, usize),
        now: &Pose,
    ) -> Tested {
        let [queries, surface] = [query, target].map(|k| self.matchables.get(k));
        verification::test(&mut searcher.matcher, queries, surface, now)
    }

    /// Features that two keyframes share near a relative pose.
    pub(crate) fn shared(
        &self,
        searcher: &mut PairSearcher<'a>,
        places: (usize, usize),
        near: &Pose,
    ) -> Option<Arc<FeaturePair>> {
        if !self.context.mapping.features.enabled {
            return None;
        }
        let (ids, guess) = (self.ids(places), RoundedGuess::of(near));
        self.cache.shared(ids, guess, || {
            let sides = [places.0, places.1].map(|k| self.matchables.get(k).seen(self.context));
            let seed = u64::from(ids.0) << 32 | u64::from(ids.1);
            let found = searcher.finder.find(self.context, sides, &guess.pose(), Reach::Near, seed);
            // Their sums are all that the graph needs.
            found.map(|pair| Arc::new(FeaturePair { inliers: Vec::new(), ..pair }))
        })
    }

    /// The pair with its matches at a pose under the last limits, searched or known.
    pub(crate) fn matched(
        &self,
        searcher: &mut PairSearcher<'a>,
        known: &mut KnownPair,
        at: (MatchPose, Pose),
        features: PairFeatures,
    ) -> Arc<MatchedPair> {
        let limits = MatchLimits::new(GlobalSettings::FIRST_DISTANCE_M, 1.0);
        let find = |pose: &Pose| self.surfaces_matched(searcher, known.places, pose, &limits);
        let matched = MatchedPair::known_or(known.matched.take(), at, features, find);
        known.matched = Some(Arc::clone(&matched));
        matched
    }

    /// The pair with its matches under the limits of an early iteration.
    pub(crate) fn searched_widely(
        &self,
        searcher: &mut PairSearcher<'a>,
        places: (usize, usize),
        (now, tightness): (&Pose, f32),
        features: PairFeatures,
    ) -> Arc<MatchedPair> {
        let limits = if self.closes_loop(places) { MatchLimits::drifted } else { MatchLimits::new };
        let at = MatchPose::of(now);
        let limits = limits(GlobalSettings::FIRST_DISTANCE_M, tightness);
        let at = (at, at.pose());
        let surfaces = self.surfaces_matched(searcher, places, &at.1, &limits);
        Arc::new(MatchedPair::new(at, surfaces, features))
    }

    fn surfaces_matched(
        &self,
        searcher: &mut PairSearcher<'a>,
        (query, target): (usize, usize),
        at: &Pose,
        limits: &MatchLimits,
    ) -> SurfaceMatches {
        let [queries, surface] = [query, target].map(|k| self.matchables.get(k));
        // Pairs come by target, so that the surface of each is read once.
        let PairSearcher { matcher, looked_at, .. } = searcher;
        if looked_at.as_ref().is_none_or(|(of, _)| *of != target) {
            *looked_at = Some((target, surface.vertices()));
        }
        let vertices = looked_at.as_ref().map_or(&[][..], |(_, vertices)| vertices);
        let surface = surface.target(vertices);
        let search = PairSearch { queries: queries.queries(), surface, target: self.keyframes[target].id };
        search.find(matcher, at, limits)
    }

    /// The verdict on a loop by its surfaces, with what features say of it: what shares many overlaps, however
    /// little depth there is, and of bare walls that fit wherever they are tried none says that two views with
    /// features, which share none, are of one place.
    pub(crate) fn by_features(
        &self,
        verdict: LoopVerdict,
        (query, target): (usize, usize),
        seen: Option<&FeaturePair>,
        information: impl Fn() -> Matrix6,
    ) -> LoopVerdict {
        let n_features = |k| self.matchables.get(k).n_features();
        let have_features = || [query, target].into_iter().all(|k| n_features(k) >= ENOUGH_FEATURES);
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
}
