//! The work of a factorisation: subtrees of the elimination tree side by side, then the panels that need
//! several of them, each with its rows on all threads.
//!
//! Every block takes its products in the order of elimination, on any thread.

use crate::block_cholesky::{BlockCholesky, BlockKind};
use crate::block6::{Block6, NotPositiveDefinite, divide, factorise_block, subtract_products};
use rayon::prelude::*;
use std::ops::Range;
use tessera_geometry::Matrix6;

/// Block products between two signs of life: some milliseconds.
pub(crate) const PRODUCTS_OF_A_PART: usize = 1 << 16;
/// Subtrees between two signs of life.
const SUBTREES_OF_A_PART: usize = 16;
/// Block products of a panel from which on its rows are shared out to all threads: some 0.1 ms.
pub(crate) const SHARED_PRODUCTS: usize = 1 << 12;
/// Rows of a panel that one thread does at a time.
const ROWS_OF_A_PART: usize = 32;

/// The values of a system, in its own order.
#[derive(Clone, Copy)]
pub(crate) struct Values<'a> {
    pub(crate) diagonal: &'a [Matrix6],
    pub(crate) blocks: &'a [Matrix6],
    pub(crate) lambda: f64,
}

/// A factorisation at work.
#[derive(Clone, Copy)]
pub(crate) struct Factorisation<'a> {
    pub(crate) of: &'a BlockCholesky,
    pub(crate) values: Values<'a>,
}

impl Factorisation<'_> {
    /// The subtrees, side by side.
    pub(crate) fn subtrees(
        &self,
        factor: &mut [Block6],
        progress: &mut dyn FnMut(),
    ) -> Result<(), NotPositiveDefinite> {
        let BlockCholesky { panels, subtrees, place, arch, .. } = self.of;
        let (mut rest, mut first) = (factor, 0);
        for part in subtrees.chunks(SUBTREES_OF_A_PART) {
            let mut own = Vec::with_capacity(part.len());
            for subtree in part {
                let blocks = panels.blocks_of(subtree);
                let (here, behind) =
                    std::mem::take(&mut rest)[blocks.start - first..].split_at_mut(blocks.len());
                (rest, first) = (behind, blocks.end);
                own.push((subtree.clone(), here));
            }
            let factorise = |place_of_row: &mut Vec<u32>, (panels, blocks): (Range<usize>, &mut [Block6])| {
                arch.dispatch(Alone { work: *self, panels, blocks, place_of_row })
            };
            let room = || vec![0; place.len()];
            if own.len() == 1 {
                // A small system: the threads would be woken for nothing.
                own.into_iter().try_for_each(|own| factorise(&mut room(), own))?;
            } else {
                own.into_par_iter().map_init(room, factorise).collect::<Result<(), _>>()?;
            }
            progress();
        }
        Ok(())
    }

    /// The panels that need several subtrees, one after the other.
    pub(crate) fn last(
        &self,
        factor: &mut [Block6],
        progress: &mut dyn FnMut(),
    ) -> Result<(), NotPositiveDefinite> {
        let BlockCholesky { panels, last, place, arch, .. } = self.of;
        let mut place_of_row = vec![0; if last.is_empty() { 0 } else { place.len() }];
        let mut n_products = 0;
        for &panel in last {
            n_products += panels.n_products(panel);
            if panels.n_products(panel) < SHARED_PRODUCTS {
                let blocks = &mut factor[..panels.blocks(panel).end];
                let (panels, place_of_row) = (panel..panel + 1, &mut place_of_row);
                arch.dispatch(Alone { work: *self, panels, blocks, place_of_row })?;
            } else {
                self.share_out(panel, factor, &mut place_of_row)?;
            }
            if n_products >= PRODUCTS_OF_A_PART {
                n_products = 0;
                progress();
            }
        }
        Ok(())
    }
}

