//! Sums, least and largest raw depth of the cells of one row, without a branch.

use crate::cell::CellRule;

/// Over the rows of a cell for each image column, then for each cell.
#[derive(Debug)]
pub(crate) struct CellSums {
    sum: Vec<u32>,
    least: Vec<u16>,
    most: Vec<u16>,
    cell_sum: Vec<u32>,
    cell_least: Vec<u16>,
    /// Largest raw depth of each cell; 0 where nothing was measured.
    pub(crate) cell_most: Vec<u16>,
    /// Mean depth of each cell all of whose pixels lie on one surface; 0 for the others.
    pub(crate) mean_m: Vec<f32>,
}

impl CellSums {
    /// For images of `width` pixels and `n_cells` cells in a row.
    pub(crate) fn new(width: usize, n_cells: usize) -> Self {
        Self {
            sum: vec![0; width],
            least: vec![0; width],
            most: vec![0; width],
            cell_sum: vec![0; n_cells],
            cell_least: vec![0; n_cells],
            cell_most: vec![0; n_cells],
            mean_m: vec![0.0; n_cells],
        }
    }

    /// Takes the `step` rows of pixels that begin with `rows`.
    #[inline(always)]
    pub(crate) fn fill(&mut self, rows: &[u16], width: usize, step: usize, rule: &CellRule) {
        match step {
            2 => self.sums::<2>(rows, width),
            4 => self.sums::<4>(rows, width),
            8 => self.sums::<8>(rows, width),
            _ => self.sums::<1>(rows, width),
        }
        let n = width / step;
        let (least, most) = (&self.cell_least[..n], &self.cell_most[..n]);
        mean_row(rule, least, most, &self.cell_sum[..n], &mut self.mean_m[..n]);
    }

    #[inline(always)]
    fn sums<const STEP: usize>(&mut self, rows: &[u16], width: usize) {
        let rows: [&[u16]; STEP] = std::array::from_fn(|k| &rows[k * width..(k + 1) * width]);
        column_row(rows, &mut self.sum, &mut self.least, &mut self.most);
        sum_row::<STEP>(&self.sum, &mut self.cell_sum);
        least_row::<STEP>(&self.least, &mut self.cell_least);
        most_row::<STEP>(&self.most, &mut self.cell_most);
    }
}

#[inline(always)]
fn column_row<const STEP: usize>(rows: [&[u16]; STEP], sum: &mut [u32], least: &mut [u16], most: &mut [u16]) {
    let n = sum.len();
    let rows = rows.map(|row| &row[..n]);
    let (least, most) = (&mut least[..n], &mut most[..n]);
    for c in 0..n {
        let (mut s, mut low, mut high) = (0, u16::MAX, 0);
        for row in rows {
            s += u32::from(row[c]);
            low = low.min(row[c]);
            high = high.max(row[c]);
        }
        (sum[c], least[c], most[c]) = (s, low, high);
    }
}

#[inline(always)]
fn sum_row<const STEP: usize>(columns: &[u32], cells: &mut [u32]) {
    for (cell, run) in cells.iter_mut().zip(columns.chunks_exact(STEP)) {
        *cell = run.iter().sum();
    }
}

#[inline(always)]
fn least_row<const STEP: usize>(columns: &[u16], cells: &mut [u16]) {
    for (cell, run) in cells.iter_mut().zip(columns.chunks_exact(STEP)) {
        *cell = run.iter().fold(u16::MAX, |a, &b| a.min(b));
    }
}

#[inline(always)]
fn most_row<const STEP: usize>(columns: &[u16], cells: &mut [u16]) {
    for (cell, run) in cells.iter_mut().zip(columns.chunks_exact(STEP)) {
        *cell = run.iter().fold(0, |a, &b| a.max(b));
    }
}

#[inline(always)]
fn mean_row(rule: &CellRule, least: &[u16], most: &[u16], sum: &[u32], out: &mut [f32]) {
    let n = out.len();
    let (least, most, sum) = (&least[..n], &most[..n], &sum[..n]);
    for c in 0..n {
        out[c] = rule.whole_mean(least[c], most[c], sum[c]);
    }
}
