//! Sparse Cholesky factorisation of 6x6 blocks, column by column.
//!
//! Its loops have fixed lanes and a fixed order and are dispatched at run time: the same bits with
//! every set of vector instructions.

use crate::elimination::Elimination;
use nalgebra::SMatrix;
use tessera_geometry::{Matrix6, Vector6};

/// The normal equations have a direction without information.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotPositiveDefinite;

impl std::fmt::Display for NotPositiveDefinite {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "the normal equations leave a direction without information")
    }
}

impl std::error::Error for NotPositiveDefinite {}

/// Lanes of a column: six rows, and two that are 0.
const ROWS: usize = 8;

/// Block products between two signs of life: some milliseconds.
const PRODUCTS_OF_A_PART: usize = 1 << 16;

/// A 6x6 block by columns.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Block6([[f64; ROWS]; 6]);

impl Block6 {
    const ZERO: Self = Self([[0.0; ROWS]; 6]);

    fn add(&mut self, from: &Matrix6, is_transposed: bool) {
        for (c, column) in self.0.iter_mut().enumerate() {
            for (r, value) in column[..6].iter_mut().enumerate() {
                *value += if is_transposed { from[(c, r)] } else { from[(r, c)] };
            }
        }
    }
}

/// A factor `L` with `H + lambda I = L L^T`, its pattern kept from one set of values to the next.
pub struct BlockCholesky {
    elimination: Elimination,
    /// Where each block of the system goes: its place in `lower`, and whether it is transposed.
    goes: Vec<(usize, bool)>,
    /// For row `r`, at `row_starts[r]..row_starts[r + 1]`: the columns that have a block in it, and
    /// its place in `lower`.
    row_starts: Vec<usize>,
    in_row: Vec<(u32, u32)>,
    diagonal: Vec<Block6>,
    lower: Vec<Block6>,
    /// Place in `lower` of a row of the column at work.
    place_of_row: Vec<u32>,
    arch: pulp::Arch,
}

impl BlockCholesky {
    /// Room for systems of `n` poses with blocks at these places off the diagonal.
    pub fn new(n: usize, pattern: &[(usize, usize)], arch: pulp::Arch) -> Self {
        let elimination = Elimination::new(n, pattern);
        let goes = pattern.iter().map(|&(row, column)| {
            let (row, column) = (elimination.place[row], elimination.place[column]);
            let (first, last) = (row.min(column), row.max(column) as u32);
            let rows = &elimination.rows[elimination.starts[first]..elimination.starts[first + 1]];
            let place = elimination.starts[first] + rows.partition_point(|&r| r < last);
            (place, row < column)
        });
        let goes = goes.collect();
        let mut row_starts = vec![0; n + 1];
        elimination.rows.iter().for_each(|&row| row_starts[row as usize + 1] += 1);
        (0..n).for_each(|row| row_starts[row + 1] += row_starts[row]);
        let mut next = row_starts.clone();
        let mut in_row = vec![(0, 0); elimination.rows.len()];
        for column in 0..n {
            for place in elimination.starts[column]..elimination.starts[column + 1] {
                let at = &mut next[elimination.rows[place] as usize];
                in_row[*at] = (column as u32, place as u32);
                *at += 1;
            }
        }
        let lower = vec![Block6::ZERO; elimination.rows.len()];
        Self {
            goes,
            row_starts,
            in_row,
            diagonal: vec![Block6::ZERO; n],
            lower,
            place_of_row: vec![0; n],
            elimination,
            arch,
        }
    }

    /// Factorises a system whose blocks stand in the order of the pattern; `progress` is called
    /// every few milliseconds of work.
    ///
    /// # Errors
    /// Where a direction has no information.
    pub fn factorise(
        &mut self,
        diagonal: &[Matrix6],
        blocks: &[Matrix6],
        lambda: f64,
        progress: &mut dyn FnMut(),
    ) -> Result<(), NotPositiveDefinite> {
        self.diagonal.fill(Block6::ZERO);
        self.lower.fill(Block6::ZERO);
        let damping = Matrix6::identity() * lambda;
        for (block, &place) in diagonal.iter().zip(&self.elimination.place) {
            self.diagonal[place].add(&(block + damping), false);
        }
        for (block, &(place, is_transposed)) in blocks.iter().zip(&self.goes) {
            self.lower[place].add(block, is_transposed);
        }
        self.arch.dispatch(Factorise(self, progress))
    }

