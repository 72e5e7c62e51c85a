//! The cost of each pair by itself (method 5.3): what a step is judged by, and then its loops.

use crate::graph::Graph;
use tessera_geometry::Pose;

/// The costs of all pairs of a graph, in their order and without their weights, and the poses that they were worked out
/// at.
#[derive(Default)]
pub(crate) struct Costs {
    pairs: Vec<f64>,
    poses: Vec<Pose>,
}

impl Costs {
    /// Pairs that follow are others.
    pub(crate) fn forget(&mut self) {
        self.pairs.clear();
    }

    /// The costs at these poses, worked out where they are not known.
    pub(crate) fn at(&mut self, graph: &Graph, poses: &[Pose]) -> &[f64] {
        if self.pairs.len() != graph.pairs.len() || self.poses != poses {
            self.pairs = graph.of_each(|p| p.block.cost(&(poses[p.target].inverse() * poses[p.query])));
            self.poses.clear();
            self.poses.extend_from_slice(poses);
        }
        &self.pairs
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{BlockSums, PairBlock};
    use crate::graph::Pair;

    #[test]
    fn costs_are_those_of_the_poses_and_of_the_pairs() {
        let sums = BlockSums { q: [1.0; 60], n: 10, ..BlockSums::default() };
        let pair = |x_m: f64| Pair::new(1, 0, PairBlock::new(&Pose::translation(x_m, 0.0, 0.0), &sums));
        let poses = |x_m: f64| [Pose::identity(), Pose::translation(x_m, 0.0, 0.0)];
        let mut graph = Graph { pairs: vec![pair(0.1), pair(0.2)], ..Graph::default() };
        let mut costs = Costs::default();
        let near = costs.at(&graph, &poses(0.1)).to_vec();
        graph.pairs[1].weight = 0.5;
        assert_eq!(costs.at(&graph, &poses(0.1)), near, "a weight is no part of them");
        assert_ne!(costs.at(&graph, &poses(0.3)), near);
        costs.forget();
        graph.pairs.swap(0, 1);
        assert_eq!(costs.at(&graph, &poses(0.1)), [near[1], near[0]]);
    }
}
