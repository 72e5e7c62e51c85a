//! The one outer loop of the multi-edge optimisation (III-E; method 5.1): data association under
//! shrinking limits, optimisation, again.
//!
//! | Problem | Free poses | Pairs | Schedule |
//! |-|-|-|-|
//! | local window (III-F) | the new frame | frame to each pose of the window | 6, tightest early once still |
//! | global optimisation (III-G) | all keyframes but the first | neighbours and loops | 2, finally 4 |
//! | loop verification | the newer keyframe | the pair alone | wide, tight, tight |
//! | recognition by appearance | the newer keyframe | the pair alone | 5 of 6 |
//!
//! Surfaces are unknown here: the caller is asked for the pairs ([`DataAssociation`]).

use crate::graph::{Graph, Pair, Prior, Solver};
use crate::robust::{self, GemanMcClure};
use crate::up::Ups;
use tessera_geometry::{Pose, translation_rotation_norms};
use tessera_numerics::parallel::in_pool;
use tessera_numerics::{Isa, NotPositiveDefinite};

/// One outer iteration as data association sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OuterIteration {
    /// Outer iterations before this one.
    pub index: u32,
    /// 0: the widest limits of the schedule; 1: the tightest.
    pub tightness: f32,
}

/// The pairs of a multi-edge problem, searched anew in each outer iteration. A closure from poses
/// and iteration to pairs is one.
pub trait DataAssociation {
    /// The pairs at these poses (`world_from_camera`, in the order of the vertices) under the
    /// limits of this iteration. `progress` is called every few milliseconds of long work.
    fn associate(
        &mut self,
        poses: &[Pose],
        iteration: OuterIteration,
        progress: &mut dyn FnMut(),
    ) -> Vec<Pair>;

    /// Priors for what the tightest pairs leave undetermined, asked for once, at their solution.
    /// Where there are any, [`Schedule::held_iterations`] more iterations follow.
    fn hold(&mut self, _solved: &Graph) -> Vec<Prior> {
        Vec::new()
    }
}

impl<F: FnMut(&[Pose], OuterIteration) -> Vec<Pair>> DataAssociation for F {
    fn associate(
        &mut self,
        poses: &[Pose],
        iteration: OuterIteration,
        _progress: &mut dyn FnMut(),
    ) -> Vec<Pair> {
        self(poses, iteration)
    }
}

/// Most Levenberg-Marquardt steps for one set of correspondences (method 5.2): the paper's number.
pub const INNER_ITERATIONS: u32 = 10;

/// The limits of the outer iterations, and when to stop.
#[derive(Clone, Debug, PartialEq)]
pub struct Schedule {
    /// Tightness of each outer iteration, 0 to 1. Empty: nothing is associated or moved.
    pub tightness: Vec<f32>,
    /// Below this pose change (metres and radians), skip to the last iteration; 0: never.
    pub converged_step: f64,
    /// Iterations at the last limits once [`DataAssociation::hold`] has added priors.
    pub held_iterations: u32,
    /// Most Levenberg-Marquardt steps for one set of pairs.
    pub inner_iterations: u32,
}

impl Schedule {
    /// `n` iterations from the widest limits to the tightest in equal steps; one is the tightest.
    pub fn shrinking(n: u32, inner_iterations: u32) -> Self {
        let share = |k: u32| if n > 1 { k as f32 / (n - 1) as f32 } else { 1.0 };
        Self { tightness: (0..n).map(share).collect(), ..Self::steps(&[], inner_iterations) }
    }

    /// Iterations at these limits.
    pub fn steps(tightness: &[f32], inner_iterations: u32) -> Self {
        Self { tightness: tightness.to_vec(), converged_step: 0.0, held_iterations: 0, inner_iterations }
    }
}

/// A multi-edge problem: poses, what is known of them, and how their pairs are searched and weighed.
#[derive(Clone, Debug)]
pub struct MultiEdge {
    /// Initial guess, `world_from_camera` of each vertex.
    pub poses: Vec<Pose>,
    /// Vertices that do not move.
    pub is_fixed: Vec<bool>,
    /// Priors on single poses.
    pub priors: Vec<Prior>,
    /// Up at some of the poses.
    pub ups: Ups,
    /// Limits and stop rules.
    pub schedule: Schedule,
    /// Graduated non-convexity over the pairs that close loops; `None`: all pairs count in full.
    pub kernel: Option<GemanMcClure>,
    /// Instruction sets that the factorisations may use.
    pub isa: Isa,
}

