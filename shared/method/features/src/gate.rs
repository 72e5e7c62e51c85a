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
    fn admits(&self, pixel: [f32; 2]) -> bool {
        let [row, column] = [pixel[0] - self.pixel[0], pixel[1] - self.pixel[1]];
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
        for (i, f) in features.iter().enumerate() {
            let next = &mut self.starts[cell(f) + 1];
            let (descriptor, pixel, level) = (f.descriptor, f.pixel, f.level);
            self.targets[*next as usize] = GateTarget { descriptor, pixel, level, index: i as u32 };
            *next += 1;
        }
    }

    /// The targets that the gate admits.
    #[inline(always)]
    pub(crate) fn within(&self, gate: &Gate) -> impl Iterator<Item = &GateTarget> {
        let gate = *gate;
        let [rows, columns] = [0, 1].map(|k| {
            let first = index(gate.pixel[k] - gate.radius_px, self.size[k]);
            [first, index(gate.pixel[k] + gate.radius_px, self.size[k])]
        });
        (rows[0]..=rows[1]).flat_map(move |row| {
            let first = row * self.size[1];
            let range =
                self.starts[first + columns[0]] as usize..self.starts[first + columns[1] + 1] as usize;
            self.targets[range].iter().filter(move |target| gate.admits(target.pixel))
        })
    }
}

#[inline(always)]
fn index(position: f32, n: usize) -> usize {
    // A cast saturates, NaN becomes 0.
    ((position / CELL_PX) as usize).min(n - 1)
}
