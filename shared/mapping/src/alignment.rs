//! One frame against fixed references: the outer iterations of SPEC 5.1.

use crate::context::Context;
use crate::degeneracy::{self, FreeDirection};
use crate::trees::Trees;
use tessera_geometry::{Matrix6, Pose, Twist, Vector6, log};
use tessera_registration::{
    BlockSums, BrightnessUse, Graph, MatchLimits, Matcher, Pair, PairBlock, PairReport, Prior, Queries,
    Sample, Selection, ShutterTable, Target,
};
use tessera_steps::Step;
use tessera_surface::SurfaceView;

/// Outer iterations that follow once free directions are held at the prediction.
const HELD_ITERATIONS: u32 = 3;
/// First distance limit when poses are only compared, metres.
const TRIED_DISTANCE_M: f64 = 0.1;

/// A fixed surface with its pose.
pub(crate) struct Reference<'a> {
    pub(crate) world_from_camera: Pose,
    /// Names its surface among the recent frames or, with `true`, among the keyframes.
    pub(crate) key: (bool, u64),
    pub(crate) surface: SurfaceView<'a>,
    pub(crate) shutter: ShutterTable,
}

/// Where the new frame should be, and how it got there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prediction {
    pub(crate) world_from_camera: Pose,
    /// The frame before, and the seconds since: the rolling shutter's velocity comes from both.
    pub(crate) previous: Option<(Pose, f64)>,
    /// Whether a motion is known that leads here: without one it is the last pose, and a guess.
    pub(crate) is_known: bool,
    /// Velocity until an alignment says better.
    pub(crate) velocity: Twist,
    /// Standard deviation of the rotation about each axis where a gyroscope measured it, radians.
    pub(crate) rotation_sigma_rad: Option<f64>,
    /// First distance limit, metres.
    pub(crate) first_distance_m: f64,
    pub(crate) outer_iterations: u32,
}

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
    /// Directions that the matches leave free; they are held at the prediction.
    pub(crate) free: Vec<FreeDirection>,
    /// As in the prediction.
    pub(crate) rotation_sigma_rad: Option<f64>,
    pub(crate) outer_iterations: u32,
    pub(crate) is_solved: bool,
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
    pub(crate) fn fitting(&self) -> f64 {
        let n_queries: u32 = self.reports.iter().map(|r| r.n_queries).sum();
        let n_in_front: u32 = self.reports.iter().map(|r| r.n_in_front).sum();
        (f64::from(self.n_matches()) - f64::from(n_in_front)) / f64::from(n_queries.max(1))
    }

    /// Largest median normal residual of a reference that has matches, standard deviations.
    pub(crate) fn residual_sigmas(&self) -> f64 {
        let medians =
            self.reports.iter().filter(|r| r.n_matches > 0).map(|r| f64::from(r.median_residual_sigmas));
        medians.fold(0.0, f64::max)
    }
}

