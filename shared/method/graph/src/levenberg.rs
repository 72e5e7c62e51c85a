//! Levenberg-Marquardt on frozen pairs, damped as in g2o (method 5.2).

use crate::graph::{Graph, InnerReport, Order, Solver};
use crate::solve::BlockSystem;
use tessera_geometry::{Twist, Vector6, compose_normalised};
use tessera_numerics::NotPositiveDefinite;

/// Gain ratio within 5 % of 1: the quadratic model is exact, so divide the damping by 100.
const TRUE_GAIN: f64 = 0.05;
const TRUE_SHRINK: f64 = 0.01;

/// Steps whose largest component is below this are converged: metres and radians.
const STEP_LIMIT: f64 = 1e-6;
/// Relative decrease of the cost below which an optimisation is converged.
const DECREASE_LIMIT: f64 = 1e-6;
/// Rejected steps in a row.
const MOST_REJECTED: u32 = 10;

/// The damping lambda and its schedule.
struct Damping {
    lambda: f64,
    growth: f64,
    n_rejected: u32,
}

impl Damping {
    /// `lambda_0 = 1e-5 max diag H`, or the damping that was last good.
    fn new(largest_diagonal: f64, last: Option<f64>) -> Self {
        let lambda = last.map_or(1e-5 * largest_diagonal, |last| last.max(1e-12 * largest_diagonal));
        Self { lambda, growth: 2.0, n_rejected: 0 }
    }

    fn accept(&mut self, gain: f64) {
        let shrink = 1.0 - (2.0 * gain - 1.0) * (2.0 * gain - 1.0) * (2.0 * gain - 1.0);
        let is_true = (gain - 1.0).abs() < TRUE_GAIN;
        self.lambda *= if is_true { TRUE_SHRINK } else { shrink.clamp(1.0 / 3.0, 2.0 / 3.0) };
        (self.growth, self.n_rejected) = (2.0, 0);
    }

    fn reject(&mut self) {
        self.lambda *= self.growth;
        self.growth *= 2.0;
        self.n_rejected += 1;
    }
}

impl Graph {
    /// At most `max_iterations` accepted steps `(H + lambda I) d = -g`.
    pub(crate) fn levenberg_marquardt(
        &mut self,
        max_iterations: u32,
        order: &Order,
        system: &mut BlockSystem,
        solver: &mut Solver,
        progress: &mut dyn FnMut(),
    ) -> Result<InnerReport, NotPositiveDefinite> {
        let Order { free, slot } = order;
        let Solver { terms, costs, lambda: last_lambda, stop, .. } = solver;
        let mut cost = self.linearise(slot, system, terms);
        let mut report = InnerReport::default();
        let mut damping = Damping::new(system.max_diagonal(), *last_lambda);
        let mut has_moved = false;
        while report.n_accepted < max_iterations && damping.lambda.is_finite() && !free.is_empty() {
            progress();
            if has_moved {
                self.linearise(slot, system, terms);
                has_moved = false;
            }
            let steps = match system.solve(damping.lambda, progress) {
                Ok(steps) => steps,
                Err(error) if damping.n_rejected >= MOST_REJECTED => return Err(error),
                Err(_) => {
                    damping.lambda = damping.lambda.max(1e-9);
                    damping.reject();
                    continue;
                }
            };
            let mut moved = self.poses.clone();
            for (&i, step) in free.iter().zip(&steps) {
                moved[i] = compose_normalised(&self.poses[i], &Twist::from_vector(step));
            }
            let new_cost = self.cost_at(&moved, costs);
            let decrease = cost - new_cost;
            let predicted = predicted_decrease(system, damping.lambda, &steps);
            let gain = decrease / (predicted + 1e-12 * cost + f64::MIN_POSITIVE);
            let is_tiny = steps.iter().map(|d| d.amax()).fold(0.0, f64::max) < STEP_LIMIT;
            if gain > 0.0 && new_cost.is_finite() {
                self.poses = moved;
                report.n_accepted += 1;
                cost = new_cost;
                damping.accept(gain);
                *last_lambda = Some(damping.lambda);
                has_moved = true;
                let is_exact = stop.is_rough && (gain - 1.0).abs() < TRUE_GAIN;
                let of_pairs = || stop.decrease.max(DECREASE_LIMIT * cost);
                let least_decrease = self.ups.least_decrease(6 * free.len()).unwrap_or_else(of_pairs);
                report.is_converged = is_tiny || is_exact || decrease < least_decrease;
            } else {
                // At the minimum rounding decides the sign of the gain: a tiny step is the end.
                report.is_converged = is_tiny;
                damping.reject();
            }
            if report.is_converged || damping.n_rejected > MOST_REJECTED {
                break;
            }
        }
        Ok(report)
    }
}

/// `d^T (lambda d - g)`: a step's gain by the quadratic model.
fn predicted_decrease(system: &BlockSystem, lambda: f64, steps: &[Vector6]) -> f64 {
    steps.iter().zip(&system.gradient).map(|(d, g)| d.dot(&(d * lambda - g))).sum()
}
