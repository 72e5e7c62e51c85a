//! The pairs of keyframes under the present camera: surfaces moved, matched and summed.

use crate::problem::{CalibrationKeyframe, Problem};
use crate::residuals::{self, PairSums, Rule, Sides};
use crate::warp::SurfaceWarp;
use rayon::prelude::*;
use tessera_geometry::{Camera, Pose};
use tessera_registration::{
    GridCamera, MatchLimits, Matcher, Queries, Sampler, Selection, ShutterTable, Target,
};
use tessera_surface::{SurfaceView, Vertex};

/// Fewer matches do not make a pair.
const MIN_MATCHES: usize = 30;

/// A keyframe made ready under the present camera.
struct PreparedKeyframe {
    vertices: Vec<Vertex>,
    queries: Queries,
    shutter: ShutterTable,
}

/// Sums of all pairs that see enough of the same, about the present poses and camera. The first
/// iteration searches farther.
pub(crate) fn match_all(
    problem: &Problem<'_>,
    camera: &Camera,
    poses: &[Pose],
    iteration: u32,
) -> Vec<PairSums> {
    let grid = problem.grid;
    let warp = SurfaceWarp::new(problem.made_with, camera, grid, problem.offset_px);
    let prepare = |keyframe: &CalibrationKeyframe<'_>| {
        let vertices = warp.apply(keyframe.vertices);
        let mut samples = Vec::new();
        let surface = SurfaceView { grid, vertices: &vertices };
        Sampler::default().draw(&surface, keyframe.frame_index, problem.registration, &mut samples);
        let shutter =
            ShutterTable::new(camera, &keyframe.velocity, grid.height, grid.step, problem.offset_px);
        let mut queries = Queries::default();
        queries.fill(&samples, &shutter);
        PreparedKeyframe { vertices, queries, shutter }
    };
    let prepared: Vec<PreparedKeyframe> = problem.keyframes.par_iter().map(prepare).collect();
    let limits = MatchLimits {
        first_distance_m: problem.first_distance_m as f32,
        tightness: if iteration == 1 { 0.5 } else { 1.0 },
        pose_sigma_m: 0.0,
    };
    let rule = Rule { noise: problem.noise, epsilon: f64::from(problem.registration.covariance_epsilon()) };
    let matcher = || {
        Matcher::new(GridCamera::new(camera, grid, problem.offset_px), problem.noise, problem.registration)
    };
    let found: Vec<Option<PairSums>> = problem
        .pairs
        .par_iter()
        .map_init(matcher, |matcher, &(query, target)| {
            let older = &prepared[target];
            let surface = SurfaceView { grid, vertices: &older.vertices };
            let view = Target { surface, shutter: &older.shutter, tree: None };
            let at = poses[target].inverse() * poses[query];
            let selection = Selection { count: problem.queries_per_pair, shift: target };
            let (_, report) = matcher.match_pair(&prepared[query].queries, selection, &view, &at, &limits);
            let is_enough = report.n_matches as usize >= MIN_MATCHES
                && f64::from(report.n_matches) >= problem.min_overlap * f64::from(report.n_queries);
            let velocity = |k: usize| (k, problem.keyframes[k].velocity);
            let sides = Sides { query: velocity(query), target: velocity(target) };
            is_enough.then(|| residuals::sum(camera, &rule, &matcher.matches(), &at, &sides))
        })
        .collect();
    found.into_iter().flatten().collect()
}

/// Root mean square normal residual, standard deviations of depth.
pub(crate) fn residual_sigmas(pairs: &[PairSums]) -> f64 {
    let (sum, n) = pairs.iter().fold((0.0, 0), |(sum, n), pair| (sum + pair.sigmas_sq, n + pair.n_matches));
    (sum / n.max(1) as f64).sqrt()
}
