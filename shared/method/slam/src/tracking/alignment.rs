//! One frame against a local window of fixed poses (III-F): the window as a description for the one
//! outer loop, [`MultiEdge::solve`].

use crate::estimation::noise_scales::NoiseState;
use crate::estimation::readout::ReadoutRecord;
use crate::map::context::Context;
use crate::pairs::weighted_pair::WeightedPair;
use crate::settings::WindowSettings;
use crate::tracking::degeneracy::DegenerateDirection;
use crate::tracking::prediction::{Prediction, Reference};
use crate::tracking::sight::Sight;
use crate::tracking::trees::Trees;
use crate::tracking::window_association::WindowAssociation;
use tessera_geometry::{Matrix6, Pose, Twist, Vector6};
use tessera_graph::{BlockSums, HalfSums, INNER_ITERATIONS, MultiEdge, Prior, Schedule, Ups};
use tessera_numerics::Step;
use tessera_registration::{
    MatchLimits, Matcher, PairReport, Queries, Sample, Selection, ShutterTable, Target,
};

/// Points on a surface that err together: as evidence they are one.
pub(crate) const SURFACE_CORRELATION: f64 = 10.0;
/// Evidence of a feature that agrees, nats: that of 300,000 pixels over about 100 within five deviations.
const FEATURE_NATS: f64 = 8.0;

/// An alignment's result, good or bad: the caller judges.
#[derive(Clone, Debug)]
pub(crate) struct Alignment {
    pub(crate) world_from_camera: Pose,
    pub(crate) velocity: Twist,
    /// One per reference: where its matches were found, and their sums.
    pub(crate) blocks: Vec<(Pose, BlockSums)>,
    pub(crate) reports: Vec<PairReport>,
    /// Information of the pose from all references, at the result, in the blocks' units.
    pub(crate) information: Matrix6,
    /// Degenerate directions of the matches; they are held at the prediction.
    pub(crate) degenerate: Vec<DegenerateDirection>,
    /// As in the prediction.
    pub(crate) rotation_sigma_rad: Option<f64>,
    /// Features that agree with the result, of the reference that has most.
    pub(crate) n_agreeing: u32,
    pub(crate) is_solved: bool,
    /// What its matches tell of the readout.
    pub(crate) readout: Option<ReadoutRecord>,
    /// One per reference: the sums of its surfaces alone, and the features that it shares with the frame.
    pub(crate) parts: Vec<(HalfSums, Option<WeightedPair>)>,
}

impl Alignment {
    pub(crate) fn n_matches(&self) -> u32 {
        self.reports.iter().map(|r| r.n_matches).sum()
    }

    pub(crate) fn match_share(&self) -> f64 {
        let n_queries: u32 = self.reports.iter().map(|r| r.n_queries).sum();
        f64::from(self.n_matches()) / f64::from(n_queries.max(1))
    }

    /// Points on the references, less those in front of them, as a share of all.
    pub(crate) fn support(&self) -> f64 {
        let n_queries: u32 = self.reports.iter().map(|r| r.n_queries).sum();
        let n_in_front: u32 = self.reports.iter().map(|r| r.n_in_front).sum();
        (f64::from(self.n_matches()) - f64::from(n_in_front)) / f64::from(n_queries.max(1))
    }

    /// Logarithm of the likelihood that the frame is here, over that by chance: of the features that agree, each by the
    /// share of the image in which it would, and of the points on the references less those in front of them, of
    /// which so many err together.
    pub(crate) fn evidence_nats(&self) -> f64 {
        let n_queries: u32 = self.reports.iter().map(|r| r.n_queries).sum();
        let surfaces = self.support() * f64::from(n_queries) / SURFACE_CORRELATION;
        surfaces + f64::from(self.n_agreeing) * FEATURE_NATS
    }

    /// Largest median normal residual of a reference that has matches, standard deviations.
    pub(crate) fn residual_sigmas(&self) -> f64 {
        let medians =
            self.reports.iter().filter(|r| r.n_matches > 0).map(|r| f64::from(r.median_residual_sigmas));
        medians.fold(0.0, f64::max)
    }
}

/// Aligns frames to windows; holds its buffers.
pub(crate) struct Aligner {
    matcher: Matcher,
    queries: Queries,
    shutter: ShutterTable,
    trees: Trees,
    pub(crate) sight: Sight,
}

impl Aligner {
    pub(crate) fn new(context: &Context) -> Self {
        let mut matcher = context.matcher();
        matcher.steps = context.steps.clone();
        Self {
            matcher,
            queries: Queries::default(),
            shutter: context.shutter(&Twist::default()),
            trees: Trees::default(),
            sight: Sight::new(context),
        }
    }