/// Buffers of the alignment, reused from frame to frame.
pub(crate) struct Aligner {
    matcher: Matcher,
    queries: Queries,
    shutter: ShutterTable,
    trees: Trees,
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
        }
    }

    /// Aligns `samples` to the references; where geometry leaves a direction free, once more with
    /// the brightness, if the settings say so.
    pub(crate) fn align(
        &mut self,
        context: &Context,
        samples: &[Sample],
        references: &[Reference<'_>],
        prediction: &Prediction,
    ) -> Alignment {
        let brightness = context.registration.weight.brightness;
        let is_always = brightness == BrightnessUse::Always;
        let first = self.descend(context, samples, references, prediction, is_always);
        context.steps.leave();
        let is_asked =
            brightness == BrightnessUse::WhereFree && context.camera.colour_registered && first.is_solved;
        if !is_asked || first.free.is_empty() {
            return first;
        }
        let second = self.descend(context, samples, references, prediction, true);
        if second.is_solved { second } else { first }
    }

    /// Search, then at most ten inner iterations, with shrinking limits, until the last limits have
    /// been solved once (SPEC 5.1).
    fn descend(
        &mut self,
        context: &Context,
        samples: &[Sample],
        references: &[Reference<'_>],
        prediction: &Prediction,
        brightness: bool,
    ) -> Alignment {
        let window = &context.mapping.window;
        let last = prediction.outer_iterations.max(2) - 1;
        let mut result = Alignment {
            world_from_camera: prediction.world_from_camera,
            velocity: prediction.velocity,
            blocks: Vec::new(),
            reports: Vec::new(),
            information: Matrix6::zeros(),
            free: Vec::new(),
            rotation_sigma_rad: prediction.rotation_sigma_rad,
            outer_iterations: 0,
            is_solved: false,
        };
        context.steps.enter(Step::Prepare);
        self.queries.fill(samples, &self.shutter);
        let trees = self.trees.of(context, references);
        let targets: Vec<Target<'_>> = references
            .iter()
            .zip(&trees)
            .map(|(r, tree)| Target { surface: r.surface, shutter: &r.shutter, tree: tree.as_deref() })
            .collect();
        let factor = self.metric_factor(context);
        let seconds = prediction.previous.map_or(0.0, |(_, seconds)| seconds);
        let motion = prior(context, prediction, self.independent_factor(), factor);
        let (mut k, mut is_checked, mut n_more) = (0, false, 0);
        loop {
            let limits = MatchLimits {
                first_distance_m: prediction.first_distance_m as f32,
                progress: k as f32 / last as f32,
                pose_sigma_m: 0.0,
                brightness,
            };
            self.match_all(context, references, &targets, &limits, &mut result);
            result.outer_iterations += 1;
            context.steps.enter(Step::Solve);
            let held = (!result.free.is_empty()).then(|| Prior {
                vertex: 0,
                predicted: prediction.world_from_camera,
                information: degeneracy::hold(&result.free, seconds) * factor,
            });
            let mut graph = graph_of(references, &result, motion.iter().chain(&held));
            let Ok(report) = graph.optimise(context.registration.inner_iterations, &mut || ()) else {
                result.is_solved = false;
                return result;
            };
            let n = references.len();
            result.is_solved = true;
            result.world_from_camera = graph.poses[n];
            if let Some((previous, seconds)) = prediction.previous {
                let step = log(&(previous.inverse() * result.world_from_camera));
                result.velocity = step.scaled(1.0 / seconds);
            }
            if k == last {
                if !is_checked {
                    // Judged by the last, tightest matches: the first ones are too often wrong.
                    is_checked = true;
                    let centroid = degeneracy::centroid(result.blocks.iter().map(|(_, sums)| sums));
                    let metric = information(&graph, n) / factor;
                    result.free = degeneracy::free_directions(window, &metric, &centroid);
                    n_more = if result.free.is_empty() { 0 } else { HELD_ITERATIONS };
                }
                if n_more > 0 {
                    n_more -= 1;
                    continue;
                }
                let priors: Matrix6 = graph.priors.iter().map(|p| p.information).sum();
                result.information = information(&graph, n) + priors;
                return result;
            }
            let is_still =
                report.moved_m < window.converged_step && report.turned_rad < window.converged_step;
            k = if is_still { last } else { k + 1 };
        }
    }

    fn match_all(
        &mut self,
        context: &Context,
        references: &[Reference<'_>],
        targets: &[Target<'_>],
        limits: &MatchLimits,
        result: &mut Alignment,
    ) {
        context.steps.enter(Step::Prepare);
        context.fill_shutter(&result.velocity, &mut self.shutter);
        self.queries.set_shutter(&self.shutter);
        result.blocks.clear();
        result.reports.clear();
        let window = &context.mapping.window;
        // While the pose is still far off, fewer matches lead it as well.
        let is_early = limits.progress < 1.0;
        let share = if is_early { window.early_share } else { 1.0 };
        let count = (f64::from(window.match_budget) * share) as usize / references.len().max(1);
        for (place, (reference, target)) in references.iter().zip(targets).enumerate() {
            let selection = Selection { count, shift: place };
            let target_from_query = reference.world_from_camera.inverse() * result.world_from_camera;
            let (sums, report) =
                self.matcher.match_pair(&self.queries, selection, target, &target_from_query, limits);
            result.blocks.push((target_from_query, sums));
            result.reports.push(report);
        }
    }

    /// What a search from one pose finds, with middling limits and without solving.
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
        let limits = MatchLimits::new(TRIED_DISTANCE_M, 0.5);
        self.matcher.match_pair(&self.queries, selection, &target, &target_from_query, &limits).1
    }

    /// Makes an inverse information matrix metric: the variance of one correspondence times how
    /// many correspondences say the same (SPEC 9.3).
    pub(crate) fn metric_factor(&self, context: &Context) -> f64 {
        self.independent_factor() * context.mapping.window.correlation
    }

    /// As [`Self::metric_factor`] for independent correspondences.
    pub(crate) fn independent_factor(&self) -> f64 {
        self.matcher.metric_factor()
    }
}

fn graph_of<'a>(
    references: &[Reference<'_>],
    result: &Alignment,
    priors: impl Iterator<Item = &'a Prior>,
) -> Graph {
    let n = references.len();
    let mut graph = Graph::default();
    for (place, reference) in references.iter().enumerate() {
        graph.poses.push(reference.world_from_camera);
        graph.is_fixed.push(true);
        let (origin, sums) = &result.blocks[place];
        graph.pairs.push(Pair { query: n, target: place, block: PairBlock::new(origin, sums), weight: 1.0 });
    }
    graph.poses.push(result.world_from_camera);
    graph.is_fixed.push(false);
    graph.priors.extend(priors.map(|p| Prior { vertex: n, ..p.clone() }));
    graph
}

/// The prediction as an edge, in the units of the blocks' information: constant velocity, and the
/// rotation as well as the gyroscope knows it. The last pose, from which it counts, is uncertain too.
fn prior(context: &Context, prediction: &Prediction, independent: f64, metric: f64) -> Option<Prior> {
    if !prediction.is_known {
        return None;
    }
    let w = &context.mapping.window;
    let t = independent / (w.prior_translation_m * w.prior_translation_m);
    let r = match prediction.rotation_sigma_rad {
        Some(sigma) => metric / (sigma * sigma + w.inertial_floor_deg.to_radians().powi(2)),
        None => independent / w.prior_rotation_deg.to_radians().powi(2),
    };
    let information = Matrix6::from_diagonal(&Vector6::new(t, t, t, r, r, r));
    Some(Prior { vertex: 0, predicted: prediction.world_from_camera, information })
}

/// Information of the matches about the free pose at the solution.
fn information(graph: &Graph, vertex: usize) -> Matrix6 {
    let mut h = Matrix6::zeros();
    for pair in &graph.pairs {
        let target_from_query = graph.poses[pair.target].inverse() * graph.poses[vertex];
        h += pair.block.linearise(&target_from_query).0;
    }
    h
}
