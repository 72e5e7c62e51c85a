//! Whether two views show the same place: the log-likelihood ratio of one aligned pair.
//!
//! At the pair's own optimum five quantities are measured: features that agree of those that could, overlap, free
//! space that the one saw through where the other has a surface, matches, and how the surfaces hold the pose: a
//! plane before a plane fits wherever it is tried. Each adds a weight that is monotone in it. The weights are fitted
//! to pairs whose answer is known ([`same_place_table`](crate::evidence::same_place_table)).

use crate::evidence::pose_agreement::CHI_SQUARE_6;
use crate::evidence::same_place_table::{ALIKE, SHAPE, WITH_FEATURES};
use crate::map::context::Context;
use crate::map::keyframe::KeyframeState;
use crate::map::surfaces::KeyframeSurfaces;
use crate::pairs::keyframe_pair::MIN_FEATURES;
use crate::pairs::matchable::Matchable;
use crate::pairs::matching::{LEAST_OF_POSE, PairFinder, Reach};
use crate::pairs::pair_alignment::PairAlignment;
use crate::pairs::residuals;
use crate::pairs::verification::{FORWARD, N_QUERIES};
use crate::settings::GlobalSettings;
use nalgebra::{SymmetricEigen, Vector3};
use tessera_features::{Correspondence, Observation};
use tessera_geometry::{Matrix6, Pose, rotation_log};
use tessera_registration::{MatchLimits, Matcher, PairReport, Queries, Sampler};
use tessera_surface::SurfaceView;

/// Overlap of views that show the same. Of labelled pairs of one place that overlap so, features were missed in 1 to
/// 18 % of those of simulated worlds and recordings with features; of those that overlap by 0.1 less in up to 56 %.
const SAME_VIEW_OVERLAP: f64 = 0.75;
/// Overlap of views whose surfaces tell anything; half as many points do where they stand in free space, but a few at
/// the edge of a view err together.
const LEAST_OVERLAP: f64 = 0.4;

/// What one aligned pair of views shows, each a share or a number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlaceEvidence {
    /// Features of both views of which none is without an observation; `None`: too few in one of them, or colour is
    /// not trusted.
    pub n_agreeing: Option<u32>,
    /// Features that agree over those that would, were it the same place.
    pub agreeing: f64,
    /// Features that would agree, were it the same place, where views overlap and fewer do than make a pose; 0 where they do: of those
    /// that the target would have to see the share that agrees with a view just before.
    pub missing: f64,
    /// Share of the query's points that project into the target at a depth measured there.
    pub overlap: f64,
    /// Share with a match of what falls within the target's surface.
    pub matched: f64,
    /// Share of those in view that float in front of what the target saw, beyond the noise of both.
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
        let translation = information.fixed_view::<3, 3>(0, 0).into_owned();
        let least = SymmetricEigen::new((translation + translation.transpose()) * 0.5).eigenvalues.min();
        let trace = translation.trace();
        Self {
            n_agreeing: None,
            agreeing: 0.0,
            missing: 0.0,
            overlap: report.in_view(),
            matched: report.matched_within(),
            in_front: report.in_front(),
            residual_sigmas: f64::from(report.median_residual_sigmas),
            shape: if trace > 0.0 { least.max(0.0) / trace } else { 0.0 },
        }
    }

    /// The same with features, of which `n_agreeing` agree with the pose; `n_seen`: those of either view;
    /// `n_expected`: those that would agree, were it the same place; `agree_near`: whether they agree where they
    /// are looked for near this pose alone, which is asked where they would be missed: among all of an image whose
    /// texture repeats the ratio test refuses most.
    pub(crate) fn with_features(
        self,
        n_seen: [usize; 2],
        (n_agreeing, n_expected): (usize, f64),
        agree_near: impl FnOnce() -> bool,
    ) -> Self {
        let fewer = n_seen[0].min(n_seen[1]);
        if fewer < MIN_FEATURES as usize {
            return self;
        }
        // Where a view just before tells nothing, all in the overlap could.
        let could = if n_expected > 0.0 { n_expected } else { fewer as f64 * self.overlap };
        let is_missed = n_agreeing < LEAST_OF_POSE
            && self.overlap >= SAME_VIEW_OVERLAP
            && n_expected > 0.0
            && !agree_near();
        let missing = if is_missed { n_expected.min(fewer as f64) } else { 0.0 };
        Self {
            n_agreeing: Some(n_agreeing as u32),
            agreeing: n_agreeing as f64 / could.max(1.0),
            missing,
            ..self
        }
    }

    /// The quantities in the order of the table's rows.
    pub fn quantities(&self) -> [f64; 8] {
        let n_agreeing = self.n_agreeing.map_or(0.0, f64::from);
        let Self { agreeing, missing, overlap, matched, in_front, residual_sigmas, shape, .. } = *self;
        [n_agreeing, agreeing, missing, overlap, matched, in_front, residual_sigmas, shape]
    }

    /// As [`Self::against_twins_nats`]; `None` of views that show too little of the same to tell.
    pub(crate) fn least_nats(&self) -> Option<f64> {
        let is_telling = self.makes_a_pose()
            || self.overlap >= LEAST_OVERLAP
            || self.overlap * self.in_front >= 0.5 * LEAST_OVERLAP;
        is_telling.then(|| self.against_twins_nats())
    }

    /// As [`Self::llr_nats`], or against another place whose surfaces are the same, as those of the storeys of a
    /// building, by features alone: the lesser of the two.
    pub(crate) fn against_twins_nats(&self) -> f64 {
        let is_by_features = self.makes_a_pose() || self.missing > 0.0;
        let twins = if is_by_features { self.weigh(&ALIKE) } else { f64::INFINITY };
        self.llr_nats().min(twins)
    }

    fn makes_a_pose(&self) -> bool {
        self.n_agreeing.is_some_and(|n| n as usize >= LEAST_OF_POSE)
    }

    /// Log-likelihood ratio of "the same place, aligned as it is" against any other, nats.
    pub fn llr_nats(&self) -> f64 {
        self.weigh(if self.n_agreeing.is_some() { &WITH_FEATURES } else { &SHAPE })
    }

    fn weigh(&self, table: &WeightTable) -> f64 {
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
    let pair = alignment.solve(matcher, target_from_query, &FORWARD);
    let information = pair.block.linearise(&pair.target_from_query).0;
    (pair.target_from_query, PlaceEvidence::of_surfaces(&pair.report, &information))
}

