//! An optimisation that wrong loops cannot bend: each loop pair has a weight that goes to zero
//! when its measurement does not fit the rest (graduated non-convexity).
//!
//! Odometry pairs are trusted. First all loops count in full; if each of them is then content,
//! that is the answer. Otherwise the graph starts again without loops, and loops come in by how
//! well they fit, under a limit that shrinks: those that agree with odometry and with each other
//! pull the graph towards themselves, the others never get a grip, however many they are and
//! even if they agree among themselves.

use crate::settings::GlobalSettings;
use rayon::prelude::*;
use tessera_geometry::Pose;
use tessera_registration::{Graph, InnerReport, NotPositiveDefinite, Pair, PairBlock, Solver};

/// Share of the best-fitting loops that decides where the limit starts.
const FIRST_SHARE: f64 = 0.2;
/// The limit shrinks by this factor from round to round.
const SHRINK: f64 = 0.7;
/// Rounds at most.
const MAX_ROUNDS: u32 = 40;
/// Steps of a round: the next one changes the weights again, so its optimum is not sought out.
const ROUND_STEPS: u32 = 2;

/// How a robust optimisation ended.
pub(crate) struct RobustReport {
    /// Disagreement of each pair with the solution, see [`disagreement_sigmas`]; 0 for odometry.
    pub(crate) residuals_sigmas: Vec<f64>,
    /// Rounds of the graduated part; 0: every loop fitted at once.
    pub(crate) n_rounds: u32,
}

/// The transform at which a pair alone is content, and its cost there.
pub(crate) fn own_optimum(block: &PairBlock, start: &Pose) -> (Pose, f64) {
    let pair = Pair { query: 1, target: 0, block: block.clone(), weight: 1.0 };
    let mut graph = Graph {
        poses: vec![Pose::identity(), *start],
        is_fixed: vec![true, false],
        pairs: vec![pair],
        ..Graph::default()
    };
    // Without a solution the start is the best that is known.
    let _: Result<InnerReport, NotPositiveDefinite> = graph.optimise(10, &mut || ());
    (graph.poses[1], block.cost(&graph.poses[1]))
}

/// How far a transform is from a pair's own optimum: the root mean square over its matches of
/// the displacement along the normal in standard deviations of depth. Directions in which the
/// pair says nothing (along a wall) do not count.
pub(crate) fn disagreement_sigmas(
    block: &PairBlock,
    own_cost: f64,
    target_from_query: &Pose,
    metric_factor: f64,
) -> f64 {
    let excess = (block.cost(target_from_query) - own_cost).max(0.0);
    (excess / (metric_factor * f64::from(block.n_matches().max(1)))).sqrt()
}

/// Optimises `graph` with a weight of its own for each pair where `is_loop`; the weights stay in
/// the graph. `metric_factor` makes costs metric.
///
/// # Errors
/// As [`Graph::optimise`].
pub(crate) fn optimise(
    graph: &mut Graph,
    is_loop: &[bool],
    settings: &GlobalSettings,
    metric_factor: f64,
    inner_iterations: u32,
    progress: &mut dyn FnMut(),
) -> Result<RobustReport, NotPositiveDefinite> {
    let limit = settings.loop_residual_sigmas;
    let mut solver = Solver::default();
    let start = graph.poses.clone();
    graph.optimise_again(inner_iterations, &mut solver, progress)?;
    let own_cost = |(pair, is_loop): (&Pair, &bool)| match is_loop {
        true => own_optimum(&pair.block, &relative(&graph.poses, pair)).1,
        false => 0.0,
    };
    let own_costs: Vec<f64> = graph.pairs.par_iter().zip(is_loop).with_min_len(16).map(own_cost).collect();
    let residuals = |graph: &Graph| -> Vec<f64> {
        let pairs = graph.pairs.iter().zip(is_loop).zip(&own_costs);
        pairs
            .map(|((pair, is_loop), own)| match is_loop {
                true => disagreement_sigmas(&pair.block, *own, &relative(&graph.poses, pair), metric_factor),
                false => 0.0,
            })
            .collect()
    };
    let mut found = residuals(graph);
    if !(limit > 0.0) || found.iter().all(|r| *r <= limit) {
        return Ok(RobustReport { residuals_sigmas: found, n_rounds: 0 });
    }
    graph.poses = start;
    set_weights(graph, is_loop, |_| 0.0);
    // Odometry alone may be far off where the poses held loops before: more steps.
    graph.optimise_again(3 * inner_iterations, &mut solver, progress)?;
    found = residuals(graph);
    let mut sorted: Vec<f64> = found.iter().zip(is_loop).filter(|(_, l)| **l).map(|(r, _)| *r).collect();
    sorted.sort_by(f64::total_cmp);
    let best = sorted[((sorted.len() - 1) as f64 * FIRST_SHARE) as usize];
    let mut scale = (2.0 * best).max(limit);
    let mut n_rounds = 0;
    loop {
        n_rounds += 1;
        let is_last = scale <= limit || n_rounds >= MAX_ROUNDS;
        set_weights(graph, is_loop, |place| {
            let ratio = found[place] / scale;
            if is_last { f64::from(u8::from(ratio <= 1.0)) } else { 1.0 / (1.0 + ratio * ratio).powi(2) }
        });
        graph.optimise_again(ROUND_STEPS, &mut solver, progress)?;
        found = residuals(graph);
        if is_last {
            break;
        }
        scale = (scale * SHRINK).max(limit);
    }
    // A loop that the others have brought home comes back in; one that left goes.
    set_weights(graph, is_loop, |place| f64::from(u8::from(found[place] <= limit)));
    graph.optimise_again(inner_iterations, &mut solver, progress)?;
    Ok(RobustReport { residuals_sigmas: residuals(graph), n_rounds })
}

fn relative(poses: &[Pose], pair: &Pair) -> Pose {
    poses[pair.target].inverse() * poses[pair.query]
}

fn set_weights(graph: &mut Graph, is_loop: &[bool], weight: impl Fn(usize) -> f64) {
    for (place, pair) in graph.pairs.iter_mut().enumerate().filter(|(place, _)| is_loop[*place]) {
        pair.weight = weight(place);
    }
}

#[cfg(test)]
mod tests;
