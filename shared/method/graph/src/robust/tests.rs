//! Wrong loops planted into a graph of a camera that goes round a room twice.

use super::*;
use crate::BlockSums;
use nalgebra::Vector3;
use tessera_geometry::{Twist, compose_normalised, exp, translation_rotation_norms};
use tessera_numerics::SplitMix64;

const N: usize = 80;
const PER_ROUND: usize = 40;
/// The default limit of a loop closure, in standard deviations.
const LIMIT_SIGMAS: f64 = 1.0;
/// 5 mm at weight one, epsilon 1e-4.
const METRIC_FACTOR: f64 = 0.25;

/// Uniform in -1..1.
fn uniform(random: &mut SplitMix64) -> f64 {
    random.next_u64() as f64 / u64::MAX as f64 * 2.0 - 1.0
}

fn twist(random: &mut SplitMix64, metres: f64, radians: f64) -> Twist {
    let mut three = |scale: f64| Vector3::new(uniform(random), uniform(random), uniform(random)) * scale;
    Twist { rho: three(metres), phi: three(radians) }
}

/// Matches on three walls, content exactly at `target_from_query`.
fn block(target_from_query: &Pose) -> PairBlock {
    let mut sums = BlockSums { n: 300, ..BlockSums::default() };
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    for (k, axis) in axes.iter().enumerate() {
        for (u, v) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
            let a = *axis * 1.5 + axes[(k + 1) % 3] * u + axes[(k + 2) % 3] * v + Vector3::z() * 2.0;
            let n = target_from_query.rotation * axis;
            let omega = nalgebra::Matrix3::identity() * 0.5 + n * n.transpose() * 4999.5;
            let tilde = [a.x, a.y, a.z, 1.0];
            let upper = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
            let mut at = 0;
            for i in 0..4 {
                for j in i..4 {
                    for place in upper {
                        sums.q[at] += 25.0 * tilde[i] * tilde[j] * omega[place];
                        at += 1;
                    }
                }
            }
        }
    }
    PairBlock::new(target_from_query, &sums)
}

struct Planted {
    truth: Vec<Pose>,
    graph: Graph,
    is_true: Vec<bool>,
}

/// `share` of all loops are wrong, each by itself or all by the same shift of the second round.
fn planted(share: f64, are_consistent: bool, seed: u64) -> Planted {
    let mut random = SplitMix64::for_frame(seed, 5);
    let truth: Vec<Pose> = (0..N)
        .map(|i| {
            let angle = i as f64 / PER_ROUND as f64 * std::f64::consts::TAU;
            exp(&Twist {
                rho: Vector3::new(libm::cos(angle), 0.0, libm::sin(angle)) * 2.0,
                phi: Vector3::zeros(),
            }) * exp(&Twist { rho: Vector3::zeros(), phi: Vector3::y() * -angle })
        })
        .collect();
    let measured = |i: usize, j: usize, noise: &Twist| {
        block(&compose_normalised(&(truth[j].inverse() * truth[i]), noise))
    };
    let mut pairs = Vec::new();
    let mut is_true = Vec::new();
    for i in 1..N {
        for gap in 1..=3.min(i) {
            let block = measured(i, i - gap, &twist(&mut random, 0.004, 0.002));
            pairs.push(Pair::new(i, i - gap, block));
            is_true.push(true);
        }
    }
    let n_true = N - PER_ROUND;
    for i in PER_ROUND..N {
        let block = measured(i, i - PER_ROUND, &twist(&mut random, 0.001, 0.0005));
        pairs.push(Pair { is_loop: true, ..Pair::new(i, i - PER_ROUND, block) });
        is_true.push(true);
    }
    let n_wrong = (share / (1.0 - share) * n_true as f64).round() as usize;
    let shift = Pose::translation(0.9, 0.1, -0.6);
    for k in 0..n_wrong {
        let i = PER_ROUND + (k * 7) % (N - PER_ROUND);
        let block = if are_consistent {
            block(&(truth[i - PER_ROUND].inverse() * shift * truth[i]))
        } else {
            block(&exp(&twist(&mut random, 1.5, 0.8)))
        };
        let target = if are_consistent { i - PER_ROUND } else { random.below(PER_ROUND) };
        pairs.push(Pair { is_loop: true, ..Pair::new(i, target, block) });
        is_true.push(false);
    }
    let mut poses = vec![truth[0]];
    for i in 1..N {
        let drift = twist(&mut random, 0.006, 0.004);
        poses.push(compose_normalised(&(poses[i - 1] * truth[i - 1].inverse() * truth[i]), &drift));
    }
    let mut is_fixed = vec![false; N];
    is_fixed[0] = true;
    Planted { truth, graph: Graph { poses, is_fixed, pairs, ..Graph::default() }, is_true }
}

fn solved_ate(planted: &mut Planted) -> f64 {
    let kernel = GemanMcClure { limit_sigmas: LIMIT_SIGMAS, metric_factor: METRIC_FACTOR };
    optimise(&mut planted.graph, &kernel, 10, &mut Solver::default(), &mut || ()).unwrap();
    let squares = planted.graph.poses.iter().zip(&planted.truth);
    let sum: f64 = squares.map(|(a, b)| translation_rotation_norms(&(b.inverse() * a)).0.powi(2)).sum();
    (sum / N as f64).sqrt()
}

#[test]
fn wrong_loops_change_next_to_nothing() {
    for seed in 0..3 {
        let clean = solved_ate(&mut planted(0.0, false, seed));
        for share in [0.1, 0.3, 0.5] {
            for are_consistent in [false, true] {
                let mut graph = planted(share, are_consistent, seed);
                let ate = solved_ate(&mut graph);
                let loops = graph.graph.pairs.iter().zip(&graph.is_true);
                let kept = |wanted: bool| {
                    let weights: Vec<f64> = loops
                        .clone()
                        .filter(|(pair, is_true)| pair.is_loop && **is_true == wanted)
                        .map(|(pair, _)| pair.weight)
                        .collect();
                    weights.iter().sum::<f64>() / weights.len() as f64
                };
                let case = format!("{share} wrong, consistent: {are_consistent}, seed {seed}");
                assert!(ate <= 1.1 * clean, "{case}: ATE {ate} instead of {clean}");
                assert!(kept(true) >= 0.9, "{case}: {} of the true loops kept", kept(true));
                assert!(kept(false) <= 0.01, "{case}: {} of the wrong loops kept", kept(false));
            }
        }
    }
}
