//! Sparse Cholesky factorisation of 6x6 blocks, panel by panel.
//!
//! Its loops have fixed lanes, every block takes its products in the order of elimination, and the
//! instructions are dispatched at run time: the same bits with every set of vector instructions and for
//! any number of threads.

use crate::block6::{Block6, NotPositiveDefinite};
use crate::elimination::Elimination;
use crate::factorisation::{Factorisation, Values};
use crate::panels::Panels;
use nalgebra::SMatrix;
use std::ops::Range;
use tessera_geometry::{Matrix6, Vector6};

/// A factor `L` with `H + lambda I = L L^T`, its pattern kept from one set of values to the next.
pub struct BlockCholesky {
    /// Place in the order of elimination of each pose.
    pub(crate) place: Vec<usize>,
    pub(crate) panels: Panels,
    /// Parts that need nothing of each other, and the panels that come after them.
    pub(crate) subtrees: Vec<Range<usize>>,
    pub(crate) last: Vec<usize>,
    /// By panel: where each block of the system goes.
    pub(crate) goes: Vec<Goes>,
    pub(crate) goes_starts: Vec<usize>,
    factor: Vec<Block6>,
    pub(crate) arch: pulp::Arch,
}

/// A block of the system on its way into the factor.
#[derive(Clone, Copy)]
pub(crate) struct Goes {
    /// Place in the factor.
    pub(crate) to: usize,
    /// Place among the blocks off the diagonal; on the diagonal that of the pose.
    pub(crate) from: u32,
    pub(crate) kind: BlockKind,
}

#[derive(Clone, Copy, PartialEq)]
pub(crate) enum BlockKind {
    Diagonal,
    Lower,
    Transposed,
}

impl BlockCholesky {
    /// Room for systems of `n` poses with blocks at these places off the diagonal.
    pub fn new(n: usize, pattern: &[(usize, usize)], arch: pulp::Arch) -> Self {
        let elimination = Elimination::new(n, pattern);
        let panels = Panels::new(&elimination);
        let place = elimination.place;
        let on_diagonal = place.iter().enumerate().map(|(pose, &at)| Goes {
            to: panels.place(at, at),
            from: pose as u32,
            kind: BlockKind::Diagonal,
        });
        let off_diagonal = pattern.iter().enumerate().map(|(from, &(row, column))| {
            let (row, column) = (place[row], place[column]);
            let kind = if row < column { BlockKind::Transposed } else { BlockKind::Lower };
            Goes { to: panels.place(row.max(column), row.min(column)), from: from as u32, kind }
        });
        let mut goes: Vec<Goes> = on_diagonal.chain(off_diagonal).collect();
        goes.sort_unstable_by_key(|goes| goes.to);
        let start = |panel: usize| goes.partition_point(|goes| goes.to < panels.blocks_of(&(0..panel)).end);
        let goes_starts = (0..=panels.n()).map(start).collect();
        let subtrees = panels.subtrees();
        let mut is_last = vec![true; panels.n()];
        subtrees.iter().for_each(|part| is_last[part.clone()].fill(false));
        let last = (0..panels.n()).filter(|&panel| is_last[panel]).collect();
        let factor = vec![Block6::ZERO; panels.n_blocks()];
        Self { place, panels, subtrees, last, goes, goes_starts, factor, arch }
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
        let mut factor = std::mem::take(&mut self.factor);
        let work = Factorisation { of: self, values: Values { diagonal, blocks, lambda } };
        let result = work.subtrees(&mut factor, progress).and_then(|()| work.last(&mut factor, progress));
        self.factor = factor;
        result
    }

    /// Solves `(H + lambda I) d = -gradient` by the last factor.
    pub fn solve(&self, gradient: &[Vector6]) -> Vec<Vector6> {
        let rhs: Vec<Vector6> = gradient.iter().map(|g| -g).collect();
        self.solve_columns(&rhs)
    }

    /// Solves `(H + lambda I) X = B` by the last factor, for `N` right-hand sides: six rows of `B`
    /// and of `X` for each pose.
    pub fn solve_columns<const N: usize>(&self, rhs: &[SMatrix<f64, 6, N>]) -> Vec<SMatrix<f64, 6, N>> {
        let mut x = vec![SMatrix::<f64, 6, N>::zeros(); self.place.len()];
        for (&place, b) in self.place.iter().zip(rhs) {
            x[place] = *b;
        }
        (0..self.panels.n()).for_each(|panel| self.substitute_forward(panel, &mut x));
        (0..self.panels.n()).rev().for_each(|panel| self.substitute_back(panel, &mut x));
        self.place.iter().map(|&place| x[place]).collect()
    }

    /// `X = L^-1 X` for the columns of a panel.
    fn substitute_forward<const N: usize>(&self, panel: usize, x: &mut [SMatrix<f64, 6, N>]) {
        let (columns, width) = (self.panels.columns(panel), self.panels.width(panel));
        let (square, below) = self.factor[self.panels.blocks(panel)].split_at(width * width);
        for k in 0..width {
            let row = &square[k * width..][..=k];
            let (known, own) = x[columns.start..].split_at_mut(k);
            subtract_row(&mut own[0], row, known);
            let l = &row[k].0;
            let y = &mut own[0];
            for s in 0..N {
                for k in 0..6 {
                    let known: f64 = (0..k).map(|m| l[m][k] * y[(m, s)]).sum();
                    y[(k, s)] = (y[(k, s)] - known) / l[k][k];
                }
            }
        }
        let (before, after) = x.split_at_mut(columns.end);
        for (row, &at) in below.chunks_exact(width).zip(self.panels.below(panel)) {
            subtract_row(&mut after[at as usize - columns.end], row, &before[columns.start..]);
        }
    }

    /// `X = L^-T X` for the columns of a panel.
    fn substitute_back<const N: usize>(&self, panel: usize, x: &mut [SMatrix<f64, 6, N>]) {
        let (columns, width) = (self.panels.columns(panel), self.panels.width(panel));
        let blocks = &self.factor[self.panels.blocks(panel)];
        let below = self.panels.below(panel);
        for k in (0..width).rev() {
            let mut y = x[columns.start + k];
            let rows = (columns.start + k + 1..columns.end).chain(below.iter().map(|&row| row as usize));
            for (at, row) in (k + 1..).zip(rows) {
                let (l, b) = (&blocks[at * width + k].0, &x[row]);
                for s in 0..N {
                    for c in 0..6 {
                        y[(c, s)] -= (0..6).map(|r| l[c][r] * b[(r, s)]).sum::<f64>();
                    }
                }
            }
            let l = &blocks[k * width + k].0;
            for s in 0..N {
                for k in (0..6).rev() {
                    let known: f64 = (k + 1..6).map(|m| l[k][m] * y[(m, s)]).sum();
                    y[(k, s)] = (y[(k, s)] - known) / l[k][k];
                }
            }
            x[columns.start + k] = y;
        }
    }
}

/// `x -= sum l y` over a row of blocks.
fn subtract_row<const N: usize>(x: &mut SMatrix<f64, 6, N>, row: &[Block6], known: &[SMatrix<f64, 6, N>]) {
    for (l, y) in row.iter().zip(known) {
        for s in 0..N {
            for c in 0..6 {
                for r in 0..6 {
                    x[(r, s)] -= l.0[c][r] * y[(c, s)];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
