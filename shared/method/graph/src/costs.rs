//! The cost of each pair by itself (method 5.3): what a step is judged by, and then its loops.

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

    /// The costs of `n` pairs at these poses, by `work_out` where they are not known.
    pub(crate) fn at(&mut self, poses: &[Pose], n: usize, work_out: impl FnOnce() -> Vec<f64>) -> &[f64] {
        if self.pairs.len() != n || self.poses != poses {
            self.pairs = work_out();
            self.poses.clear();
            self.poses.extend_from_slice(poses);
        }
        &self.pairs
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn costs_are_worked_out_once_at_the_same_poses_for_the_same_pairs() {
        let poses = |x_m: f64| [Pose::identity(), Pose::translation(x_m, 0.0, 0.0)];
        let mut costs = Costs::default();
        assert_eq!(costs.at(&poses(0.1), 2, || vec![1.0, 2.0]), [1.0, 2.0]);
        assert_eq!(costs.at(&poses(0.1), 2, || vec![3.0, 4.0]), [1.0, 2.0]);
        assert_eq!(costs.at(&poses(0.2), 2, || vec![3.0, 4.0]), [3.0, 4.0]);
        costs.forget();
        assert_eq!(costs.at(&poses(0.2), 2, || vec![5.0, 6.0]), [5.0, 6.0]);
    }
}