    /// Aligns `samples` to the references: the window as a multi-edge problem, the references fixed, and
    /// the frame as the last vertex.
    pub(crate) fn align(
        &mut self,
        context: &Context,
        samples: &[Sample],
        references: &[Reference<'_>],
        prediction: &Prediction,
    ) -> Alignment {
        context.steps.enter(Step::Prepare);
        let (independent, factor) = (self.independent_factor(), self.metric_factor(context));
        self.queries.fill(samples, &self.shutter);
        let trees = self.trees.of(context, references);
        let targets = references
            .iter()
            .zip(&trees)
            .map(|(r, tree)| Target { surface: r.surface, shutter: &r.shutter, tree: tree.as_deref() })
            .collect();
        let frame = references.len();
        let prior = motion_prior(context, prediction, factor, frame);
        let problem = window_problem(context, references, prediction, prior);
        let mut association = WindowAssociation {
            context,
            prediction,
            references,
            targets,
            factor,
            nominal_factor: independent * NoiseState::default().scales().surfaces,
            matcher: &mut self.matcher,
            queries: &mut self.queries,
            shutter: &mut self.shutter,
            velocity: prediction.velocity,
            blocks: Vec::new(),
            reports: Vec::new(),
            surfaces: Vec::new(),
            degenerate: Vec::new(),
        };
        let solved = problem.solve(&mut association, &mut || ());
        let world_from_camera = solved.graph.poses[frame];
        let mut information = Matrix6::zeros();
        if solved.is_solved {
            association.follow(&world_from_camera);
            let priors: Matrix6 = solved.graph.priors.iter().map(|p| p.information).sum();
            information = solved.graph.information(frame) + priors;
        }
        let readout = association.readout();
        let WindowAssociation { velocity, blocks, reports, degenerate, surfaces, .. } = association;
        Alignment {
            world_from_camera,
            velocity,
            blocks,
            reports,
            information,
            degenerate,
            rotation_sigma_rad: prediction.rotation_sigma_rad,
            n_agreeing: 0,
            is_solved: solved.is_solved,
            readout,
            parts: surfaces.into_iter().zip(references).map(|(s, r)| (s, r.pair.clone())).collect(),
        }
    }

    /// Matches at one pose, with middling limits and without solving.
    pub(crate) fn try_pose(
        &mut self,
        context: &Context,
        samples: &[Sample],
        reference: &Reference<'_>,
        world_from_camera: &Pose,
    ) -> PairReport {
        context.fill_shutter(&Twist::default(), &mut self.shutter);
        self.queries.fill(samples, &self.shutter);
        let target = Target { surface: reference.surface, shutter: &reference.shutter, tree: None };
        let target_from_query = reference.world_from_camera.inverse() * world_from_camera;
        let selection = Selection { count: samples.len(), shift: 0 };
        let limits = MatchLimits::new(context.mapping.first_distance_m()[0], 0.5);
        self.matcher.match_pair(&self.queries, selection, &target, &target_from_query, &limits).1
    }

    /// Makes an inverse information matrix metric: the variance of one correspondence times the estimated
    /// scale of the surfaces (method 9.5).
    pub(crate) fn metric_factor(&self, context: &Context) -> f64 {
        self.independent_factor() * context.scales.surfaces
    }

    /// As [`Self::metric_factor`] for independent correspondences.
    pub(crate) fn independent_factor(&self) -> f64 {
        self.matcher.metric_factor()
    }
}

/// The references, fixed, and the frame as the last vertex.
fn window_problem(
    context: &Context,
    references: &[Reference<'_>],
    prediction: &Prediction,
    prior: Option<Prior>,
) -> MultiEdge {
    let n_outer = prediction.outer_iterations.max(2);
    let fixed = references.iter().map(|r| r.world_from_camera);
    MultiEdge {
        poses: fixed.chain([prediction.world_from_camera]).collect(),
        is_fixed: references.iter().map(|_| true).chain([false]).collect(),
        priors: prior.into_iter().collect(),
        ups: Ups::default(),
        schedule: Schedule {
            converged_step: WindowSettings::CONVERGED_STEP,
            held_iterations: WindowSettings::REFINING_ITERATIONS,
            ..Schedule::shrinking(n_outer, INNER_ITERATIONS)
        },
        kernel: None,
        isa: context.registration.isa,
    }
}

/// The prediction as an edge, in the units of the blocks' information (method 6.1).
fn motion_prior(context: &Context, prediction: &Prediction, metric: f64, vertex: usize) -> Option<Prior> {
    let motion = prediction.motion.as_ref().filter(|_| prediction.is_known)?;
    let weight = |k: usize| metric * context.motion_scale[k / 3] / motion.variance[k];
    let information = Matrix6::from_diagonal(&Vector6::from_fn(|k, _| weight(k)));
    Some(Prior { vertex, predicted: motion.world_from_camera, information })
}
