//! Global optimisation (III-G; method 8) as a description for the one outer loop: all keyframes are
//! free but the first, and loops are weighed by graduated non-convexity.

use crate::loops::matchable::Matchable;
use crate::loops::verification::KnownLoops;
use crate::map::context::Context;
use crate::map::records::LoopRecord;
use crate::map::state::KeyframeState;
use crate::map::surfaces::KeyframeSurfaces;
use crate::optimise::association::KeyframeAssociation;
use crate::optimise::sample_cache::Drawn;
use crate::settings::GlobalSettings;
use tessera_geometry::Pose;
use tessera_graph::{GemanMcClure, INNER_ITERATIONS, MultiEdge, Schedule};
use tessera_numerics::Step;
use tessera_numerics::parallel::map_in_parts;
use tessera_registration::{Sampler, gather};
use tessera_surface::SurfaceView;

/// The outcome of an optimisation.
pub(crate) struct Solution {
    pub(crate) poses: Vec<Pose>,
    /// Loop pairs of the last outer iteration.
    pub(crate) loops: Vec<LoopRecord>,
    pub(crate) outer_iterations: u32,
    /// Graduated rounds over all outer iterations; 0: every loop fitted at once.
    pub(crate) n_rounds: u32,
}

/// Solves for all keyframes, the first one fixed. The same bits for any number of threads: each
/// pair is summed by itself, and pairs are added in order. Pairs in `known` are not tested again.
/// Without a solution the poses stay as they are: a correction that changes nothing.
pub(crate) fn solve(
    context: &Context,
    keyframes: &[KeyframeState],
    surfaces: &dyn KeyframeSurfaces,
    drawn: &Drawn,
    known: KnownLoops,
    outer_iterations: u32,
    progress: &mut dyn FnMut(),
) -> Solution {
    let matchable = matchable(context, keyframes, surfaces, drawn, progress);
    let problem = MultiEdge {
        poses: keyframes.iter().map(|k| Pose::from(&k.world_from_camera)).collect(),
        is_fixed: (0..keyframes.len()).map(|place| place == 0).collect(),
        priors: Vec::new(),
        schedule: Schedule::shrinking(outer_iterations, INNER_ITERATIONS),
        kernel: Some(GemanMcClure {
            limit_sigmas: GlobalSettings::LOOP_RESIDUAL_SIGMAS,
            metric_factor: context.matcher().metric_factor(),
        }),
        isa: context.registration.isa,
    };
    let mut association = KeyframeAssociation::new(context, keyframes, matchable, known);
    let solved = problem.solve(&mut association, progress);
    context.steps.leave();
    let loops = association.loop_records(&solved);
    let (outer_iterations, n_rounds) = (solved.outer_iterations, solved.n_rounds);
    Solution { poses: solved.graph.poses, loops, outer_iterations, n_rounds }
}

/// All keyframes with their samples, drawn or known from an earlier optimisation.
fn matchable<'a>(
    context: &Context,
    keyframes: &[KeyframeState],
    surfaces: &'a dyn KeyframeSurfaces,
    drawn: &Drawn,
    progress: &mut dyn FnMut(),
) -> Vec<Matchable<'a>> {
    context.steps.enter(Step::Prepare);
    let matchable = map_in_parts(
        keyframes,
        Sampler::default,
        |sampler, k| {
            let surface = SurfaceView { grid: context.grid, vertices: surfaces.vertices(k.id) };
            let draw = || sampler.choose(&surface, k.frame_index, &context.registration).into();
            let mut samples = Vec::new();
            let key = (k.id, k.frame_index, surface.vertices.len());
            gather(&surface, &drawn.of(key, draw), &mut samples);
            Matchable::with_samples(context, k, surface, &samples)
                .with_features(context, surfaces.features(k.id))
        },
        progress,
    );
    drawn.keep_only(&keyframes.iter().map(|k| k.id).collect::<Vec<_>>());
    matchable
}
