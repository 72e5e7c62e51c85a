//! Graduated non-convexity over loop closures (method 8.3): the weight of a loop whose measurement
//! does not fit the rest goes to zero.
//!
//! Odometry pairs are trusted. First all loops count in full; where each of them then fits, that is
//! the answer. Otherwise the graph starts again without loops, and each loop is weighed by the
//! Geman-McClure kernel `rho(r) = s^2 r^2 / (2 (s^2 + r^2))` under a shrinking scale `s`: loops that
//! agree with odometry and with each other pull the graph towards themselves, the others keep a
//! weight near zero, however many they are and even if they agree among themselves.

use crate::block::PairBlock;
use crate::costs::Costs;
use crate::graph::{Graph, InnerReport, Pair, Solver, Stop};
use crate::lean::weigh_up;
use crate::statistics::STILL_SIGMAS;
use rayon::prelude::*;
use tessera_geometry::Pose;
use tessera_numerics::NotPositiveDefinite;

/// Share of the best-fitting loops that decides where the scale starts.
const FIRST_SHARE: f64 = 0.2;
/// The scale shrinks by this factor from round to round.
const SHRINK: f64 = 0.7;
/// Rounds at most.
const MAX_ROUNDS: u32 = 40;
/// Steps of a round: the next one changes the weights again, so its optimum is not sought out.
const ROUND_STEPS: u32 = 2;
/// Levenberg-Marquardt steps for a pair's own optimum.
const OWN_STEPS: u32 = 10;

/// The robust kernel of the pairs that close loops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GemanMcClure {
    /// A loop that disagrees with the solution by more standard deviations ends with weight 0;
    /// 0 keeps all loops at full weight.
    pub limit_sigmas: f64,
    /// Makes costs metric, see [`disagreement_sigmas`].
    pub metric_factor: f64,
}

impl GemanMcClure {
    /// The weight `rho'(r) / r = s^4 / (s^2 + r^2)^2 = 1 / (1 + (r/s)^2)^2` of a residual `r` at
    /// scale `s`, both in standard deviations.
    pub fn weight(residual_sigmas: f64, scale_sigmas: f64) -> f64 {
        let ratio = residual_sigmas / scale_sigmas;
        1.0 / (1.0 + ratio * ratio).powi(2)
    }
}

impl GemanMcClure {
    /// When an optimisation of a graph with so many free poses ends; `is_last`: its pairs are not searched again.
    pub(crate) fn stop(&self, n_free: usize, is_last: bool) -> Stop {
        let n_unknowns = 6.0 * n_free as f64;
        Stop { decrease: STILL_SIGMAS * STILL_SIGMAS * self.metric_factor * n_unknowns, is_rough: !is_last }
    }
}

/// How a robust optimisation ended.
pub(crate) struct RobustReport {
    /// Disagreement of each pair with the solution, see [`disagreement_sigmas`]; 0 for odometry.
    pub(crate) residuals_sigmas: Vec<f64>,
    /// Rounds of the graduated part; 0: every loop fitted at once.
    pub(crate) n_rounds: u32,
}

/// A pair's own cost at its optimum, found from `start`.
pub fn own_cost(block: &PairBlock, start: &Pose) -> f64 {
    let mut graph = Graph {
        poses: vec![Pose::identity(), *start],
        is_fixed: vec![true, false],
        pairs: vec![Pair::new(1, 0, block.clone())],
        ..Graph::default()
    };
    // Without a solution the start is the best that is known.
    let _: Result<InnerReport, NotPositiveDefinite> = graph.optimise(OWN_STEPS, &mut || ());
    block.cost(&graph.poses[1])
}

/// How far a transform is from a pair's own optimum, `sqrt((F(T) - F_min) / (factor n))`: the root
/// mean square over its matches of the displacement along the normal in standard deviations of
/// depth. Degenerate directions of the pair (along a wall) do not count.
pub fn disagreement_sigmas(
    block: &PairBlock,
    own_cost: f64,
    target_from_query: &Pose,
    metric_factor: f64,
) -> f64 {
    excess_sigmas(block, block.cost(target_from_query) - own_cost, metric_factor)
}

fn excess_sigmas(block: &PairBlock, excess: f64, metric_factor: f64) -> f64 {
    (excess.max(0.0) / (metric_factor * f64::from(block.n_matches().max(1)))).sqrt()
}

