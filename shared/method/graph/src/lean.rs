//! How far poses may lean beyond what their pairs state (method 12.5).
//!
//! Pairs share errors (a lens that is not the stated one, a keyframe that many are aligned to), so that their
//! information overstates how well a long chain holds roll and pitch. With the right factor `c` of the pairs' variance,
//! what they and the measurements of up are off by, each in units of its variance, is the degrees of freedom that up adds
//! (Paule and Mandel 1982). With a prior of `nu` degrees of freedom for `c = 1`:
//!
//! `Q_pairs(c) / c + Q_up(c) + nu / c = n_up + nu`, where `c >= 1`.

use crate::graph::{Graph, Solver};
use crate::up::AXES;
use tessera_numerics::NotPositiveDefinite;

/// Steps of the factor at most.
const MOST_STEPS: u32 = 10;

/// Gives up the weight beside the pairs that its disagreement with them asks for, at the solution of `graph`, and solves
/// it again.
pub(crate) fn weigh_up(
    graph: &mut Graph,
    inner_iterations: u32,
    solver: &mut Solver,
    progress: &mut dyn FnMut(),
) -> Result<(), NotPositiveDefinite> {
    let mut instruments: Vec<usize> = graph.ups.measured.iter().map(|up| up.instrument).collect();
    instruments.dedup();
    // The vertical of each instrument is free.
    let freedom = AXES * (graph.ups.measured.len() - instruments.len()) as f64;
    let mut alone = graph.clone();
    alone.ups.weight = 0.0;
    alone.optimise_again(inner_iterations, solver, progress)?;
    let least = alone.cost();
    for _ in 0..MOST_STEPS {
        let (ups, poses) = (&graph.ups, &graph.poses);
        let of_pairs = (graph.cost() - ups.cost(poses) - least).max(0.0) / (ups.unit * ups.weight);
        let squares = of_pairs + ups.squares(poses) + ups.prior_freedom / ups.weight;
        let factor = squares / (freedom + ups.prior_freedom);
        if !(factor > 1.0) {
            break;
        }
        graph.ups.weight *= factor;
        for prior in graph.priors.iter_mut().filter(|prior| instruments.contains(&prior.vertex)) {
            prior.information *= factor;
        }
        graph.optimise_again(inner_iterations, solver, progress)?;
    }
    Ok(())
}
