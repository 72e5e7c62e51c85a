//! Linear systems of 6x6 blocks: dense for few poses, sparse with a kept symbolic factor for many.

use crate::envelope::Envelope;
use faer::linalg::solvers::{Llt, Solve};
use faer::sparse::linalg::solvers::{Llt as SparseLlt, SymbolicLlt};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Mat, Par, Side};
use tessera_geometry::{Matrix6, Vector6};
use tessera_surface::Isa;

/// The normal equations have a direction without information.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotPositiveDefinite;

impl std::fmt::Display for NotPositiveDefinite {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "the normal equations leave a direction without information")
    }
}

impl std::error::Error for NotPositiveDefinite {}

/// Up to this many free poses the dense factorisation is faster (FACTS: about fifty).
const DENSE_MAX_POSES: usize = 24;

/// Where each block of the lower triangle goes, worked out once per graph.
pub(crate) struct BlockSystem {
    n: usize,
    /// Off-diagonal blocks as (row, column) with row > column, sorted by column, then row.
    pattern: Vec<(usize, usize)>,
    pub(crate) diagonal: Vec<Matrix6>,
    pub(crate) lower: Vec<Matrix6>,
    pub(crate) gradient: Vec<Vector6>,
    sparse: Option<Sparse>,
    /// Factorised by plain code.
    is_portable: bool,
}

struct Sparse {
    symbolic: SymbolicSparseColMat<usize>,
    factor: SymbolicLlt<usize>,
    values: Vec<f64>,
}

