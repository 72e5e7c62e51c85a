//! A graph of poses and pair blocks, and its Levenberg-Marquardt solver (SPEC 5).

use crate::block::PairBlock;
use crate::linearised::Terms;
use crate::solve::{BlockSystem, NotPositiveDefinite};
use rayon::prelude::*;
use tessera_geometry::{Matrix6, Pose, log};
use tessera_surface::Isa;

/// All correspondences between two frames.
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
}

/// What is known of a pose beside the surfaces: `e = log(predicted^-1 pose)`.
#[derive(Clone, Debug)]
pub struct Prior {
    /// Vertex.
    pub vertex: usize,
    /// Where it should be.
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
    /// What the factorisations may use.
    pub isa: Isa,
}

/// Kept from one optimisation of a graph to the next: where its blocks lie, the symbolic factor,
/// its terms, and the damping that was last good.
#[derive(Default)]
pub struct Solver {
    system: Option<BlockSystem>,
    pub(crate) terms: Terms,
    pub(crate) lambda: Option<f64>,
}

/// How an inner optimisation ended.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InnerReport {
    /// Steps accepted.
    pub n_accepted: u32,
    /// Cost before.
    pub cost_before: f64,
    /// Cost after.
    pub cost_after: f64,
    /// The last step was below the limits.
    pub is_converged: bool,
    /// Largest translation of any pose over all steps, metres.
    pub moved_m: f64,
    /// Largest rotation of any pose over all steps, radians.
    pub turned_rad: f64,
}

/// From so many pairs on, sharing them out is worth its cost.
pub(crate) const MIN_SHARED_PAIRS: usize = 256;

impl Graph {
    /// The cost `sum e Omega e` of all pairs and priors.
    pub fn cost(&self) -> f64 {
        self.cost_at(&self.poses)
    }

    pub(crate) fn cost_at(&self, poses: &[Pose]) -> f64 {
        let pairs: f64 = self
            .of_each(|p| p.weight * p.block.cost(&(poses[p.target].inverse() * poses[p.query])))
            .iter()
            .sum();
        let priors: f64 = self
            .priors
            .iter()
            .map(|p| {
                let e = log(&(p.predicted.inverse() * poses[p.vertex])).to_vector();
                e.dot(&(p.information * e))
            })
            .sum();
        pairs + priors
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
        let places = self.pairs.iter().filter_map(|p| {
            let (a, b) = (slot[p.query], slot[p.target]);
            (a != usize::MAX && b != usize::MAX).then_some((a, b))
        });
        let mut system = BlockSystem::new(free.len(), places, self.isa, solver.system.take());
        let report = self.descend(max_iterations, &free, &slot, &mut system, solver, progress);
        solver.system = Some(system);
        report
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
mod tests {
    use super::*;
    use crate::block::BlockSums;
    use nalgebra::Vector3;
    use tessera_geometry::{Twist, compose_normalised, translation_rotation_norms};

    /// A pair whose matches are the six ends of a cross, all with identity information, so that
    /// its cost is zero exactly at `target_from_query`.
    fn pair(query: usize, target: usize, target_from_query: &Pose) -> Pair {
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
        Pair { query, target, block: PairBlock::new(target_from_query, &sums), weight: 1.0 }
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
}