    /// Solves `(H + lambda I) d = -gradient` by the last factor.
    pub fn solve(&self, gradient: &[Vector6]) -> Vec<Vector6> {
        let rhs: Vec<Vector6> = gradient.iter().map(|g| -g).collect();
        self.solve_columns(&rhs)
    }

    /// Solves `(H + lambda I) X = B` by the last factor, for `N` right-hand sides: six rows of `B`
    /// and of `X` for each pose.
    pub fn solve_columns<const N: usize>(&self, rhs: &[SMatrix<f64, 6, N>]) -> Vec<SMatrix<f64, 6, N>> {
        let place = &self.elimination.place;
        let mut x = vec![SMatrix::<f64, 6, N>::zeros(); place.len()];
        for (&place, b) in place.iter().zip(rhs) {
            x[place] = *b;
        }
        self.substitute_forward(&mut x);
        self.substitute_back(&mut x);
        place.iter().map(|&place| x[place]).collect()
    }

    /// `X = L^-1 X`, in the order of elimination.
    fn substitute_forward<const N: usize>(&self, x: &mut [SMatrix<f64, 6, N>]) {
        let Elimination { starts, rows, .. } = &self.elimination;
        for column in 0..x.len() {
            let l = &self.diagonal[column].0;
            let mut y = x[column];
            for s in 0..N {
                for k in 0..6 {
                    let known: f64 = (0..k).map(|m| l[m][k] * y[(m, s)]).sum();
                    y[(k, s)] = (y[(k, s)] - known) / l[k][k];
                }
            }
            x[column] = y;
            for at in starts[column]..starts[column + 1] {
                let b = &mut x[rows[at] as usize];
                for s in 0..N {
                    for c in 0..6 {
                        for r in 0..6 {
                            b[(r, s)] -= self.lower[at].0[c][r] * y[(c, s)];
                        }
                    }
                }
            }
        }
    }

    /// `X = L^-T X`, in the reverse order of elimination.
    fn substitute_back<const N: usize>(&self, x: &mut [SMatrix<f64, 6, N>]) {
        let Elimination { starts, rows, .. } = &self.elimination;
        for column in (0..x.len()).rev() {
            let mut y = x[column];
            for at in starts[column]..starts[column + 1] {
                let b = &x[rows[at] as usize];
                for s in 0..N {
                    for c in 0..6 {
                        y[(c, s)] -= (0..6).map(|r| self.lower[at].0[c][r] * b[(r, s)]).sum::<f64>();
                    }
                }
            }
            let l = &self.diagonal[column].0;
            for s in 0..N {
                for k in (0..6).rev() {
                    let known: f64 = (k + 1..6).map(|m| l[k][m] * y[(m, s)]).sum();
                    y[(k, s)] = (y[(k, s)] - known) / l[k][k];
                }
            }
            x[column] = y;
        }
    }
}

struct Factorise<'a, 'b>(&'a mut BlockCholesky, &'b mut dyn FnMut());