/// Correspondences that agree with a relative pose: of their two dimensions it is one in 75,000 that does not. Inside
/// surfaces, to which the tables were fitted: at borders there are more that are the same in places that look alike.
pub(crate) fn n_agreeing(correspondences: &[Correspondence], target_from_query: &Pose) -> usize {
    let agrees = |c: &&Correspondence| residuals::squared_error(c, target_from_query) < CHI_SQUARE_6;
    correspondences.iter().filter(|c| c.is_inner()).filter(agrees).count()
}

/// Whether so many agree with a relative pose that none is missed: on some pose a dozen agree by chance, on a given one
/// none.
pub(crate) fn makes_pose(correspondences: &[Correspondence], target_from_query: &Pose) -> bool {
    n_agreeing(correspondences, target_from_query) >= LEAST_OF_POSE
}

/// How much the view of a feature may change until it is not the same to a descriptor: angle, radians, and factor of
/// the distance. Bounds of what is counted, not of what is decided.
const SAME_TO_DESCRIPTOR_RAD: f64 = 20.0_f64.to_radians();
const SAME_TO_DESCRIPTOR_SCALE: f64 = 1.4;

/// Features of a query that lie in the target's image, seen from about the same side and distance, and upright, where the
/// target has the same surface: what floats in front of it or is behind is not what it saw. `context`: of the target's
/// camera.
pub(crate) fn n_comparable(
    context: &Context,
    query: &[Observation],
    target: &SurfaceView<'_>,
    target_from_query: &Pose,
) -> usize {
    let roll_rad = rotation_log(&target_from_query.rotation).z;
    if roll_rad.abs() > SAME_TO_DESCRIPTOR_RAD {
        return 0;
    }
    let [height, width] = [context.camera.height, context.camera.width].map(f64::from);
    let is_comparable = |o: &&Observation| {
        let Some(point) = o.point.filter(|point| point.is_inner).map(|point| point.position_m) else {
            return false;
        };
        let there = target_from_query.rotation * point + target_from_query.translation.vector;
        let Some((row, column)) = context.camera.project(&there) else { return false };
        let turned = target_from_query.rotation * point;
        let scale = there.norm() / point.norm().max(1e-6);
        (0.0..height).contains(&row)
            && (0.0..width).contains(&column)
            && (1.0 / SAME_TO_DESCRIPTOR_SCALE..=SAME_TO_DESCRIPTOR_SCALE).contains(&scale)
            && turned.angle(&there) <= SAME_TO_DESCRIPTOR_RAD
            && is_on_surface(context, target, &there, [row, column])
    };
    query.iter().filter(is_comparable).count()
}

