//! Gates: where in the target image the match of a query can be.

use crate::feature::Feature;

/// A disc of the target image in which the match of one query lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gate {
    /// Predicted row and column, pixels of the full target image.
    pub pixel: [f32; 2],
    /// Radius of the disc, pixels; infinite: anywhere.
    pub radius_px: f32,
}

impl Gate {
    /// No prediction: the match can be anywhere.
    pub const ANYWHERE: Self = Self { pixel: [0.0; 2], radius_px: f32::INFINITY };

    /// Whether a target lies inside; never for a NaN, as a point behind the camera predicts.
    #[inline(always)]
    fn admits(&self, [row, column]: [f32; 2]) -> bool {
        let (row, column) = (row - self.pixel[0], column - self.pixel[1]);
        row * row + column * column <= self.radius_px * self.radius_px
    }
}

/// Height and width of the cells of the image by which targets are sorted, pixels. A gate goes through few rows of them:
/// the end of each is a branch that no one can tell.
const CELL_PX: [f32; 2] = [48.0, 8.0];
/// Cells along a side of the image at most: the last one holds all beyond it.
const MOST_CELLS: usize = 256;

/// Targets that a gate is compared with at a time: most runs of cells hold fewer.
pub(crate) const AT_ONCE: usize = 8;

/// Targets by cell of the image, rows of cells one after the other.
#[derive(Clone, Debug, Default)]
pub(crate) struct TargetCells {
    /// Rows and columns of cells.
    n: [usize; 2],
    /// Cell `c` holds the places `starts[c]..starts[c + 1]`, in order of features.
    starts: Vec<u32>,
    /// By place all that decides whether a target is admitted, and its index; filled up with places of no target.
    rows: Vec<f32>,
    columns: Vec<f32>,
    levels: Vec<u32>,
    indices: Vec<u32>,
}

impl TargetCells {
    pub(crate) fn fill(&mut self, features: &[Feature]) {
        self.n = [0, 1].map(|axis| {
            let farthest = features.iter().fold(0.0f32, |most, f| most.max(f.pixel[axis]));
            ((farthest / CELL_PX[axis]) as usize + 1).min(MOST_CELLS)
        });
        let n = self.n;
        let cell_of = |f: &Feature| cell(f.pixel, 0, n) * n[1] + cell(f.pixel, 1, n);
        self.starts.clear();
        self.starts.resize(n[0] * n[1] + 2, 0);
        // Counted two places on, so that the starts are right once all are placed.
        features.iter().for_each(|f| self.starts[cell_of(f) + 2] += 1);
        (2..self.starts.len()).for_each(|c| self.starts[c] += self.starts[c - 1]);
        let n_places = features.len() + AT_ONCE;
        self.rows.resize(n_places, 0.0);
        self.columns.resize(n_places, 0.0);
        self.levels.resize(n_places, 0);
        self.indices.resize(n_places, 0);
        for (index, f) in (0..).zip(features) {
            let next = &mut self.starts[cell_of(f) + 1];
            let place = *next as usize;
            *next += 1;
            [self.rows[place], self.columns[place]] = f.pixel;
            (self.levels[place], self.indices[place]) = (f.level.into(), index);
        }
    }

    /// Puts the indices of the targets that the gate admits, of levels not farther from the query's than by `most_apart`,
    /// in the first places of `admitted`, which has [`AT_ONCE`] more than there are targets; returns how many.
    #[inline(always)]
    pub(crate) fn within(&self, gate: &Gate, level: u32, most_apart: u32, admitted: &mut [u32]) -> usize {
        let mut n = 0;
        let reach = [-gate.radius_px, gate.radius_px];
        let [first, last] = reach.map(|reach| gate.pixel.map(|pixel| pixel + reach));
        let [from, to] = [cell(first, 1, self.n), cell(last, 1, self.n) + 1];
        for row in cell(first, 0, self.n)..=cell(last, 0, self.n) {
            // Cells beside each other hold one run of targets.
            let [from, to] = [from, to].map(|column| self.starts[row * self.n[1] + column] as usize);
            for at in (from..to).step_by(AT_ONCE) {
                let (rows, columns) = (&self.rows[at..at + AT_ONCE], &self.columns[at..at + AT_ONCE]);
                let (levels, indices) = (&self.levels[at..at + AT_ONCE], &self.indices[at..at + AT_ONCE]);
                let mut is_admitted = [0u32; AT_ONCE];
                for k in 0..AT_ONCE {
                    let is_near = levels[k].abs_diff(level) <= most_apart;
                    let is_here = k < to - at;
                    is_admitted[k] = u32::from(gate.admits([rows[k], columns[k]]) & is_near & is_here);
                }
                // Without a branch: each is put down, and overwritten by the next one unless it is admitted.
                for k in 0..AT_ONCE {
                    admitted[n] = indices[k];
                    n += is_admitted[k] as usize;
                }
            }
        }
        n
    }
}

/// Row or column of the cell of a pixel.
#[inline(always)]
fn cell(pixel: [f32; 2], axis: usize, n: [usize; 2]) -> usize {
    // A cast saturates, NaN becomes 0.
    ((pixel[axis] / CELL_PX[axis]) as usize).min(n[axis] - 1)
}