impl Factorisation<'_> {
    /// One large panel, its rows on all threads.
    fn share_out(
        &self,
        panel: usize,
        factor: &mut [Block6],
        place_of_row: &mut [u32],
    ) -> Result<(), NotPositiveDefinite> {
        let BlockCholesky { panels, arch, .. } = self.of;
        let (before, own) = factor[..panels.blocks(panel).end].split_at_mut(panels.blocks(panel).start);
        self.begin(panel, own, place_of_row);
        let (width, place_of_row) = (panels.width(panel), &*place_of_row);
        let part = ROWS_OF_A_PART * width;
        own.par_chunks_mut(part).enumerate().for_each(|(at, blocks)| {
            let first = at * ROWS_OF_A_PART;
            let rows = PanelRows { panel, first, blocks };
            arch.dispatch(TakeProducts { work: *self, rows, before, place_of_row });
        });
        let (square, below) = own.split_at_mut(width * width);
        arch.dispatch(Square { blocks: square, width })?;
        below.par_chunks_mut(part).for_each(|blocks| arch.dispatch(Below { square, blocks, width }));
        Ok(())
    }

    /// The values of a panel, and where the rows are that earlier panels share with it.
    #[inline(always)]
    fn begin(&self, panel: usize, own: &mut [Block6], place_of_row: &mut [u32]) {
        let BlockCholesky { panels, goes, goes_starts, .. } = self.of;
        let Values { diagonal, blocks, lambda } = self.values;
        own.fill(Block6::ZERO);
        let start = panels.blocks(panel).start;
        for goes in &goes[goes_starts[panel]..goes_starts[panel + 1]] {
            let (to, from) = (&mut own[goes.to - start], goes.from as usize);
            match goes.kind {
                BlockKind::Diagonal => to.add(&(diagonal[from] + Matrix6::identity() * lambda), false),
                BlockKind::Lower => to.add(&blocks[from], false),
                BlockKind::Transposed => to.add(&blocks[from], true),
            }
        }
        let rows = panels.columns(panel).chain(panels.below(panel).iter().map(|&row| row as usize));
        rows.zip(0..).for_each(|(row, place)| place_of_row[row] = place);
    }

    /// Takes what earlier panels give to some rows of a panel; `before` has their blocks, the last of them
    /// directly before the panel's own.
    #[inline(always)]
    fn take(&self, rows: PanelRows<'_>, before: &[Block6], place_of_row: &[u32]) {
        let panels = &self.of.panels;
        let PanelRows { panel, first, blocks } = rows;
        let (columns, own_width) = (panels.columns(panel), panels.width(panel));
        let end = first + blocks.len() / own_width;
        let hidden = panels.blocks(panel).start - before.len();
        for update in panels.updates(panel) {
            let earlier = update.panel as usize;
            let (from, to, width) = (update.from as usize, update.to as usize, panels.width(earlier));
            let below = panels.below(earlier);
            let start = panels.blocks(earlier).start - hidden + width * width;
            let theirs = &before[start..start + below.len() * width];
            let row = |at: usize| &theirs[at * width..][..width];
            let place = |at: usize| place_of_row[below[at] as usize] as usize;
            let skipped = below[from..].partition_point(|&r| (place_of_row[r as usize] as usize) < first);
            for at in from + skipped..below.len() {
                if place(at) >= end {
                    break;
                }
                let own = &mut blocks[(place(at) - first) * own_width..][..own_width];
                for column in from..to.min(at + 1) {
                    let to = &mut own[below[column] as usize - columns.start];
                    subtract_products(to, row(at), row(column));
                }
            }
        }
    }
}

/// Rows of a panel from `first` on.
struct PanelRows<'a> {
    panel: usize,
    first: usize,
    blocks: &'a mut [Block6],
}

/// The triangle on top of a panel, once it has taken what earlier ones give.
#[inline(always)]
fn factorise_square(square: &mut [Block6], width: usize) -> Result<(), NotPositiveDefinite> {
    for k in 0..width {
        let (above, below) = square.split_at_mut((k + 1) * width);
        let own = &mut above[k * width..];
        let (done, rest) = own.split_at_mut(k);
        subtract_products(&mut rest[0], done, done);
        factorise_block(&mut rest[0])?;
        for row in below.chunks_exact_mut(width) {
            let (theirs, rest_of_row) = row.split_at_mut(k);
            subtract_products(&mut rest_of_row[0], theirs, done);
            divide(&mut rest_of_row[0], &rest[0]);
        }
    }
    Ok(())
}

/// The rows below a triangle that is done.
#[inline(always)]
fn divide_rows(square: &[Block6], below: &mut [Block6], width: usize) {
    for row in below.chunks_exact_mut(width) {
        for k in 0..width {
            let own = &square[k * width..][..=k];
            let (done, rest) = row.split_at_mut(k);
            subtract_products(&mut rest[0], done, &own[..k]);
            divide(&mut rest[0], &own[k]);
        }
    }
}

/// Panels one after the other on one thread; `blocks` ends with those of the last one, and has all that
/// goes into them.
struct Alone<'a> {
    work: Factorisation<'a>,
    panels: Range<usize>,
    blocks: &'a mut [Block6],
    place_of_row: &'a mut Vec<u32>,
}

impl pulp::WithSimd for Alone<'_> {
    type Output = Result<(), NotPositiveDefinite>;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) -> Self::Output {
        let Self { work, panels: range, blocks, place_of_row } = self;
        let panels = &work.of.panels;
        let hidden = panels.blocks_of(&range).end - blocks.len();
        for panel in range {
            let Range { start, end } = panels.blocks(panel);
            let (before, own) = blocks[..end - hidden].split_at_mut(start - hidden);
            work.begin(panel, own, place_of_row);
            work.take(PanelRows { panel, first: 0, blocks: &mut *own }, before, place_of_row);
            let width = panels.width(panel);
            let (square, below) = own.split_at_mut(width * width);
            factorise_square(square, width)?;
            divide_rows(square, below, width);
        }
        Ok(())
    }
}

/// [`Factorisation::take`] for each instruction set.
struct TakeProducts<'a> {
    work: Factorisation<'a>,
    rows: PanelRows<'a>,
    before: &'a [Block6],
    place_of_row: &'a [u32],
}

impl pulp::WithSimd for TakeProducts<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        self.work.take(self.rows, self.before, self.place_of_row);
    }
}

/// [`factorise_square`] for each instruction set.
struct Square<'a> {
    blocks: &'a mut [Block6],
    width: usize,
}

impl pulp::WithSimd for Square<'_> {
    type Output = Result<(), NotPositiveDefinite>;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) -> Self::Output {
        factorise_square(self.blocks, self.width)
    }
}

/// [`divide_rows`] for each instruction set.
struct Below<'a> {
    square: &'a [Block6],
    blocks: &'a mut [Block6],
    width: usize,
}

impl pulp::WithSimd for Below<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        divide_rows(self.square, self.blocks, self.width);
    }
}
