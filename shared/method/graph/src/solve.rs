//! Linear systems of 6x6 blocks, their pattern and factor kept from one set of values to the next.

use tessera_geometry::{Matrix6, Vector6};
use tessera_numerics::{BlockCholesky, Isa, NotPositiveDefinite};

/// Off-diagonal blocks as (row, column) with row > column, sorted by column, then row.
#[derive(PartialEq)]
pub(crate) struct BlockPlaces(Vec<(usize, usize)>);

impl BlockPlaces {
    /// These places, in any order.
    fn new(places: impl Iterator<Item = (usize, usize)>) -> Self {
        let mut pattern: Vec<_> = places.map(|(a, b)| (a.max(b), a.min(b))).filter(|(a, b)| a != b).collect();
        pattern.sort_unstable_by_key(|&(row, column)| (column, row));
        pattern.dedup();
        Self(pattern)
    }

    /// Position of the block between two poses; `next` is tried first.
    pub(crate) fn find(&self, (a, b): (usize, usize), next: usize) -> Option<usize> {
        let place = (a.max(b), a.min(b));
        if self.0.get(next) == Some(&place) {
            return Some(next);
        }
        self.0.binary_search_by_key(&(place.1, place.0), |&(row, column)| (column, row)).ok()
    }
}

/// A system with the places of the lower triangle's blocks, worked out once per graph.
pub(crate) struct BlockSystem {
    n: usize,
    pub(crate) places: BlockPlaces,
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
        let places = BlockPlaces::new(places);
        if let Some(before) = before
            && (before.n, before.isa) == (n, isa)
            && before.places == places
        {
            return before;
        }
        Self {
            n,
            diagonal: vec![Matrix6::zeros(); n],
            lower: vec![Matrix6::zeros(); places.0.len()],
            gradient: vec![Vector6::zeros(); n],
            factor: (n > 1).then(|| BlockCholesky::new(n, &places.0, isa.arch())),
            places,
            isa,
        }
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
