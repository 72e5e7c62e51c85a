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

/// Height of the bands of the image by which targets are sorted, pixels.
const BAND_PX: f32 = 8.0;
/// Bands at most: the last one holds all below it.
const MAX_BANDS: usize = 256;
/// Targets that are looked at together.
const LANES: usize = 16;

/// A target as the bands hold it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GateTarget {
    pub(crate) descriptor: [u64; 4],
    pub(crate) pixel: [f32; 2],
    pub(crate) level: u8,
    /// Of the feature.
    pub(crate) index: u32,
}

/// Targets by band of the image.
#[derive(Clone, Debug, Default)]
pub(crate) struct TargetBands {
    n_bands: usize,
    /// Band `b` holds `targets[starts[b]..starts[b + 1]]`, in order of features.
    starts: Vec<u32>,
    targets: Vec<GateTarget>,
    /// Row and column of each target, apart: all that a gate reads of most. Filled up to whole lanes with NaN.
    rows: Vec<f32>,
    columns: Vec<f32>,
    /// Targets that the last gate admits.
    within: Vec<u32>,
}

impl TargetBands {
    pub(crate) fn fill(&mut self, features: &[Feature]) {
        let lowest = features.iter().fold(0.0f32, |most, f| most.max(f.pixel[0]));
        self.n_bands = ((lowest / BAND_PX) as usize + 1).min(MAX_BANDS);
        self.starts.clear();
        self.starts.resize(self.n_bands + 2, 0);
        // Counted two places on, so that the starts are right once all are placed.
        features.iter().for_each(|f| self.starts[band(f.pixel[0], self.n_bands) + 2] += 1);
        (2..self.starts.len()).for_each(|b| self.starts[b] += self.starts[b - 1]);
        self.targets.clear();
        self.targets
            .resize(features.len(), GateTarget { descriptor: [0; 4], pixel: [0.0; 2], level: 0, index: 0 });
        for column in [&mut self.rows, &mut self.columns] {
            column.clear();
            column.resize(features.len() + LANES, f32::NAN);
        }
        for (i, f) in features.iter().enumerate() {
            let next = &mut self.starts[band(f.pixel[0], self.n_bands) + 1];
            let (descriptor, pixel, level) = (f.descriptor, f.pixel, f.level);
            self.targets[*next as usize] = GateTarget { descriptor, pixel, level, index: i as u32 };
            [self.rows[*next as usize], self.columns[*next as usize]] = f.pixel;
            *next += 1;
        }
    }

    /// The targets that the gate admits.
    #[inline(always)]
    pub(crate) fn within(&mut self, gate: &Gate) -> impl Iterator<Item = &GateTarget> {
        let first = band(gate.pixel[0] - gate.radius_px, self.n_bands);
        let last = band(gate.pixel[0] + gate.radius_px, self.n_bands);
        let (from, to) = (self.starts[first] as usize, self.starts[last + 1] as usize);
        self.within.clear();
        for at in (from..to).step_by(LANES) {
            let run = |column: &[f32]| *column[at..].first_chunk::<LANES>().unwrap_or(&[f32::NAN; LANES]);
            let (rows, columns) = (run(&self.rows), run(&self.columns));
            // Without a branch for each target, which would be foretold badly.
            let mut bits = [0u32; LANES];
            (0..LANES).for_each(|l| bits[l] = u32::from(gate.admits(rows[l], columns[l])) << l);
            let mut admitted = bits.iter().fold(0, |all, bit| all | bit);
            while admitted != 0 {
                let place = at + admitted.trailing_zeros() as usize;
                admitted &= admitted - 1;
                if place < to {
                    self.within.push(place as u32);
                }
            }
        }
        self.within.iter().map(|target| &self.targets[*target as usize])
    }
}

#[inline(always)]
fn band(row: f32, n: usize) -> usize {
    // A cast saturates, NaN becomes 0.
    ((row / BAND_PX) as usize).min(n - 1)
}