/// Whether a point that projects to a pixel, row and column, is on the surface that the target measured there, within
/// three standard deviations of both depths.
fn is_on_surface(
    context: &Context,
    target: &SurfaceView<'_>,
    point_m: &Vector3<f64>,
    pixel: [f64; 2],
) -> bool {
    let [row, column] = pixel.map(|at| at as usize / target.grid.step);
    let vertex = target.vertices.get(row * target.grid.width + column);
    let Some(vertex) = vertex.filter(|v| v.is_valid() && column < target.grid.width) else { return false };
    let [position, normal] = [vertex.position, vertex.normal].map(|v| Vector3::from(v.map(f64::from)));
    let variance_m2 = [point_m.z, position.z].map(|z| f64::from(context.noise.sigma_m(z as f32)).powi(2));
    normal.dot(&(point_m - position)).powi(2) <= 9.0 * (variance_m2[0] + variance_m2[1])
}

/// Share of the comparable features of a query that agree with a pose; `context`: of the target's camera.
pub(crate) fn agreeing_share(
    context: &Context,
    query: &[Observation],
    correspondences: &[Correspondence],
    (target, target_from_query): (&SurfaceView<'_>, &Pose),
) -> f64 {
    let n = n_comparable(context, query, target, target_from_query);
    (n_agreeing(correspondences, target_from_query) as f64 / n.max(1) as f64).min(1.0)
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
        let found = self.finder.find(self.context, seen, &Pose::identity(), Reach::Anywhere, seed)?;
        Some(found.target_from_query)
    }

    /// Share of the comparable features of a view that agree with another one at the relative pose on which they
    /// agree.
    pub fn agreeing_share(&mut self, query: usize, target: usize) -> f64 {
        let seen = [query, target].map(|k| self.sides[k].seen(self.context));
        let seed = (query as u64) << 32 | target as u64;
        let found = self.finder.find(self.context, seen, &Pose::identity(), Reach::Anywhere, seed);
        let vertices = self.sides[target].vertices();
        let surface = self.sides[target].target(&vertices).surface;
        found.map_or(0.0, |pair| {
            let there = (&surface, &pair.target_from_query);
            agreeing_share(self.context, seen[0].observations, &pair.inliers, there)
        })
    }

    /// The pair's optimum about `guess`, `target_from_query`, and what it shows there; `share`: of the query's
    /// features, as [`Self::agreeing_share`] of a view just before.
    pub fn measure(
        &mut self,
        (query, share): (usize, f64),
        target: usize,
        guess: &Pose,
    ) -> (Pose, PlaceEvidence) {
        let [own, other] = [query, target].map(|k| &self.sides[k]);
        let (at, evidence) = measure(&mut self.matcher, own.queries(), other, guess);
        let seen = [own.seen(self.context), other.seen(self.context)];
        let seed = (query as u64) << 32 | target as u64;
        let found = self.finder.find(self.context, seen, &at, Reach::Anywhere, seed);
        let n_agreeing = found.map_or(0, |pair| n_agreeing(&pair.inliers, &at));
        let vertices = other.vertices();
        let surface = other.target(&vertices).surface;
        let n_expected = share * n_comparable(self.context, seen[0].observations, &surface, &at) as f64;
        let agree_near = || {
            let near = self.finder.find(self.context, seen, &at, Reach::Near, seed);
            near.is_some_and(|pair| makes_pose(&pair.inliers, &at))
        };
        let n_seen = seen.map(|side| side.features.len());
        (at, evidence.with_features(n_seen, (n_agreeing, n_expected), agree_near))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn features_are_missed_where_they_do_not_agree_near_the_pose_either() {
        let surfaces = PlaceEvidence { overlap: 0.85, matched: 0.7, shape: 0.05, ..PlaceEvidence::default() };
        let with = |n_agreeing, near: bool| surfaces.with_features([400; 2], (n_agreeing, 90.0), || near);
        assert_eq!(with(3, false).missing, 90.0);
        assert_eq!((with(3, true).missing, with(40, false).missing), (0.0, 0.0));
        assert!(with(3, false).against_twins_nats() < 0.0 && with(3, true).against_twins_nats() > 0.0);
        let little = PlaceEvidence { overlap: 0.5, ..surfaces };
        assert_eq!(little.with_features([400; 2], (3, 90.0), || panic!("not asked")).missing, 0.0);
    }

    #[test]
    fn a_few_points_in_free_space_at_the_edge_of_a_view_tell_nothing() {
        let of = |overlap, in_front| {
            PlaceEvidence { overlap, in_front, residual_sigmas: 4.0, ..PlaceEvidence::default() }.least_nats()
        };
        assert_eq!(of(0.075, 0.53), None);
        assert!(of(0.35, 0.7).is_some_and(|nats| nats < -5.0));
    }
}
