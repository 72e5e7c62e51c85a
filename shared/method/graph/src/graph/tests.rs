//! Graphs of poses whose optimum is known.

use super::*;
use crate::block::BlockSums;
use nalgebra::Vector3;
use tessera_geometry::{Twist, compose_normalised, translation_rotation_norms};

/// A pair whose matches are the six ends of a cross, all with identity information, so that
/// its cost is zero exactly at `target_from_query`.
pub(crate) fn pair(query: usize, target: usize, target_from_query: &Pose) -> Pair {
    let mut sums = BlockSums { n: 6, ..Default::default() };
    for a in [Vector3::x(), Vector3::y(), Vector3::z()].iter().flat_map(|a| [*a, -a]) {
        let tilde = [a.x, a.y, a.z, 1.0];
        let mut at = 0;
        for k in 0..4 {
            for l in k..4 {
                for u in [1.0, 0.0, 0.0, 1.0, 0.0, 1.0] {
                    sums.q[at] += tilde[k] * tilde[l] * u;
                    at += 1;
                }
            }
        }
    }
    Pair::new(query, target, PairBlock::new(target_from_query, &sums))
}

fn ring(n: usize) -> (Vec<Pose>, Graph) {
    let truth: Vec<Pose> = (0..n)
        .map(|i| {
            let angle = i as f64 / n as f64 * std::f64::consts::TAU;
            tessera_geometry::exp(&Twist {
                rho: Vector3::new(angle.cos(), 0.1 * angle.sin(), angle.sin()),
                phi: Vector3::new(0.1, angle * 0.3, 0.0),
            })
        })
        .collect();
    let mut graph = Graph { poses: truth.clone(), is_fixed: vec![false; n], ..Graph::default() };
    graph.is_fixed[0] = true;
    for i in 0..n {
        for gap in [1, 3] {
            let j = (i + gap) % n;
            let (query, target) = if i % 2 == 0 { (j, i) } else { (i, j) };
            graph.pairs.push(pair(query, target, &(truth[target].inverse() * truth[query])));
        }
    }
    for (i, pose) in graph.poses.iter_mut().enumerate().skip(1) {
        let twist = Twist {
            rho: Vector3::new(0.05, -0.03, 0.02) * ((i % 3) as f64 - 1.0),
            phi: Vector3::new(0.02, 0.01, -0.03) * ((i % 4) as f64 - 1.5),
        };
        *pose = compose_normalised(pose, &twist);
    }
    (truth, graph)
}

#[test]
fn a_ring_of_poses_comes_back_dense_and_sparse() {
    for (n, isa) in [2, 12, 60].into_iter().flat_map(|n| [(n, Isa::Auto), (n, Isa::Baseline)]) {
        let (truth, mut graph) = ring(n);
        graph.isa = isa;
        let report = graph.optimise(50, &mut || ()).unwrap();
        assert!(report.is_converged, "{n} poses: {report:?}");
        for (pose, expected) in graph.poses.iter().zip(&truth) {
            let (m, r) = translation_rotation_norms(&(expected.inverse() * pose));
            assert!(m < 1e-6 && r < 1e-6, "{n} poses: off by {m} m, {r} rad");
        }
    }
}

#[test]
fn a_prior_pulls_where_pairs_are_silent() {
    let predicted = Pose::translation(0.1, 0.2, 0.3);
    let mut graph = Graph {
        poses: vec![Pose::identity()],
        is_fixed: vec![false],
        priors: vec![Prior { vertex: 0, predicted, information: Matrix6::identity() }],
        ..Graph::default()
    };
    graph.optimise(10, &mut || ()).unwrap();
    assert!(translation_rotation_norms(&(predicted.inverse() * graph.poses[0])).0 < 1e-6);
}

#[test]
fn a_rough_optimisation_ends_where_its_model_was_exact() {
    let (_, graph) = ring(12);
    let steps = |stop: Stop| {
        let (mut graph, mut solver) = (graph.clone(), Solver::default());
        solver.begin(stop);
        let report = graph.optimise_again(10, &mut solver, &mut || ()).unwrap();
        (report.n_accepted, graph.cost())
    };
    let (n, cost) = steps(Stop::default());
    let (n_rough, rough_cost) = steps(Stop { is_rough: true, ..Stop::default() });
    assert!(n_rough < n && rough_cost < 0.05 * graph.cost(), "{n_rough} of {n} steps, {rough_cost}, {cost}");
    let (n_coarse, _) = steps(Stop { decrease: 0.1 * graph.cost(), is_rough: false });
    assert!(n_coarse < n, "{n_coarse} of {n} steps");
}
