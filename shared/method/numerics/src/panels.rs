//! The pattern of a factor in panels: columns next to each other with the same rows below them, stored
//! row by row, so that a product of two rows runs over memory that lies together.

use crate::elimination::Elimination;
use std::ops::Range;

/// Most columns of a panel: two rows of blocks fit the first-level cache.
const MOST_COLUMNS: usize = 8;

/// Block products of a subtree that one thread does by itself: a millisecond.
const PRODUCTS_OF_A_SUBTREE: usize = 1 << 16;

/// Places of the blocks of a factor.
pub(crate) struct Panels {
    /// Panel `p` has the columns `columns[p]..columns[p + 1]`.
    columns: Vec<usize>,
    /// Its rows below them are `rows[row_starts[p]..row_starts[p + 1]]`, rising.
    row_starts: Vec<usize>,
    rows: Vec<u32>,
    /// Its blocks: a row of the triangle for each column, filled up to a square, then the rows below.
    block_starts: Vec<usize>,
    /// The panel of each column.
    panel_of: Vec<u32>,
    /// Updates of panel `p` by earlier ones: `updates[update_starts[p]..update_starts[p + 1]]`.
    update_starts: Vec<usize>,
    updates: Vec<Update>,
    /// Products of blocks that each panel takes.
    n_products: Vec<usize>,
}

/// Rows of an earlier panel that are columns of a later one: places among the rows below it.
#[derive(Clone, Copy)]
pub(crate) struct Update {
    pub(crate) panel: u32,
    pub(crate) from: u32,
    pub(crate) to: u32,
}

impl Panels {
    pub(crate) fn new(elimination: &Elimination) -> Self {
        let Elimination { starts, rows, .. } = elimination;
        let n = starts.len() - 1;
        let below = |column: usize| &rows[starts[column]..starts[column + 1]];
        let mut panels = Self {
            columns: vec![0],
            row_starts: vec![0],
            rows: Vec::new(),
            block_starts: vec![0],
            panel_of: Vec::with_capacity(n),
            update_starts: Vec::new(),
            updates: Vec::new(),
            n_products: Vec::new(),
        };
        let mut first = 0;
        while first < n {
            let mut end = first + 1;
            // The next column belongs to it where it has the same rows but itself.
            while end < n
                && end - first < MOST_COLUMNS
                && below(end - 1).first() == Some(&(end as u32))
                && below(end - 1).len() == below(end).len() + 1
            {
                end += 1;
            }
            panels.push(first, end, below(end - 1));
            first = end;
        }
        panels.link();
        panels
    }

    fn push(&mut self, first: usize, end: usize, below: &[u32]) {
        let width = end - first;
        let panel = self.n() as u32;
        self.panel_of.extend((0..width).map(|_| panel));
        self.rows.extend_from_slice(below);
        self.columns.push(end);
        self.row_starts.push(self.rows.len());
        self.block_starts.push(self.n_blocks() + (width + below.len()) * width);
        // Within the panel.
        self.n_products.push((0..width).map(|k| k * (width - k + below.len())).sum());
    }

    /// Finds out which panel goes into which, in the order of elimination.
    fn link(&mut self) {
        let mut found: Vec<(u32, Update)> = Vec::new();
        for panel in 0..self.n() {
            let rows = &self.rows[self.row_starts[panel]..self.row_starts[panel + 1]];
            let width = self.columns[panel + 1] - self.columns[panel];
            let mut from = 0;
            while from < rows.len() {
                let into = self.panel_of[rows[from] as usize] as usize;
                let to = from + rows[from..].partition_point(|&row| (row as usize) < self.columns[into + 1]);
                let n: usize = (from..to).map(|at| rows.len() - at).sum();
                found.push((into as u32, Update { panel: panel as u32, from: from as u32, to: to as u32 }));
                self.n_products[into] += n * width;
                from = to;
            }
        }
        // Stable: the panels that go into one stay in their order.
        found.sort_by_key(|(into, _)| *into);
        self.update_starts = (0..=self.n()).map(|p| found.partition_point(|f| (f.0 as usize) < p)).collect();
        self.updates = found.into_iter().map(|(_, update)| update).collect();
    }

    pub(crate) fn n(&self) -> usize {
        self.columns.len() - 1
    }

    pub(crate) fn n_blocks(&self) -> usize {
        self.block_starts[self.block_starts.len() - 1]
    }

    pub(crate) fn columns(&self, panel: usize) -> Range<usize> {
        self.columns[panel]..self.columns[panel + 1]
    }

    pub(crate) fn width(&self, panel: usize) -> usize {
        self.columns(panel).len()
    }

    /// The rows below a panel's columns.
    pub(crate) fn below(&self, panel: usize) -> &[u32] {
        &self.rows[self.row_starts[panel]..self.row_starts[panel + 1]]
    }

    /// Places of a panel's blocks.
    pub(crate) fn blocks(&self, panel: usize) -> Range<usize> {
        self.block_starts[panel]..self.block_starts[panel + 1]
    }

    /// Places of the blocks of several panels next to each other.
    pub(crate) fn blocks_of(&self, panels: &Range<usize>) -> Range<usize> {
        self.block_starts[panels.start]..self.block_starts[panels.end]
    }

    /// Updates of a panel, in the order of elimination.
    pub(crate) fn updates(&self, panel: usize) -> &[Update] {
        &self.updates[self.update_starts[panel]..self.update_starts[panel + 1]]
    }

    pub(crate) fn n_products(&self, panel: usize) -> usize {
        self.n_products[panel]
    }

    /// Place of a block on or below the diagonal.
    pub(crate) fn place(&self, row: usize, column: usize) -> usize {
        let panel = self.panel_of[column] as usize;
        let Range { start: first, end } = self.columns(panel);
        let width = end - first;
        let at = if row < end {
            row - first
        } else {
            width + self.below(panel).partition_point(|&r| (r as usize) < row)
        };
        self.block_starts[panel] + at * width + column - first
    }

    /// Parts of the work that need nothing of each other, rising: whole subtrees of the elimination tree whose
    /// panels lie next to each other, several small ones together. What is in none of them comes after
    /// them, in order.
    pub(crate) fn subtrees(&self) -> Vec<Range<usize>> {
        let n = self.n();
        if self.n_products.iter().sum::<usize>() <= PRODUCTS_OF_A_SUBTREE {
            return std::iter::once(0..n).collect();
        }
        let mut first: Vec<usize> = (0..n).collect();
        let (mut size, mut cost) = (vec![1; n], self.n_products.clone());
        for panel in 0..n {
            if let Some(&row) = self.below(panel).first() {
                let parent = self.panel_of[row as usize] as usize;
                first[parent] = first[parent].min(first[panel]);
                size[parent] += size[panel];
                cost[parent] += cost[panel];
            }
        }
        let mut parts: Vec<(Range<usize>, usize)> = Vec::new();
        let mut end = n;
        while end > 0 {
            let (panel, from) = (end - 1, first[end - 1]);
            if size[panel] != end - from || cost[panel] > PRODUCTS_OF_A_SUBTREE {
                end = panel;
                continue;
            }
            match parts.last_mut() {
                Some((next, sum)) if next.start == end && *sum + cost[panel] <= PRODUCTS_OF_A_SUBTREE => {
                    (next.start, *sum) = (from, *sum + cost[panel]);
                }
                _ => parts.push((from..end, cost[panel])),
            }
            end = from;
        }
        parts.into_iter().rev().map(|(part, _)| part).collect()
    }
}
