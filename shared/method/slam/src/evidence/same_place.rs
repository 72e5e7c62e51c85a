//! Whether two views show the same place: the log-likelihood ratio of one aligned pair.
//!
//! At the pair's own optimum five quantities are measured: features that agree of those that could, overlap, free
//! space that the one saw through where the other has a surface, matches, and how the surfaces hold the pose: a
//! plane before a plane fits wherever it is tried. Each adds a weight that is monotone in it. The weights are fitted
//! to pairs whose answer is known ([`same_place_table`](crate::evidence::same_place_table)).

use crate::evidence::same_place_table::{SHAPE, WITH_FEATURES};
use crate::features::matching::{PairFinder, Reach};
use crate::features::residuals;
use crate::loops::matchable::Matchable;
use crate::loops::pair_alignment::PairAlignment;
use crate::map::context::Context;
use crate::map::keyframe::KeyframeState;
use crate::map::surfaces::KeyframeSurfaces;
use crate::settings::GlobalSettings;
use nalgebra::SymmetricEigen;
use tessera_features::Correspondence;
use tessera_geometry::{Matrix6, Pose};
use tessera_registration::{MatchLimits, Matcher, PairReport, Queries, Sampler};

/// Queries of a measurement: enough for shares to a few per cent.
const N_QUERIES: usize = 200;
/// Tightness of the limits from one outer iteration to the next.
const SCHEDULE: [f32; 3] = [0.0, 1.0, 1.0];
/// Squared normalised error of a feature that agrees with a pose, at most: the chi-square of two dimensions at one
/// in 10^5, beside the error of the surfaces' pose.
const AGREES_SQ: f64 = 25.0;

/// Features of either view, at least, to count those that agree: a dozen of two fifths of them.
const LEAST_SEEN: usize = 30;

/// What one aligned pair of views shows, each a share or a number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlaceEvidence {
    /// Features of both views of which none is without an observation; `None`: too few in one of them, or colour is
    /// not trusted.
    pub n_agreeing: Option<u32>,
    /// Features that agree over those that could: the smaller number of both views times the overlap.
    pub agreeing: f64,
    /// Share of the query's points that project into the target at a depth measured there.
    pub overlap: f64,
    /// Share of these that have a match.
    pub matched: f64,
    /// Share of these that float in front of what the target saw, beyond the noise of both.
    pub in_front: f64,
    /// Median normal residual, standard deviations.
    pub residual_sigmas: f64,
    /// Smallest eigenvalue of the translation's information over its trace: 0 for a plane, 1/3 where surfaces
    /// face every way.
    pub shape: f64,
}

impl PlaceEvidence {
    /// From the matches of a pair at its optimum, and their information of the pose, without features.
    pub(crate) fn of_surfaces(report: &PairReport, information: &Matrix6) -> Self {
        let share = |part: u32, whole: u32| f64::from(part) / f64::from(whole.max(1));
        let translation = information.fixed_view::<3, 3>(0, 0).into_owned();
        let least = SymmetricEigen::new((translation + translation.transpose()) * 0.5).eigenvalues.min();
        let trace = translation.trace();
        Self {
            n_agreeing: None,
            agreeing: 0.0,
            overlap: share(report.n_in_view, report.n_queries),
            matched: share(report.n_matches, report.n_in_view),
            in_front: share(report.n_in_front, report.n_in_view),
            residual_sigmas: f64::from(report.median_residual_sigmas),
            shape: if trace > 0.0 { least.max(0.0) / trace } else { 0.0 },
        }
    }

    /// The same with features, of which `n_agreeing` agree with the pose; `n_seen`: those of either view.
    pub(crate) fn with_features(self, n_seen: [usize; 2], n_agreeing: usize) -> Self {
        let fewer = n_seen[0].min(n_seen[1]);
        if fewer < LEAST_SEEN {
            return self;
        }
        let could = (fewer as f64 * self.overlap).max(n_agreeing as f64).max(1.0);
        Self { n_agreeing: Some(n_agreeing as u32), agreeing: n_agreeing as f64 / could, ..self }
    }

