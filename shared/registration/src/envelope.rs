//! Cholesky factorisation in plain arithmetic and a fixed order: slower than faer's, and the same
//! bits on every machine.

use crate::solve::NotPositiveDefinite;

/// The lower triangle of a symmetric matrix; each row begins at its first entry that is not zero.
/// The factor fills the same places.
pub(crate) struct Envelope {
    first: Vec<usize>,
    rows: Vec<Vec<f64>>,
}

impl Envelope {
    /// A matrix of zeros whose rows begin at these columns, none beyond the diagonal.
    pub(crate) fn zeros(first: Vec<usize>) -> Self {
        let rows = first.iter().enumerate().map(|(r, &c)| vec![0.0; r + 1 - c]).collect();
        Self { first, rows }
    }

    /// Adds to an entry of the lower triangle that lies inside.
    pub(crate) fn add(&mut self, row: usize, column: usize, value: f64) {
        self.rows[row][column - self.first[row]] += value;
    }

    /// Turns the matrix into its factor `L`, `A = L L^T`.
    pub(crate) fn factorise(&mut self) -> Result<(), NotPositiveDefinite> {
        for r in 0..self.rows.len() {
            let (above, rest) = self.rows.split_at_mut(r);
            let (row, first) = (&mut rest[0], self.first[r]);
            for c in first..r {
                let from = first.max(self.first[c]);
                let other = &above[c];
                let sum = dot(&row[from - first..c - first], &other[from - self.first[c]..]);
                row[c - first] = (row[c - first] - sum) / other[other.len() - 1];
            }
            let (last, before) = row.split_last_mut().ok_or(NotPositiveDefinite)?;
            let square = *last - dot(before, before);
            if !(square > 0.0 && square.is_finite()) {
                return Err(NotPositiveDefinite);
            }
            *last = square.sqrt();
        }
        Ok(())
    }

    /// Solves `L L^T x = b` in place.
    pub(crate) fn solve(&self, b: &mut [f64]) {
        for (r, row) in self.rows.iter().enumerate() {
            let n = row.len() - 1;
            b[r] = (b[r] - dot(&row[..n], &b[self.first[r]..])) / row[n];
        }
        for (r, row) in self.rows.iter().enumerate().rev() {
            let n = row.len() - 1;
            b[r] /= row[n];
            let x = b[r];
            for (entry, value) in b[self.first[r]..].iter_mut().zip(&row[..n]) {
                *entry -= value * x;
            }
        }
    }
}

/// Four sums side by side, added at the end: always in the same order.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let (a, b) = (a[..n].chunks_exact(4), b[..n].chunks_exact(4));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(x, y)| x * y).sum();
    let mut sums = [0.0; 4];
    for (x, y) in a.zip(b) {
        for k in 0..4 {
            sums[k] += x[k] * y[k];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}