impl pulp::WithSimd for Factorise<'_, '_> {
    type Output = Result<(), NotPositiveDefinite>;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) -> Self::Output {
        let Self(it, progress) = self;
        let mut n_products = 0;
        let Elimination { starts, rows, .. } = &it.elimination;
        for column in 0..it.diagonal.len() {
            let (first, end) = (starts[column], starts[column + 1]);
            for place in first..end {
                it.place_of_row[rows[place] as usize] = place as u32;
            }
            let (before, own) = it.lower.split_at_mut(first);
            let own = &mut own[..end - first];
            let diagonal = &mut it.diagonal[column];
            // What the columns before this one have in its row: their blocks from there on.
            for &(earlier, place) in &it.in_row[it.row_starts[column]..it.row_starts[column + 1]] {
                let (place, last) = (place as usize, starts[earlier as usize + 1]);
                n_products += last - place;
                if n_products >= PRODUCTS_OF_A_PART {
                    n_products = 0;
                    progress();
                }
                let b = before[place];
                subtract_product(diagonal, &b, &b);
                for at in place + 1..last {
                    let to = it.place_of_row[rows[at] as usize] as usize - first;
                    subtract_product(&mut own[to], &before[at], &b);
                }
            }
            factorise_block(diagonal)?;
            own.iter_mut().for_each(|block| divide(block, diagonal));
        }
        Ok(())
    }
}

/// `c -= a b^T`.
#[inline(always)]
fn subtract_product(c: &mut Block6, a: &Block6, b: &Block6) {
    for j in 0..6 {
        let mut column = c.0[j];
        for k in 0..6 {
            let factor = b.0[k][j];
            for r in 0..ROWS {
                column[r] -= a.0[k][r] * factor;
            }
        }
        c.0[j] = column;
    }
}

/// The lower triangle becomes `L` with `a = L L^T`; what is above it means nothing.
#[inline(always)]
fn factorise_block(a: &mut Block6) -> Result<(), NotPositiveDefinite> {
    for k in 0..6 {
        let square = a.0[k][k];
        if !(square > 0.0 && square.is_finite()) {
            return Err(NotPositiveDefinite);
        }
        let root = square.sqrt();
        a.0[k][k] = root;
        for r in k + 1..6 {
            a.0[k][r] /= root;
        }
        for c in k + 1..6 {
            for r in c..6 {
                a.0[c][r] -= a.0[k][r] * a.0[k][c];
            }
        }
    }
    Ok(())
}

