//! All keyframes with all their multi-edges at once (SPEC 5, 8).

use crate::context::Context;
use crate::neighbours;
use crate::state::KeyframeState;
use crate::tracker::KeyframeSurfaces;
use rayon::prelude::*;
use tessera_geometry::{Pose, Twist, Vector6};
use tessera_registration::{Graph, MatchLimits, Pair, PairBlock, Queries, Sampler, ShutterTable, Target};
use tessera_surface::SurfaceView;

/// The outcome of an optimisation.
pub(crate) struct Solution {
    pub(crate) poses: Vec<Pose>,
    /// Pairs far apart in index with the weight they ended with: newer, older, weight.
    pub(crate) loops: Vec<(u32, u32, f64)>,
    pub(crate) outer_iterations: u32,
}

/// A keyframe made ready: queries at its stamp, and its readout motion as a target.
struct Prepared {
    queries: Queries,
    shutter: ShutterTable,
}

/// Solves for all keyframes, the first one fixed. The same bits for any number of threads: each
/// pair is summed by itself, and pairs are added in order.
pub(crate) fn solve(
    context: &Context,
    keyframes: &[KeyframeState],
    surfaces: &dyn KeyframeSurfaces,
    outer_iterations: u32,
    progress: &mut dyn FnMut(),
) -> Solution {
    let settings = &context.mapping.global;
    let mut poses: Vec<Pose> = keyframes.iter().map(|k| Pose::from(&k.world_from_camera)).collect();
    let prepared: Vec<Prepared> = keyframes.par_iter().map(|k| prepare(context, k, surfaces)).collect();
    progress();
    let mut weights = Vec::new();
    for k in 0..outer_iterations {
        let pairs = neighbours::pairs(&poses, settings);
        let limits = MatchLimits {
            first_distance_m: settings.first_distance_m as f32,
            progress: if outer_iterations > 1 { k as f32 / (outer_iterations - 1) as f32 } else { 1.0 },
        };
        let blocks: Vec<Pair> = pairs
            .par_iter()
            .map_init(
                || context.matcher(),
                |matcher, &(query, target)| {
                    let queries = &prepared[query].queries;
                    let count = (settings.queries_per_pair as usize).min(queries.len());
                    // Each pair takes another run of the samples, which are in random order.
                    let start = (target * 97) % (queries.len() - count + 1);
                    let surface =
                        SurfaceView { grid: context.grid, vertices: surfaces.vertices(keyframes[target].id) };
                    let target_view = Target { surface, shutter: &prepared[target].shutter };
                    let target_from_query = poses[target].inverse() * poses[query];
                    let (sums, report) = matcher.match_pair(
                        queries,
                        start..start + count,
                        &target_view,
                        &target_from_query,
                        &limits,
                    );
                    let overlap = f64::from(report.n_matches) / f64::from(report.n_queries.max(1));
                    let is_neighbour = query == target + 1 && report.n_matches >= 30;
                    let weight = if overlap >= settings.min_overlap || is_neighbour { 1.0 } else { 0.0 };
                    Pair { query, target, block: PairBlock::new(&target_from_query, &sums), weight }
                },
            )
            .collect();
        weights = blocks.iter().map(|p| (p.query, p.target, p.weight)).collect();
        let pairs = blocks.into_iter().filter(|p| p.weight > 0.0).collect();
        let mut is_fixed = vec![false; poses.len()];
        is_fixed[0] = true;
        let mut graph = Graph { poses: poses.clone(), is_fixed, pairs, priors: Vec::new() };
        progress();
        // Without a solution the poses stay as they are: a correction that changes nothing.
        if graph.optimise(context.registration.inner_iterations, progress).is_ok() {
            poses = graph.poses;
        }
    }
    let loop_gap = context.mapping.loops.min_frames;
    let loops = weights
        .into_iter()
        .filter(|&(i, j, _)| keyframes[i].frame_index - keyframes[j].frame_index > loop_gap)
        .map(|(i, j, w)| (keyframes[i].id, keyframes[j].id, w))
        .collect();
    Solution { poses, loops, outer_iterations }
}

fn prepare(context: &Context, keyframe: &KeyframeState, surfaces: &dyn KeyframeSurfaces) -> Prepared {
    let surface = SurfaceView { grid: context.grid, vertices: surfaces.vertices(keyframe.id) };
    let mut samples = Vec::new();
    Sampler::default().draw(&surface, keyframe.frame_index, &context.registration, &mut samples);
    let shutter = context.shutter(&Twist::from_vector(&Vector6::from_column_slice(&keyframe.velocity)));
    let mut queries = Queries::default();
    queries.fill(&samples, &shutter);
    Prepared { queries, shutter }
}
