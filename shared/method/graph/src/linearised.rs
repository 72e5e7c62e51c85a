//! A pair's share of the normal equations (method 4.1, 5.3).

use crate::graph::{Graph, MIN_SHARED_PAIRS, Pair};
use rayon::prelude::*;
use tessera_geometry::{Matrix6, Pose, Vector6, adjoint};

/// A pair's terms of the normal equations, its weight included.
#[derive(Clone, Debug, Default)]
pub(crate) struct Linearised {
    /// The pair's weight; 0 where it takes no part.
    pub(crate) weight: f64,
    pub(crate) h_query: Matrix6,
    pub(crate) g_query: Vector6,
    pub(crate) h_target: Matrix6,
    pub(crate) g_target: Vector6,
    pub(crate) h_across: Matrix6,
    pub(crate) cost: f64,
}

impl Linearised {
    /// The terms at `target_from_query`; those of the target only where it is free.
    pub(crate) fn new(pair: &Pair, target_from_query: &Pose, is_target_free: bool) -> Self {
        let (h, g, f) = pair.block.linearise(target_from_query);
        let (h_query, g_query) = (h * pair.weight, g * pair.weight);
        let cost = pair.weight * f;
        let (mut h_target, mut g_target, mut h_across) = Default::default();
        if is_target_free {
            // J_j = -J_i Ad(T_ji) (method 4.1).
            let ad = adjoint(&target_from_query.inverse());
            h_across = h_query * ad;
            h_target = ad.transpose() * h_across;
            g_target = ad.transpose() * g_query;
        }
        Self { weight: pair.weight, h_query, g_query, h_target, g_target, h_across, cost }
    }
}

/// The terms of all pairs of a graph, in their order, and the poses that they were worked out at.
#[derive(Default)]
pub(crate) struct Terms {
    pub(crate) pairs: Vec<Linearised>,
    poses: Vec<Pose>,
}

impl Terms {
    /// Pairs that follow are others.
    pub(crate) fn forget(&mut self) {
        self.poses.clear();
    }

    /// Works out what is not known yet: all of it at other poses, where they are the same that of
    /// pairs with another weight.
    pub(crate) fn update(&mut self, graph: &Graph, slot: &[usize]) {
        let anew = |pair: &Pair| {
            let [is_query_free, is_target_free] = [pair.query, pair.target].map(|k| slot[k] != usize::MAX);
            match pair.weight == 0.0 || !(is_query_free || is_target_free) {
                true => Linearised::default(),
                false => Linearised::new(pair, &graph.target_from_query(pair), is_target_free),
            }
        };
        let has_many = graph.pairs.len() >= MIN_SHARED_PAIRS;
        if self.poses != graph.poses || self.pairs.len() != graph.pairs.len() {
            self.poses.clone_from(&graph.poses);
            self.pairs.clear();
            match has_many {
                true => self.pairs.par_extend(graph.pairs.par_iter().with_min_len(64).map(anew)),
                false => self.pairs.extend(graph.pairs.iter().map(anew)),
            }
            return;
        }
        let update = |(terms, pair): (&mut Linearised, &Pair)| {
            if terms.weight != pair.weight {
                *terms = anew(pair);
            }
        };
        match has_many {
            true => self.pairs.par_iter_mut().zip(&graph.pairs).with_min_len(64).for_each(update),
            false => self.pairs.iter_mut().zip(&graph.pairs).for_each(update),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{BlockSums, PairBlock};

    #[test]
    fn kept_terms_are_those_worked_out_anew() {
        let sums = BlockSums { q: std::array::from_fn(|k| k as f64), n: 10, ..BlockSums::default() };
        let pair = |query, target| {
            let block = PairBlock::new(&Pose::translation(0.1, 0.2, 0.3), &sums);
            Pair::new(query, target, block)
        };
        let poses: Vec<Pose> = (0..3).map(|i| Pose::translation(0.2 * f64::from(i), 0.1, 0.0)).collect();
        let pairs = vec![pair(1, 0), pair(2, 1), pair(2, 0)];
        let mut graph = Graph { poses, is_fixed: vec![true, false, false], pairs, ..Graph::default() };
        let slot = [usize::MAX, 0, 1];
        let mut kept = Terms::default();
        // The weight of the last pair and where the last pose is.
        for (weight, x) in
            [(1.0, 0.4), (0.5, 0.4), (0.0, 0.4), (0.0, 0.5), (0.5, 0.5), (0.5, 0.6), (1.0, 0.4)]
        {
            graph.pairs[2].weight = weight;
            graph.poses[2] = Pose::translation(x, 0.1, 0.0);
            kept.update(&graph, &slot);
            let mut anew = Terms::default();
            anew.update(&graph, &slot);
            for (kept, anew) in kept.pairs.iter().zip(&anew.pairs) {
                assert_eq!(kept.weight, anew.weight);
                if anew.weight != 0.0 {
                    let parts = |l: &Linearised| (l.h_query, l.g_query, l.h_target, l.g_target, l.h_across);
                    assert_eq!((parts(kept), kept.cost), (parts(anew), anew.cost));
                }
            }
        }
    }
}
