//! A graph of poses and pair blocks, optimised with its pairs frozen (III-E; method 5).

use crate::block::PairBlock;
use crate::costs::Costs;
use crate::linearised::Terms;
use crate::solve::BlockSystem;
use crate::up::Ups;
use rayon::prelude::*;
use tessera_geometry::{Matrix6, Pose, log};
use tessera_numerics::Isa;
use tessera_numerics::NotPositiveDefinite;

/// All correspondences between two frames: the multi-edge of III-E.
#[derive(Clone, Debug)]
pub struct Pair {
    /// Vertex whose samples were the queries.
    pub query: usize,
    /// Vertex whose surface was searched.
    pub target: usize,
    /// The matches' exact cost.
    pub block: PairBlock,
    /// Factor of the cost; 0 takes the pair out.
    pub weight: f64,
    /// Whether the pair closes a loop: it may be an outlier, so that graduated non-convexity
    /// decides on its weight. Odometry is trusted.
    pub is_loop: bool,
    /// Cost of a loop pair at its own optimum, where that is known.
    pub own_cost: Option<f64>,
}

impl Pair {
    /// A pair that counts in full and closes no loop.
    pub fn new(query: usize, target: usize, block: PairBlock) -> Self {
        Self { query, target, block, weight: 1.0, is_loop: false, own_cost: None }
    }
}

/// Prior of a pose beside the surfaces: `e = log(predicted^-1 pose)`.
#[derive(Clone, Debug)]
pub struct Prior {
    /// Vertex.
    pub vertex: usize,
    /// The predicted pose.
    pub predicted: Pose,
    /// Inverse covariance, translation first, in the units of the pair blocks' information.
    pub information: Matrix6,
}

/// A least-squares problem over poses.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    /// `world_from_camera` of each vertex.
    pub poses: Vec<Pose>,
    /// Vertices that do not move.
    pub is_fixed: Vec<bool>,
    /// Pairs.
    pub pairs: Vec<Pair>,
    /// Priors.
    pub priors: Vec<Prior>,
    /// Up at some of the poses.
    pub ups: Ups,
    /// Vector instructions of the factorisations.
    pub isa: Isa,
}

/// Kept from one optimisation of a graph to the next: where its blocks lie, the symbolic factor,
/// its terms and costs, and the damping that was last good.
#[derive(Default)]
pub struct Solver {
    system: Option<BlockSystem>,
    pub(crate) terms: Terms,
    pub(crate) costs: Costs,
    pub(crate) lambda: Option<f64>,
    pub(crate) stop: Stop,
}

/// When an optimisation ends, beside steps and decreases that are too small to be told from rounding.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Stop {
    /// Decrease of the cost that is too small to matter.
    pub(crate) decrease: f64,
    /// A step whose gain shows that the quadratic model is exact is the last.
    pub(crate) is_rough: bool,
}

impl Solver {
    /// For a graph with other pairs, which may have the places of those before.
    pub(crate) fn begin(&mut self, stop: Stop) {
        self.terms.forget();
        self.costs.forget();
        self.stop = stop;
    }
}

/// How an inner optimisation ended.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InnerReport {
    /// Steps accepted.
    pub n_accepted: u32,
    /// The last step was below the limits.
    pub is_converged: bool,
}

/// Which poses are free, and the place of each vertex among them; `usize::MAX` for a fixed one.
pub(crate) struct Order {
    pub(crate) free: Vec<usize>,
    pub(crate) slot: Vec<usize>,
}

/// From so many pairs on, sharing them out is worth its cost.
pub(crate) const MIN_SHARED_PAIRS: usize = 256;

impl Graph {
    /// The cost `sum e Omega e` of all pairs and priors, and that of up.
    pub fn cost(&self) -> f64 {
        self.cost_at(&self.poses, &mut Costs::default())
    }

    /// The cost of each pair, without its weight.
    pub(crate) fn costs_at<'a>(&self, poses: &[Pose], costs: &'a mut Costs) -> &'a [f64] {
        let cost = |p: &Pair| p.block.cost(&(poses[p.target].inverse() * poses[p.query]));
        costs.at(poses, self.pairs.len(), || self.of_each(cost))
    }

    pub(crate) fn cost_at(&self, poses: &[Pose], costs: &mut Costs) -> f64 {
        let costs = self.costs_at(poses, costs);
        let pairs: f64 = self.pairs.iter().zip(costs).map(|(pair, cost)| pair.weight * cost).sum();
        let priors: f64 = self
            .priors
            .iter()
            .map(|p| {
                let e = log(&(p.predicted.inverse() * poses[p.vertex])).to_vector();
                e.dot(&(p.information * e))
            })
            .sum();
        pairs + priors + self.ups.cost(poses)
    }

    /// At most `max_iterations` Levenberg-Marquardt steps on the frozen matches, damped as in
    /// g2o. `progress` is called in each step.
    ///
    /// # Errors
    /// When a free pose has no information at all, so that no damping makes the system solvable.
    pub fn optimise(
        &mut self,
        max_iterations: u32,
        progress: &mut dyn FnMut(),
    ) -> Result<InnerReport, NotPositiveDefinite> {
        self.optimise_again(max_iterations, &mut Solver::default(), progress)
    }

    /// As [`Self::optimise`], for a graph that is solved several times with other weights or poses:
    /// `solver` keeps what stays the same while its pairs do.
    ///
    /// # Errors
    /// As [`Self::optimise`].
    pub fn optimise_again(
        &mut self,
        max_iterations: u32,
        solver: &mut Solver,
        progress: &mut dyn FnMut(),
    ) -> Result<InnerReport, NotPositiveDefinite> {
        let free: Vec<usize> = (0..self.poses.len()).filter(|&i| !self.is_fixed[i]).collect();
        let mut slot = vec![usize::MAX; self.poses.len()];
        for (s, &i) in free.iter().enumerate() {
            slot[i] = s;
        }
        let of_pairs = self.pairs.iter().map(|p| (p.query, p.target));
        let joined = of_pairs.chain(self.ups.measured.iter().map(|up| (up.vertex, up.instrument)));
        let places = joined.filter_map(|(a, b)| {
            let (a, b) = (slot[a], slot[b]);
            (a != usize::MAX && b != usize::MAX).then_some((a, b))
        });
        let mut system = BlockSystem::new(free.len(), places, self.isa, solver.system.take());
        let order = Order { free, slot };
        let report = self.levenberg_marquardt(max_iterations, &order, &mut system, solver, progress);
        solver.system = Some(system);
        report
    }

    /// The information of all pairs about a vertex that is their query (H of method 5.2, without
    /// priors), translation first, in the units of the blocks.
    pub fn information(&self, vertex: usize) -> Matrix6 {
        let own = self.pairs.iter().filter(|pair| pair.query == vertex);
        own.map(|pair| pair.block.linearise(&self.target_from_query(pair)).0).sum()
    }

    pub(crate) fn target_from_query(&self, pair: &Pair) -> Pose {
        self.poses[pair.target].inverse() * self.poses[pair.query]
    }

    /// A value of each pair, in their order; many pairs are shared out to all threads.
    pub(crate) fn of_each<T: Send>(&self, value: impl Fn(&Pair) -> T + Send + Sync) -> Vec<T> {
        if self.pairs.len() < MIN_SHARED_PAIRS {
            self.pairs.iter().map(value).collect()
        } else {
            self.pairs.par_iter().with_min_len(64).map(value).collect()
        }
    }
}

#[cfg(test)]
pub(crate) mod tests;
