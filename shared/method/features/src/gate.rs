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
    fn admits(&self, row: f32, column: f32) -> bool {
        let (row, column) = (row - self.pixel[0], column - self.pixel[1]);
        row * row + column * column <= self.radius_px * self.radius_px
    }
}

/// Side of the grid's cells, pixels.
const CELL_PX: f32 = 32.0;
/// Cells along each side at most.
const MAX_CELLS: usize = 64;

/// A target as the grid holds it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GateTarget {
    pub(crate) descriptor: [u64; 4],
    pub(crate) pixel: [f32; 2],
    pub(crate) level: u8,
    /// Of the feature.
    pub(crate) index: u32,
}

/// Targets by cell of the image.
#[derive(Clone, Debug, Default)]
pub(crate) struct TargetGrid {
    size: [usize; 2],
    /// Cell `c` holds `targets[starts[c]..starts[c + 1]]`, row by row, in order of features.
    starts: Vec<u32>,
    targets: Vec<GateTarget>,
    /// Row and column of each target, apart: all that a gate reads of most.
    places: Vec<(f32, f32)>,
    /// Targets that the last gate admits, and room for one more.
    within: Vec<u32>,
}

impl TargetGrid {
    pub(crate) fn fill(&mut self, features: &[Feature]) {
        let most = |k: usize| features.iter().fold(0.0f32, |most, f| most.max(f.pixel[k]));
        self.size = [0, 1].map(|k| ((most(k) / CELL_PX) as usize + 1).min(MAX_CELLS));
        let [rows, columns] = self.size;
        self.starts.clear();
        self.starts.resize(rows * columns + 2, 0);
        let cell = |f: &Feature| {
            let [row, column] = [0, 1].map(|k| index(f.pixel[k], self.size[k]));
            row * columns + column
        };
        // Counted two places on, so that the starts are right once all are placed.
        features.iter().for_each(|f| self.starts[cell(f) + 2] += 1);
        (2..self.starts.len()).for_each(|c| self.starts[c] += self.starts[c - 1]);
        self.targets.clear();
        self.targets
            .resize(features.len(), GateTarget { descriptor: [0; 4], pixel: [0.0; 2], level: 0, index: 0 });
        self.places.clear();
        self.places.resize(features.len(), (0.0, 0.0));
        self.within.clear();
        self.within.resize(features.len() + 1, 0);
        for (i, f) in features.iter().enumerate() {
            let next = &mut self.starts[cell(f) + 1];
            let (descriptor, pixel, level) = (f.descriptor, f.pixel, f.level);
            self.targets[*next as usize] = GateTarget { descriptor, pixel, level, index: i as u32 };
            self.places[*next as usize] = (f.pixel[0], f.pixel[1]);
            *next += 1;
        }
    }

    /// The targets that the gate admits.
    #[inline(always)]
    pub(crate) fn within(&mut self, gate: &Gate) -> impl Iterator<Item = &GateTarget> {
        let [rows, columns] = [0, 1].map(|k| {
            let first = index(gate.pixel[k] - gate.radius_px, self.size[k]);
            [first, index(gate.pixel[k] + gate.radius_px, self.size[k])]
        });
        // Without a branch for each target, which would be foretold badly: each is put down, and overwritten by
        // the next one unless it counts.
        let mut n = 0;
        for row in rows[0]..=rows[1] {
            let first = row * self.size[1];
            let (from, to) = (self.starts[first + columns[0]], self.starts[first + columns[1] + 1]);
            for (target, (row, column)) in (from..to).zip(&self.places[from as usize..to as usize]) {
                self.within[n] = target;
                n += usize::from(gate.admits(*row, *column));
            }
        }
        self.within[..n].iter().map(|target| &self.targets[*target as usize])
    }
}

#[inline(always)]
fn index(position: f32, n: usize) -> usize {
    // A cast saturates, NaN becomes 0.
    ((position / CELL_PX) as usize).min(n - 1)
}