/// `x = x L^-T`.
#[inline(always)]
fn divide(x: &mut Block6, l: &Block6) {
    for k in 0..6 {
        let mut column = x.0[k];
        for m in 0..k {
            for r in 0..ROWS {
                column[r] -= x.0[m][r] * l.0[m][k];
            }
        }
        for value in &mut column {
            *value /= l.0[k][k];
        }
        x.0[k] = column;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SplitMix64;
    use nalgebra::{DMatrix, DVector};

    fn uniform(random: &mut SplitMix64) -> f64 {
        random.next_u64() as f64 / u64::MAX as f64 * 2.0 - 1.0
    }

    /// A random system of `n` poses, with the same as a dense matrix.
    fn system(n: usize, pattern: &[(usize, usize)]) -> (Vec<Matrix6>, Vec<Matrix6>, DMatrix<f64>) {
        let mut random = SplitMix64::for_frame(3, n as u64);
        let mut dense = DMatrix::zeros(6 * n, 6 * n);
        let mut diagonal = vec![Matrix6::identity(); n];
        let mut blocks = Vec::new();
        for &(row, column) in pattern {
            let (a, b) = (
                Matrix6::from_fn(|_, _| uniform(&mut random)),
                Matrix6::from_fn(|_, _| uniform(&mut random)),
            );
            diagonal[row] += a.transpose() * a;
            diagonal[column] += b.transpose() * b;
            blocks.push(a.transpose() * b);
        }
        for (i, block) in diagonal.iter().enumerate() {
            dense.view_mut((6 * i, 6 * i), (6, 6)).copy_from(block);
        }
        for (&(row, column), block) in pattern.iter().zip(&blocks) {
            dense.view_mut((6 * row, 6 * column), (6, 6)).copy_from(block);
            dense.view_mut((6 * column, 6 * row), (6, 6)).copy_from(&block.transpose());
        }
        (diagonal, blocks, dense)
    }

    #[test]
    fn it_solves_as_a_dense_factorisation_does_and_with_the_same_bits_everywhere() {
        for n in [2, 3, 17, 60] {
            let mut pattern: Vec<_> =
                (0..n).flat_map(|i| [(i, (i + 1) % n), (i, (i * 37 + 11) % n)]).collect();
            pattern.iter_mut().for_each(|p| *p = (p.0.max(p.1), p.0.min(p.1)));
            pattern.retain(|(a, b)| a != b);
            pattern.sort_unstable();
            pattern.dedup();
            let (diagonal, blocks, dense) = system(n, &pattern);
            let gradient: Vec<Vector6> =
                (0..n).map(|i| Vector6::from_fn(|k, _| (i + k) as f64 - 7.5)).collect();
            let solve = |arch| {
                let mut factor = BlockCholesky::new(n, &pattern, arch);
                // A factor is kept for other values: the second use is what counts.
                factor.factorise(&diagonal, &blocks, 9.0, &mut || ()).unwrap();
                factor.factorise(&diagonal, &blocks, 0.5, &mut || ()).unwrap();
                factor.solve(&gradient)
            };
            let found = solve(pulp::Arch::new());
            let damped = dense + DMatrix::identity(6 * n, 6 * n) * 0.5;
            let rhs = DVector::from_fn(6 * n, |r, _| -gradient[r / 6][r % 6]);
            let expected = damped.cholesky().unwrap().solve(&rhs);
            for (r, value) in expected.iter().enumerate() {
                assert!((found[r / 6][r % 6] - value).abs() < 1e-9 * expected.amax(), "{n} poses, row {r}");
            }
            assert_eq!(found, solve(pulp::Arch::Scalar));
            let mut factor = BlockCholesky::new(n, &pattern, pulp::Arch::new());
            factor.factorise(&diagonal, &blocks, 0.5, &mut || ()).unwrap();
            // Several right-hand sides: each as if it were alone.
            let sides: Vec<SMatrix<f64, 6, 3>> =
                gradient.iter().map(|g| SMatrix::from_columns(&[-g, g * 2.0, Vector6::zeros()])).collect();
            let solved = factor.solve_columns(&sides);
            let doubled = factor.solve_columns(&gradient.iter().map(|g| g * 2.0).collect::<Vec<_>>());
            for (pose, columns) in solved.iter().enumerate() {
                assert_eq!(columns.column(0), found[pose]);
                assert_eq!(columns.column(1), doubled[pose]);
                assert_eq!(columns.column(2), Vector6::zeros());
            }
        }
    }

    #[test]
    fn a_direction_without_information_is_refused() {
        let pattern = [(1, 0)];
        let (mut diagonal, blocks, _) = system(2, &pattern);
        let mut factor = BlockCholesky::new(2, &pattern, pulp::Arch::new());
        assert!(factor.factorise(&diagonal, &blocks, 0.0, &mut || ()).is_ok());
        diagonal[1] = Matrix6::zeros();
        assert_eq!(factor.factorise(&diagonal, &blocks, 0.0, &mut || ()), Err(NotPositiveDefinite));
        diagonal[1] = Matrix6::from_element(f64::NAN);
        assert_eq!(factor.factorise(&diagonal, &blocks, 0.0, &mut || ()), Err(NotPositiveDefinite));
    }

    #[test]
    fn a_long_factorisation_says_that_it_lives() {
        // A dense matrix: column c takes c (n - c) products.
        let n = 120;
        let pattern: Vec<_> = (0..n).flat_map(|c| (c + 1..n).map(move |r| (r, c))).collect();
        let (diagonal, blocks, _) = system(n, &pattern);
        let mut factor = BlockCholesky::new(n, &pattern, pulp::Arch::new());
        let mut n_signs = 0;
        factor.factorise(&diagonal, &blocks, 1.0, &mut || n_signs += 1).unwrap();
        let n_products: usize = (0..n).map(|c| c * (n - c)).sum();
        assert!(n_signs >= 4 && n_signs + 1 >= n_products / (PRODUCTS_OF_A_PART + n), "{n_signs} signs");
    }
}
