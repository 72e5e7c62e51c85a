//! Linear systems of 6x6 blocks, their pattern and factor kept from one set of values to the next.

use tessera_geometry::{Matrix6, Vector6};
use tessera_numerics::{BlockCholesky, Isa, NotPositiveDefinite};

/// Places of the lower triangle's blocks, worked out once per graph.
pub(crate) struct BlockSystem {
    n: usize,
    /// Off-diagonal blocks as (row, column) with row > column, sorted by column, then row.
    pattern: Vec<(usize, usize)>,
    pub(crate) diagonal: Vec<Matrix6>,
    pub(crate) lower: Vec<Matrix6>,
    pub(crate) gradient: Vec<Vector6>,
    /// None for a single pose.
    factor: Option<BlockCholesky>,
    isa: Isa,
}

impl BlockSystem {
    /// A system of `n` poses with blocks at these (row, column) places, in any order; what was
    /// worked out for `before` is kept where it has the same places.
    pub(crate) fn new(
        n: usize,
        places: impl Iterator<Item = (usize, usize)>,
        isa: Isa,
        before: Option<Self>,
    ) -> Self {
        let mut pattern: Vec<_> = places.map(|(a, b)| (a.max(b), a.min(b))).filter(|(a, b)| a != b).collect();
        pattern.sort_unstable_by_key(|&(row, column)| (column, row));
        pattern.dedup();
        if let Some(before) = before
            && (before.n, before.isa) == (n, isa)
            && before.pattern == pattern
        {
            return before;
        }
        Self {
            n,
            diagonal: vec![Matrix6::zeros(); n],
            lower: vec![Matrix6::zeros(); pattern.len()],
            gradient: vec![Vector6::zeros(); n],
            factor: (n > 1).then(|| BlockCholesky::new(n, &pattern, isa.arch())),
            pattern,
            isa,
        }
    }

    /// Position in `lower` of the block between two poses.
    pub(crate) fn place(&self, a: usize, b: usize) -> Option<usize> {
        let key = (a.min(b), a.max(b));
        self.pattern.binary_search_by_key(&key, |&(row, column)| (column, row)).ok()
    }

    pub(crate) fn clear(&mut self) {
        self.diagonal.fill(Matrix6::zeros());
        self.lower.fill(Matrix6::zeros());
        self.gradient.fill(Vector6::zeros());
    }

    pub(crate) fn max_diagonal(&self) -> f64 {
        self.diagonal.iter().flat_map(|m| (0..6).map(|k| m[(k, k)])).fold(0.0, f64::max)
    }

    /// Solves `(H + lambda I) d = -g`; `progress` is called every few milliseconds of work.
    pub(crate) fn solve(
        &mut self,
        lambda: f64,
        progress: &mut dyn FnMut(),
    ) -> Result<Vec<Vector6>, NotPositiveDefinite> {
        let Some(factor) = &mut self.factor else {
            let damped = self.diagonal[0] + Matrix6::identity() * lambda;
            let factor = damped.cholesky().ok_or(NotPositiveDefinite)?;
            return Ok(vec![-factor.solve(&self.gradient[0])]);
        };
        factor.factorise(&self.diagonal, &self.lower, lambda, progress)?;
        Ok(factor.solve(&self.gradient))
    }
}