/// Optimises `graph` with a weight of its own for each loop pair; the weights stay in the graph.
///
/// # Errors
/// As [`Graph::optimise`].
pub(crate) fn optimise(
    graph: &mut Graph,
    kernel: &GemanMcClure,
    inner_iterations: u32,
    solver: &mut Solver,
    progress: &mut dyn FnMut(),
) -> Result<RobustReport, NotPositiveDefinite> {
    let limit = kernel.limit_sigmas;
    let start = graph.poses.clone();
    graph.optimise_again(inner_iterations, solver, progress)?;
    let own = |pair: &Pair| match (pair.is_loop, pair.own_cost) {
        (false, _) => 0.0,
        (true, known) => known.unwrap_or_else(|| own_cost(&pair.block, &graph.target_from_query(pair))),
    };
    let own_costs: Vec<f64> = graph.pairs.par_iter().map(own).with_min_len(16).collect();
    let residuals = |graph: &Graph, costs: &mut Costs| {
        residuals_sigmas(graph, &own_costs, graph.costs_at(&graph.poses, costs), kernel.metric_factor)
    };
    let mut found = residuals(graph, &mut solver.costs);
    let is_last_pairs = !solver.stop.is_rough && !graph.ups.measured.is_empty();
    if !(limit > 0.0) || found.iter().all(|r| *r <= limit) {
        if is_last_pairs {
            weigh_up(graph, inner_iterations, solver, progress)?;
            found = residuals(graph, &mut solver.costs);
        }
        return Ok(RobustReport { residuals_sigmas: found, n_rounds: 0 });
    }
    graph.poses = start;
    set_weights(graph, |_| 0.0);
    // Odometry alone may be far off where the poses held loops before: more steps.
    graph.optimise_again(3 * inner_iterations, solver, progress)?;
    found = residuals(graph, &mut solver.costs);
    let mut scale = first_scale(graph, &found).max(limit);
    let mut n_rounds = 0;
    loop {
        n_rounds += 1;
        let is_last = scale <= limit || n_rounds >= MAX_ROUNDS;
        set_weights(graph, |place| match is_last {
            true => f64::from(u8::from(found[place] / scale <= 1.0)),
            false => GemanMcClure::weight(found[place], scale),
        });
        graph.optimise_again(ROUND_STEPS, solver, progress)?;
        found = residuals(graph, &mut solver.costs);
        if is_last {
            break;
        }
        scale = (scale * SHRINK).max(limit);
    }
    // A loop that the others have brought home comes back in; one that left goes.
    set_weights(graph, |place| f64::from(u8::from(found[place] <= limit)));
    graph.optimise_again(inner_iterations, solver, progress)?;
    if is_last_pairs {
        weigh_up(graph, inner_iterations, solver, progress)?;
    }
    Ok(RobustReport { residuals_sigmas: residuals(graph, &mut solver.costs), n_rounds })
}

/// The disagreement of each pair with the poses that have these costs; 0 for odometry.
fn residuals_sigmas(graph: &Graph, own_costs: &[f64], costs: &[f64], metric_factor: f64) -> Vec<f64> {
    let residual = |(pair, (cost, own)): (&Pair, (&f64, &f64))| match pair.is_loop {
        true => excess_sigmas(&pair.block, cost - own, metric_factor),
        false => 0.0,
    };
    graph.pairs.iter().zip(costs.iter().zip(own_costs)).map(residual).collect()
}

/// Twice the 20 % quantile of the loops' residuals.
fn first_scale(graph: &Graph, residuals: &[f64]) -> f64 {
    let loops = residuals.iter().zip(&graph.pairs).filter(|(_, pair)| pair.is_loop);
    let mut sorted: Vec<f64> = loops.map(|(residual, _)| *residual).collect();
    sorted.sort_by(f64::total_cmp);
    2.0 * sorted[((sorted.len() - 1) as f64 * FIRST_SHARE) as usize]
}

fn set_weights(graph: &mut Graph, weight: impl Fn(usize) -> f64) {
    for (place, pair) in graph.pairs.iter_mut().enumerate().filter(|(_, pair)| pair.is_loop) {
        pair.weight = weight(place);
    }
}

#[cfg(test)]
mod tests;
