//! Blocks of 6x6 numbers in fixed lanes, and what a factorisation does with them.

use tessera_geometry::Matrix6;

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

/// A 6x6 block by columns.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct Block6(pub(crate) [[f64; ROWS]; 6]);

impl Block6 {
    pub(crate) const ZERO: Self = Self([[0.0; ROWS]; 6]);

    pub(crate) fn add(&mut self, from: &Matrix6, is_transposed: bool) {
        for (c, column) in self.0.iter_mut().enumerate() {
            for (r, value) in column[..6].iter_mut().enumerate() {
                *value += if is_transposed { from[(c, r)] } else { from[(r, c)] };
            }
        }
    }
}

/// `c -= sum a b^T` over blocks of two rows, one after the other.
#[inline(always)]
pub(crate) fn subtract_products(c: &mut Block6, a: &[Block6], b: &[Block6]) {
    let mut sum = c.0;
    for (a, b) in a.iter().zip(b) {
        for k in 0..6 {
            for j in 0..6 {
                let factor = b.0[k][j];
                for r in 0..ROWS {
                    sum[j][r] -= a.0[k][r] * factor;
                }
            }
        }
    }
    c.0 = sum;
}

/// The lower triangle becomes `L` with `a = L L^T`; what is above it means nothing.
#[inline(always)]
pub(crate) fn factorise_block(a: &mut Block6) -> Result<(), NotPositiveDefinite> {
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
pub(crate) fn divide(x: &mut Block6, l: &Block6) {
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