/// A multi-edge problem's outcome.
#[derive(Clone, Debug, Default)]
pub struct Solved {
    /// The last pairs with their weights, the priors, and the poses at their solution.
    pub graph: Graph,
    /// Data associations done.
    pub outer_iterations: u32,
    /// False where an inner optimisation failed: the poses are then those before it.
    pub is_solved: bool,
    /// Disagreement of each pair with the poses, see [`disagreement_sigmas`](crate::disagreement_sigmas);
    /// empty without a kernel.
    pub residuals_sigmas: Vec<f64>,
    /// Rounds of graduated non-convexity over all outer iterations.
    pub n_rounds: u32,
}

impl MultiEdge {
    /// Two poses and nothing else: vertex 0, the target, is fixed at the origin; vertex 1, the
    /// query, starts at `target_from_query`, which is then its pose.
    pub fn pair(target_from_query: &Pose, schedule: Schedule) -> Self {
        Self {
            poses: vec![Pose::identity(), *target_from_query],
            is_fixed: vec![true, false],
            priors: Vec::new(),
            ups: Ups::default(),
            schedule,
            kernel: None,
            isa: Isa::default(),
        }
    }

    /// Associates and optimises along the schedule. The same bits for any number of threads.
    pub fn solve(self, association: &mut dyn DataAssociation, progress: &mut dyn FnMut()) -> Solved {
        let Self { poses, is_fixed, priors, ups, schedule, kernel, isa } = self;
        let graph = Graph { poses, is_fixed, pairs: Vec::new(), priors, ups, isa };
        let mut solved = Solved { graph, is_solved: true, ..Solved::default() };
        let last = schedule.tightness.len().saturating_sub(1);
        let (mut k, mut n_held) = (0, None);
        let mut solver = Solver::default();
        while let Some(&tightness) = schedule.tightness.get(k) {
            let iteration = OuterIteration { index: solved.outer_iterations, tightness };
            solved.graph.pairs = association.associate(&solved.graph.poses, iteration, progress);
            solved.outer_iterations += 1;
            let before = solved.graph.poses.clone();
            if let Some(kernel) = &kernel {
                let n_free = solved.graph.is_fixed.iter().filter(|is_fixed| !**is_fixed).count();
                solver.begin(kernel.stop(n_free, k == last));
            }
            let inner = solved.optimise(kernel.as_ref(), schedule.inner_iterations, &mut solver, progress);
            solved.is_solved = inner.is_ok();
            if !solved.is_solved {
                solved.graph.poses = before;
                break;
            }
            if k < last {
                k = if is_still(&before, &solved.graph, schedule.converged_step) { last } else { k + 1 };
                continue;
            }
            // Judged by the tightest pairs: the first ones are too often wrong.
            let n_left = n_held.get_or_insert_with(|| {
                let held = association.hold(&solved.graph);
                let n_left = if held.is_empty() { 0 } else { schedule.held_iterations };
                solved.graph.priors.extend(held);
                n_left
            });
            let Some(rest) = n_left.checked_sub(1) else { break };
            *n_left = rest;
        }
        solved
    }
}

impl Solved {
    /// The inner iterations on the pairs of this outer iteration.
    fn optimise(
        &mut self,
        kernel: Option<&GemanMcClure>,
        inner_iterations: u32,
        solver: &mut Solver,
        progress: &mut dyn FnMut(),
    ) -> Result<(), NotPositiveDefinite> {
        let graph = &mut self.graph;
        let Some(kernel) = kernel else {
            return graph.optimise(inner_iterations, progress).map(|_| ());
        };
        let report = in_pool(progress, |progress| {
            robust::optimise(graph, kernel, inner_iterations, solver, progress)
        })?;
        self.n_rounds += report.n_rounds;
        self.residuals_sigmas = report.residuals_sigmas;
        Ok(())
    }
}

/// Whether no free pose moved by `step` metres or turned by `step` radians.
fn is_still(before: &[Pose], graph: &Graph, step: f64) -> bool {
    let mut free = before.iter().zip(&graph.poses).zip(&graph.is_fixed).filter(|(_, is_fixed)| !**is_fixed);
    step > 0.0
        && free.all(|((before, after), _)| {
            let (moved_m, turned_rad) = translation_rotation_norms(&(before.inverse() * after));
            moved_m < step && turned_rad < step
        })
}

#[cfg(test)]
mod tests;
