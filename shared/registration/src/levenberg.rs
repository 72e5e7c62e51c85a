//! Levenberg-Marquardt on frozen matches, damped as in g2o (SPEC 5.2).

use crate::graph::{Graph, InnerReport, Solver};
use crate::solve::{BlockSystem, NotPositiveDefinite};
use tessera_geometry::{Twist, compose_normalised, translation_rotation_norms};

/// Where the model was this near the truth (gain less one), damping has nothing more to do.
const TRUE_GAIN: f64 = 0.05;
/// Its factor then.
const TRUE_SHRINK: f64 = 0.01;

/// Steps below these are no steps (SPEC 5.2): metres and radians.
const STEP_LIMIT: f64 = 1e-6;

impl Graph {
    pub(crate) fn descend(
        &mut self,
        max_iterations: u32,
        free: &[usize],
        slot: &[usize],
        system: &mut BlockSystem,
        solver: &mut Solver,
        progress: &mut dyn FnMut(),
    ) -> Result<InnerReport, NotPositiveDefinite> {
        let start = self.poses.clone();
        let Solver { terms, lambda: last_lambda, .. } = solver;
        let mut cost = self.linearise(slot, system, terms);
        let mut report = InnerReport { cost_before: cost, cost_after: cost, ..InnerReport::default() };
        let largest = system.max_diagonal();
        let mut lambda = last_lambda.map_or(1e-5 * largest, |last| last.max(1e-12 * largest));
        let mut growth = 2.0;
        let mut n_rejected = 0;
        let mut has_moved = false;
        while report.n_accepted < max_iterations && lambda.is_finite() && !free.is_empty() {
            progress();
            if has_moved {
                self.linearise(slot, system, terms);
                has_moved = false;
            }
            let steps = match system.solve(lambda, progress) {
                Ok(steps) => steps,
                Err(error) if n_rejected >= 10 => return Err(error),
                Err(_) => {
                    (lambda, growth, n_rejected) = (lambda.max(1e-9) * growth, growth * 2.0, n_rejected + 1);
                    continue;
                }
            };
            let mut moved = self.poses.clone();
            for (&i, step) in free.iter().zip(&steps) {
                moved[i] = compose_normalised(&self.poses[i], &Twist::from_vector(step));
            }
            let new_cost = self.cost_at(&moved);
            let predicted: f64 =
                steps.iter().zip(&system.gradient).map(|(d, g)| d.dot(&(d * lambda - g))).sum::<f64>();
            let gain = (cost - new_cost) / (predicted + 1e-12 * cost + f64::MIN_POSITIVE);
            let largest = steps.iter().map(|d| d.amax()).fold(0.0, f64::max);
            if gain > 0.0 && new_cost.is_finite() {
                self.poses = moved;
                report.n_accepted += 1;
                let decrease = cost - new_cost;
                cost = new_cost;
                let shrink = 1.0 - (2.0 * gain - 1.0) * (2.0 * gain - 1.0) * (2.0 * gain - 1.0);
                let is_true = (gain - 1.0).abs() < TRUE_GAIN;
                lambda *= if is_true { TRUE_SHRINK } else { shrink.clamp(1.0 / 3.0, 2.0 / 3.0) };
                (growth, n_rejected) = (2.0, 0);
                *last_lambda = Some(lambda);
                if largest < STEP_LIMIT || decrease < 1e-6 * cost {
                    report.is_converged = true;
                    break;
                }
                has_moved = true;
            } else {
                // At the minimum rounding decides the sign of the gain: a tiny step is the end.
                if largest < STEP_LIMIT {
                    report.is_converged = true;
                    break;
                }
                (lambda, growth, n_rejected) = (lambda * growth, growth * 2.0, n_rejected + 1);
                if n_rejected > 10 {
                    break;
                }
            }
        }
        report.cost_after = cost;
        for &i in free {
            let (m, r) = translation_rotation_norms(&(start[i].inverse() * self.poses[i]));
            (report.moved_m, report.turned_rad) = (report.moved_m.max(m), report.turned_rad.max(r));
        }
        Ok(report)
    }
}
