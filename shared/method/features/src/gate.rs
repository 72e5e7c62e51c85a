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

/// Side of the cells of the image by which targets are sorted, pixels.
const CELL_PX: f32 = 16.0;
/// Cells along a side of the image at most: the last one holds all beyond it.
const MOST_CELLS: usize = 256;

/// A target as the cells hold it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GateTarget {
    pub(crate) descriptor: [u64; 4],
    pub(crate) pixel: [f32; 2],
    pub(crate) level: u8,
    /// Of the feature.
    pub(crate) index: u32,
}

/// Targets by cell of the image, rows of cells one after the other.
#[derive(Clone, Debug, Default)]
pub(crate) struct TargetCells {
    /// Rows and columns of cells.
    n: [usize; 2],
    /// Cell `c` holds `targets[starts[c]..starts[c + 1]]`, in order of features.
    starts: Vec<u32>,
    targets: Vec<GateTarget>,
    /// Of each target: all that a gate reads of most.
    pixels: Vec<[f32; 2]>,
}

impl TargetCells {
    pub(crate) fn fill(&mut self, features: &[Feature]) {
        self.n = [0, 1].map(|axis| {
            let farthest = features.iter().fold(0.0f32, |most, f| most.max(f.pixel[axis]));
            ((farthest / CELL_PX) as usize + 1).min(MOST_CELLS)
        });
        let n = self.n;
        let cell_of = |f: &Feature| cell(f.pixel[0], n[0]) * n[1] + cell(f.pixel[1], n[1]);
        self.starts.clear();
        self.starts.resize(n[0] * n[1] + 2, 0);
        // Counted two places on, so that the starts are right once all are placed.
        features.iter().for_each(|f| self.starts[cell_of(f) + 2] += 1);
        (2..self.starts.len()).for_each(|c| self.starts[c] += self.starts[c - 1]);
        self.targets.clear();
        self.targets
            .resize(features.len(), GateTarget { descriptor: [0; 4], pixel: [0.0; 2], level: 0, index: 0 });
        self.pixels.clear();
        self.pixels.resize(features.len(), [0.0; 2]);
        for (i, f) in features.iter().enumerate() {
            let next = &mut self.starts[cell_of(f) + 1];
            let (descriptor, pixel, level) = (f.descriptor, f.pixel, f.level);
            self.targets[*next as usize] = GateTarget { descriptor, pixel, level, index: i as u32 };
            self.pixels[*next as usize] = pixel;
            *next += 1;
        }
    }

    /// Takes the targets that the gate admits.
    #[inline(always)]
    pub(crate) fn within(&self, gate: &Gate, mut take: impl FnMut(&GateTarget)) {
        let [rows, columns] = [0, 1].map(|axis| {
            let at = |side: f32| cell(gate.pixel[axis] + side, self.n[axis]);
            at(-gate.radius_px)..at(gate.radius_px) + 1
        });
        for row in rows {
            // Cells beside each other hold one run of targets.
            let [from, to] =
                [columns.start, columns.end].map(|column| self.starts[row * self.n[1] + column] as usize);
            for (pixel, target) in self.pixels[from..to].iter().zip(&self.targets[from..to]) {
                if gate.admits(*pixel) {
                    take(target);
                }
            }
        }
    }
}

#[inline(always)]
fn cell(pixel: f32, n: usize) -> usize {
    // A cast saturates, NaN becomes 0.
    ((pixel / CELL_PX) as usize).min(n - 1)
}
