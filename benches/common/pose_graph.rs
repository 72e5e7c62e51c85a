//! Graphs of poses without surfaces.

use std::f64::consts::TAU;
use tessera_geometry::{Pose, Twist, compose_normalised, exp};
use tessera_graph::{BlockSums, Graph, Pair, PairBlock};

/// A pair whose matches are the six ends of a cross: its cost is zero at `target_from_query`.
fn pair(query: usize, target: usize, target_from_query: &Pose) -> Pair {
    let mut sums = BlockSums { n: 6, ..BlockSums::default() };
    for k in 0..3 {
        for sign in [1.0, -1.0] {
            let mut end = [0.0, 0.0, 0.0, 1.0];
            end[k] = sign;
            let products = (0..4).flat_map(|k| (k..4).map(move |l| (k, l)));
            for (at, (k, l)) in products.enumerate() {
                for (entry, identity) in [1.0, 0.0, 0.0, 1.0, 0.0, 1.0].into_iter().enumerate() {
                    sums.q[6 * at + entry] += end[k] * end[l] * identity;
                }
            }
        }
    }
    Pair::new(query, target, PairBlock::new(target_from_query, &sums))
}

fn shaken(i: usize, pose: &Pose) -> Pose {
    let (a, b) = ((i % 3) as f64 - 1.0, (i % 4) as f64 - 1.5);
    let rho = [0.05 * a, -0.03 * a, 0.02 * a].into();
    compose_normalised(pose, &Twist { rho, phi: [0.02 * b, 0.01 * b, -0.03 * b].into() })
}

/// One free pose among `n` fixed ones.
pub(crate) fn window(n: usize) -> Graph {
    let truth: Vec<Pose> = (0..=n).map(|i| Pose::translation(0.01 * i as f64, 0.0, 0.0)).collect();
    let pairs = (0..n).map(|i| pair(n, i, &(truth[i].inverse() * truth[n]))).collect();
    let mut poses = truth;
    poses[n] = shaken(2, &poses[n]);
    Graph { poses, is_fixed: (0..=n).map(|i| i < n).collect(), pairs, ..Graph::default() }
}

/// A ring of `n` poses: an edge from each to the next, the other edges across it.
pub(crate) fn ring(n: usize, n_edges: usize) -> Graph {
    let truth: Vec<Pose> = (0..n)
        .map(|i| {
            let angle = i as f64 / n as f64 * TAU;
            let rho = [5.0 * angle.cos(), 0.1 * angle.sin(), 5.0 * angle.sin()].into();
            exp(&Twist { rho, phi: [0.1, 0.3 * angle, 0.0].into() })
        })
        .collect();
    let chain = (0..n).map(|i| ((i + 1) % n, i));
    let across = (0..n_edges - n).map(|i| ((i * 37 + 11 + i % 5) % n, i)).filter(|(a, b)| a != b);
    let mut pairs: Vec<Pair> =
        chain.chain(across).map(|(a, b)| pair(a, b, &(truth[b].inverse() * truth[a]))).collect();
    pairs.truncate(n_edges);
    assert_eq!(pairs.len(), n_edges);
    let poses = truth.iter().enumerate().map(|(i, p)| if i == 0 { *p } else { shaken(i, p) }).collect();
    Graph { poses, is_fixed: (0..n).map(|i| i == 0).collect(), pairs, ..Graph::default() }
}