    /// The quantities in the order of the table's rows.
    pub fn quantities(&self) -> [f64; 7] {
        let n_agreeing = self.n_agreeing.map_or(0.0, f64::from);
        let Self { agreeing, overlap, matched, in_front, residual_sigmas, shape, .. } = *self;
        [n_agreeing, agreeing, overlap, matched, in_front, residual_sigmas, shape]
    }

    /// Log-likelihood ratio of "the same place, aligned as it is" against any other, nats.
    pub fn llr_nats(&self) -> f64 {
        let table = if self.n_agreeing.is_some() { &WITH_FEATURES } else { &SHAPE };
        let steps = table.steps.iter().filter(|step| self.quantities()[step.quantity] >= step.from);
        table.constant_nats + steps.map(|step| step.nats).sum::<f64>()
    }
}

/// A step of a weight that is monotone: what it adds from a value of a quantity on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WeightStep {
    /// Its place in [`PlaceEvidence::quantities`].
    pub(crate) quantity: usize,
    pub(crate) from: f64,
    pub(crate) nats: f64,
}

/// The weights of all quantities.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WeightTable {
    pub(crate) constant_nats: f64,
    pub(crate) steps: &'static [WeightStep],
}

/// A pair at its own optimum, which is looked for from `target_from_query`: that, and what the surfaces show there.
pub(crate) fn measure(
    matcher: &mut Matcher,
    query: &Queries,
    target: &Matchable<'_>,
    target_from_query: &Pose,
) -> (Pose, PlaceEvidence) {
    let limits = |tightness: f32| MatchLimits::drifted(GlobalSettings::FIRST_DISTANCE_M, tightness);
    let alignment = PairAlignment { query, target, n_queries: N_QUERIES, limits: &limits };
    let pair = alignment.solve(matcher, target_from_query, &SCHEDULE);
    let information = pair.block.linearise(&pair.target_from_query).0;
    (pair.target_from_query, PlaceEvidence::of_surfaces(&pair.report, &information))
}

/// Correspondences that agree with a relative pose.
pub(crate) fn n_agreeing(correspondences: &[Correspondence], target_from_query: &Pose) -> usize {
    correspondences.iter().filter(|c| residuals::squared_error(c, target_from_query) < AGREES_SQ).count()
}

/// Measures pairs of keyframes of a map: for the command that fits the table.
pub struct PlaceProbe<'a> {
    context: &'a Context,
    sides: Vec<Matchable<'a>>,
    finder: PairFinder,
    matcher: Matcher,
}

impl<'a> PlaceProbe<'a> {
    /// All keyframes of a map, by id.
    pub fn new(
        context: &'a Context,
        keyframes: &[KeyframeState],
        surfaces: &'a dyn KeyframeSurfaces,
    ) -> Self {
        let mut sampler = Sampler::default();
        let side = |k: &KeyframeState| {
            let features = surfaces.features_once(k.id);
            Matchable::new(context, &mut sampler, k, surfaces).with_features(context, features)
        };
        let sides = keyframes.iter().map(side).collect();
        Self { context, sides, finder: PairFinder::new(context), matcher: context.matcher() }
    }

    /// The relative pose, `target_from_query`, on which features agree.
    pub fn by_features(&mut self, query: usize, target: usize) -> Option<Pose> {
        let seen = [query, target].map(|k| self.sides[k].seen(self.context));
        let seed = (query as u64) << 32 | target as u64;
        let found = self.finder.find(self.context, seen, &Pose::identity(), Reach::ANYWHERE, seed)?;
        Some(found.target_from_query)
    }

    /// The pair's optimum about `guess`, `target_from_query`, and what it shows there.
    pub fn measure(&mut self, query: usize, target: usize, guess: &Pose) -> (Pose, PlaceEvidence) {
        let [own, other] = [query, target].map(|k| &self.sides[k]);
        let (at, evidence) = measure(&mut self.matcher, &own.queries, other, guess);
        let seen = [own.seen(self.context), other.seen(self.context)];
        let seed = (query as u64) << 32 | target as u64;
        let found = self.finder.find(self.context, seen, &at, Reach::ANYWHERE, seed);
        let n_agreeing = found.map_or(0, |pair| n_agreeing(&pair.inliers, &at));
        (at, evidence.with_features(seen.map(|side| side.features.len()), n_agreeing))
    }
}
