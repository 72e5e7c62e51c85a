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
    fn admits(&self, target: &Feature) -> bool {
        let [row, column] = [target.pixel[0] - self.pixel[0], target.pixel[1] - self.pixel[1]];
        row * row + column * column <= self.radius_px * self.radius_px
    }
}

/// Side of the grid's cells, pixels.
const CELL_PX: f32 = 32.0;
/// Cells along each side at most.
const MAX_CELLS: usize = 64;

/// Targets by cell of the image.
#[derive(Clone, Debug, Default)]
pub(crate) struct TargetGrid {
    size: [usize; 2],
    /// Cell `c` holds `targets[starts[c]..starts[c + 1]]`.
    starts: Vec<u32>,
    targets: Vec<u32>,
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
        self.targets.resize(features.len(), 0);
        for (i, f) in features.iter().enumerate() {
            let next = &mut self.starts[cell(f) + 1];
            self.targets[*next as usize] = i as u32;
            *next += 1;
        }
    }

    /// Replaces `inside` by the targets that the gate admits.
    pub(crate) fn search(&self, gate: &Gate, features: &[Feature], inside: &mut Vec<u32>) {
        inside.clear();
        let [rows, columns] = [0, 1].map(|k| {
            let first = index(gate.pixel[k] - gate.radius_px, self.size[k]);
            first..=index(gate.pixel[k] + gate.radius_px, self.size[k])
        });
        for row in rows {
            let first = row * self.size[1];
            let [from, to] = [columns.start(), columns.end()];
            let range = self.starts[first + from] as usize..self.starts[first + to + 1] as usize;
            let targets = self.targets[range].iter().copied();
            inside.extend(targets.filter(|&t| gate.admits(&features[t as usize])));
        }
    }
}

fn index(position: f32, n: usize) -> usize {
    // A cast saturates, NaN becomes 0.
    ((position / CELL_PX) as usize).min(n - 1)
}
