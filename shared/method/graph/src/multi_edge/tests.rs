//! The one outer loop beside the same iterations written out.

use super::*;
use crate::graph::tests::pair;
use nalgebra::Vector3;
use tessera_geometry::{Matrix6, Twist, exp};

fn pose(k: f64) -> Pose {
    exp(&Twist { rho: Vector3::new(0.3 * k, 0.05 * k, -0.1), phi: Vector3::new(0.02, 0.1 * k, 0.0) })
}

/// Three poses, the first fixed; the wider the limits, the worse the pairs of vertex 2.
fn problem(schedule: Schedule) -> MultiEdge {
    MultiEdge {
        poses: vec![pose(0.0), pose(1.1), pose(1.7)],
        is_fixed: vec![true, false, false],
        priors: Vec::new(),
        ups: Ups::default(),
        schedule,
        kernel: None,
        isa: Isa::default(),
    }
}

fn associate(poses: &[Pose], iteration: OuterIteration) -> Vec<Pair> {
    let error =
        Pose::translation(0.02 * f64::from(1.0 - iteration.tightness) * poses[2].translation.x, 0.0, 0.0);
    let between = |query: usize, target: usize| pose(target as f64).inverse() * pose(query as f64);
    vec![
        pair(1, 0, &between(1, 0)),
        pair(2, 1, &(between(2, 1) * error)),
        pair(2, 0, &(between(2, 0) * error)),
    ]
}

#[test]
fn one_loop_does_what_the_iterations_written_out_do() {
    let solved = problem(Schedule::shrinking(4, 10)).solve(&mut associate, &mut || ());
    let MultiEdge { poses, is_fixed, .. } = problem(Schedule::shrinking(4, 10));
    let mut graph = Graph { poses, is_fixed, ..Graph::default() };
    for (k, tightness) in [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0].into_iter().enumerate() {
        graph.pairs = associate(&graph.poses, OuterIteration { index: k as u32, tightness });
        graph.optimise(10, &mut || ()).unwrap();
    }
    assert_eq!(solved.graph.poses, graph.poses);
    assert!(solved.is_solved && solved.outer_iterations == 4);
    let off_m = (solved.graph.poses[2].translation.vector - pose(2.0).translation.vector).norm();
    assert!(off_m < 1e-6, "off by {off_m} m");
}

#[test]
fn a_schedule_shrinks_from_zero_to_one_and_one_iteration_is_the_tightest() {
    assert_eq!(Schedule::shrinking(3, 10).tightness, [0.0, 0.5, 1.0]);
    assert_eq!(Schedule::shrinking(1, 10).tightness, [1.0]);
}

#[test]
fn poses_that_stay_skip_to_the_tightest_limits() {
    let mut seen = Vec::new();
    let mut schedule = Schedule::shrinking(6, 10);
    schedule.converged_step = 1e-3;
    let mut problem = problem(schedule);
    problem.poses = (0..3).map(|k| pose(f64::from(k))).collect();
    problem.solve(
        &mut |poses: &[Pose], iteration: OuterIteration| {
            seen.push(iteration.tightness);
            associate(poses, OuterIteration { tightness: 1.0, ..iteration })
        },
        &mut || (),
    );
    assert_eq!(seen, [0.0, 1.0]);
}

/// Pairs that leave vertex 2 alone, and a prior for it when asked.
struct Degenerate {
    n_asked: u32,
}

impl DataAssociation for Degenerate {
    fn associate(&mut self, poses: &[Pose], _: OuterIteration, progress: &mut dyn FnMut()) -> Vec<Pair> {
        progress();
        associate(poses, OuterIteration { index: 0, tightness: 1.0 }).into_iter().take(1).collect()
    }

    fn hold(&mut self, solved: &Graph) -> Vec<Prior> {
        self.n_asked += 1;
        assert_eq!(solved.information(2), Matrix6::zeros());
        vec![Prior { vertex: 2, predicted: pose(5.0), information: Matrix6::identity() }]
    }
}

#[test]
fn a_degenerate_vertex_is_held_for_further_iterations() {
    let schedule = Schedule { held_iterations: 3, ..Schedule::shrinking(2, 10) };
    let (mut association, mut n_progress) = (Degenerate { n_asked: 0 }, 0);
    let solved = problem(schedule).solve(&mut association, &mut || n_progress += 1);
    assert_eq!((association.n_asked, solved.outer_iterations), (1, 2 + 3));
    assert!(n_progress >= solved.outer_iterations);
    let off_m = (solved.graph.poses[2].translation.vector - pose(5.0).translation.vector).norm();
    assert!(off_m < 1e-6 && solved.graph.priors.len() == 1, "off by {off_m} m");
}

#[test]
fn a_system_without_a_solution_leaves_the_poses() {
    let start = problem(Schedule::shrinking(3, 10)).poses;
    let unsolvable = |poses: &[Pose], iteration: OuterIteration| {
        associate(poses, iteration).into_iter().map(|pair| Pair { weight: f64::NAN, ..pair }).collect()
    };
    let solved = problem(Schedule::shrinking(3, 10)).solve(&mut { unsolvable }, &mut || ());
    assert!(!solved.is_solved && solved.outer_iterations == 1);
    assert_eq!(solved.graph.poses, start);
}

#[test]
fn a_loop_that_contradicts_odometry_ends_without_weight() {
    let contradicting = |poses: &[Pose], iteration: OuterIteration| {
        let mut pairs = associate(poses, OuterIteration { tightness: 1.0, ..iteration });
        pairs.push(Pair { is_loop: true, ..pair(2, 0, &Pose::translation(-1.0, 0.0, 0.0)) });
        pairs
    };
    let kernel = GemanMcClure { limit_sigmas: 0.1, metric_factor: 1.0 };
    let problem = MultiEdge { kernel: Some(kernel), ..problem(Schedule::shrinking(2, 10)) };
    let solved = problem.solve(&mut { contradicting }, &mut || ());
    let weights: Vec<f64> = solved.graph.pairs.iter().map(|p| p.weight).collect();
    assert_eq!(weights, [1.0, 1.0, 1.0, 0.0]);
    assert!(solved.n_rounds > 0 && solved.residuals_sigmas[3] > 0.1);
    let off_m = (solved.graph.poses[2].translation.vector - pose(2.0).translation.vector).norm();
    assert!(off_m < 1e-6, "off by {off_m} m");
}

#[test]
fn the_kernels_weight_is_a_quarter_at_its_scale() {
    assert_eq!(GemanMcClure::weight(0.0, 2.0), 1.0);
    assert_eq!(GemanMcClure::weight(2.0, 2.0), 0.25);
}