impl BlockSystem {
    /// A system of `n` poses with blocks at these (row, column) places, in any order; what was
    /// worked out for `before` is kept where it has the same places.
    pub(crate) fn new(
        n: usize,
        places: impl Iterator<Item = (usize, usize)>,
        isa: Isa,
        before: Option<Self>,
    ) -> Result<Self, NotPositiveDefinite> {
        let mut pattern: Vec<_> = places.map(|(a, b)| (a.max(b), a.min(b))).filter(|(a, b)| a != b).collect();
        pattern.sort_unstable_by_key(|&(row, column)| (column, row));
        pattern.dedup();
        if let Some(before) = before
            && (before.n, before.is_portable) == (n, isa.is_portable())
            && before.pattern == pattern
        {
            return Ok(before);
        }
        let lower = vec![Matrix6::zeros(); pattern.len()];
        let is_portable = isa.is_portable();
        let sparse = if n > DENSE_MAX_POSES && !is_portable { Some(Sparse::new(n, &pattern)?) } else { None };
        Ok(Self {
            n,
            pattern,
            diagonal: vec![Matrix6::zeros(); n],
            lower,
            gradient: vec![Vector6::zeros(); n],
            sparse,
            is_portable,
        })
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

    /// Solves `(H + lambda I) d = -g`.
    pub(crate) fn solve(&mut self, lambda: f64) -> Result<Vec<Vector6>, NotPositiveDefinite> {
        if self.n == 1 {
            let damped = self.diagonal[0] + Matrix6::identity() * lambda;
            let factor = damped.cholesky().ok_or(NotPositiveDefinite)?;
            return Ok(vec![-factor.solve(&self.gradient[0])]);
        }
        if self.is_portable {
            return self.solve_portable(lambda);
        }
        let rhs = Mat::from_fn(6 * self.n, 1, |r, _| -self.gradient[r / 6][r % 6]);
        let solution = if self.sparse.is_some() {
            self.solve_sparse(lambda, &rhs)?
        } else {
            self.solve_dense(lambda, &rhs)?
        };
        Ok((0..self.n).map(|i| Vector6::from_fn(|k, _| solution[(6 * i + k, 0)])).collect())
    }

    fn solve_portable(&self, lambda: f64) -> Result<Vec<Vector6>, NotPositiveDefinite> {
        let mut first: Vec<usize> = (0..self.n).collect();
        for &(row, column) in &self.pattern {
            first[row] = first[row].min(column);
        }
        let mut h = Envelope::zeros((0..6 * self.n).map(|r| 6 * first[r / 6]).collect());
        let blocks = self.pattern.iter().copied().zip(&self.lower);
        for ((row, column), block) in (0..self.n).map(|i| (i, i)).zip(&self.diagonal).chain(blocks) {
            for r in 0..6 {
                let n_columns = if row == column { r + 1 } else { 6 };
                for c in 0..n_columns {
                    h.add(6 * row + r, 6 * column + c, block[(r, c)]);
                }
            }
        }
        for i in 0..6 * self.n {
            h.add(i, i, lambda);
        }
        h.factorise()?;
        let mut steps: Vec<f64> = self.gradient.iter().flat_map(|g| g.iter().map(|v| -v)).collect();
        h.solve(&mut steps);
        Ok(steps.chunks_exact(6).map(Vector6::from_column_slice).collect())
    }

    fn solve_dense(&self, lambda: f64, rhs: &Mat<f64>) -> Result<Mat<f64>, NotPositiveDefinite> {
        let mut h = Mat::zeros(6 * self.n, 6 * self.n);
        for (i, block) in self.diagonal.iter().enumerate() {
            for c in 0..6 {
                for r in 0..6 {
                    h[(6 * i + r, 6 * i + c)] = block[(r, c)];
                }
                h[(6 * i + c, 6 * i + c)] += lambda;
            }
        }
        for (&(row, column), block) in self.pattern.iter().zip(&self.lower) {
            for c in 0..6 {
                for r in 0..6 {
                    h[(6 * row + r, 6 * column + c)] = block[(r, c)];
                }
            }
        }
        faer::set_global_parallelism(Par::Seq);
        let factor = Llt::new(h.as_ref(), Side::Lower).map_err(|_| NotPositiveDefinite)?;
        Ok(factor.solve(rhs))
    }

    fn solve_sparse(&mut self, lambda: f64, rhs: &Mat<f64>) -> Result<Mat<f64>, NotPositiveDefinite> {
        let Some(sparse) = self.sparse.as_mut() else { return Err(NotPositiveDefinite) };
        // Column by column: the diagonal block's lower triangle, then the blocks below it.
        let mut at = 0;
        let mut first = 0;
        for column in 0..self.n {
            let count = self.pattern[first..].iter().take_while(|&&(_, c)| c == column).count();
            for c in 0..6 {
                for r in c..6 {
                    sparse.values[at] = self.diagonal[column][(r, c)] + if r == c { lambda } else { 0.0 };
                    at += 1;
                }
                for block in &self.lower[first..first + count] {
                    for r in 0..6 {
                        sparse.values[at] = block[(r, c)];
                        at += 1;
                    }
                }
            }
            first += count;
        }
        faer::set_global_parallelism(Par::Seq);
        let matrix = SparseColMatRef::new(sparse.symbolic.as_ref(), &sparse.values);
        let factor = SparseLlt::try_new_with_symbolic(sparse.factor.clone(), matrix, Side::Lower)
            .map_err(|_| NotPositiveDefinite)?;
        Ok(factor.solve(rhs))
    }
}

impl Sparse {
    fn new(n: usize, pattern: &[(usize, usize)]) -> Result<Self, NotPositiveDefinite> {
        let mut column_starts = Vec::with_capacity(6 * n + 1);
        let mut rows = Vec::new();
        let mut first = 0;
        for column in 0..n {
            let count = pattern[first..].iter().take_while(|&&(_, c)| c == column).count();
            for c in 0..6 {
                column_starts.push(rows.len());
                rows.extend(6 * column + c..6 * column + 6);
                for &(row, _) in &pattern[first..first + count] {
                    rows.extend(6 * row..6 * row + 6);
                }
            }
            first += count;
        }
        column_starts.push(rows.len());
        let values = vec![0.0; rows.len()];
        let symbolic = SymbolicSparseColMat::new_checked(6 * n, 6 * n, column_starts, None, rows);
        faer::set_global_parallelism(Par::Seq);
        let factor = SymbolicLlt::try_new(symbolic.as_ref(), Side::Lower).map_err(|_| NotPositiveDefinite)?;
        Ok(Self { symbolic, factor, values })
    }
}
