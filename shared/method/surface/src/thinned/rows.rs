//! Rows of kept vertices through a range coder: each number is predicted from those around, and its probability
//! from how well they were predicted.

use super::Thinning;
use super::rounded::{NUMBERS, RoundedVertex, is_valid};
use crate::packed::predict_row;
use crate::vertex::Vertex;
use tessera_numerics::{BitCoder, BitModel, NumberModel};

/// Adaptive models of the numbers of vertices, by the prediction errors around.
pub(super) struct Models {
    numbers: Vec<[NumberModel; SURPRISES * OTHERS]>,
    /// Whether the flags are those to the left; or else those above.
    is_left: [BitModel; 8],
    is_above: BitModel,
    flags: NumberModel,
}

/// Classes of the residuals around, and of that of another number of the same vertex.
const SURPRISES: usize = 10;
const OTHERS: usize = 4;

impl Default for Models {
    fn default() -> Self {
        let model = || std::array::from_fn(|_| NumberModel::default());
        let (is_left, is_above) = Default::default();
        Self {
            numbers: (0..NUMBERS).map(|_| model()).collect(),
            is_left,
            is_above,
            flags: NumberModel::default(),
        }
    }
}

impl Models {
    /// Flags, predicted from those to the left, above, and above to the left.
    fn flags(&mut self, coder: &mut impl BitCoder, flags: u32, [left, above, corner]: [u32; 3]) -> u32 {
        let same = [left == above, above == corner, is_valid(left)];
        let class = same.iter().fold(0, |sum, &is| 2 * sum + usize::from(is));
        if coder.bit(&mut self.is_left[class], flags == left) {
            return left;
        }
        if above != left && coder.bit(&mut self.is_above, flags == above) {
            return above;
        }
        left ^ self.flags.magnitude(coder, flags ^ left)
    }

    /// A residual, where those around sum to `around` and another one of the vertex is `other`.
    fn residual(
        &mut self,
        coder: &mut impl BitCoder,
        number: usize,
        value: i32,
        [around, other]: [u32; 2],
    ) -> i32 {
        let surprise = match around {
            0..=2 => around as usize,
            3..=4 => 3,
            5..=6 => 4,
            7..=9 => 5,
            10..=14 => 6,
            15..=22 => 7,
            23..=40 => 8,
            _ => 9,
        };
        let other = (other as usize).min(OTHERS - 1);
        self.numbers[number][OTHERS * surprise + other].signed(coder, value)
    }
}

/// The row in work and the one above it, as integers, with how far each was from its prediction.
pub(super) struct ThinnedRows {
    thinning: Thinning,
    flags: Vec<u32>,
    flags_above: Vec<u32>,
    current: [Vec<i32>; NUMBERS],
    above: [Vec<i32>; NUMBERS],
    missed: [Vec<u32>; NUMBERS],
    missed_above: [Vec<u32>; NUMBERS],
}

impl ThinnedRows {
    pub(super) fn new(width: usize, thinning: Thinning) -> Self {
        let zeros = || std::array::from_fn(|_| vec![0; width]);
        let [missed, missed_above] = std::array::from_fn(|_| std::array::from_fn(|_| vec![0; width]));
        let [flags, flags_above] = std::array::from_fn(|_| vec![0; width]);
        Self { thinning, flags, flags_above, current: zeros(), above: zeros(), missed, missed_above }
    }

    pub(super) fn next(&mut self) {
        std::mem::swap(&mut self.current, &mut self.above);
        std::mem::swap(&mut self.missed, &mut self.missed_above);
        std::mem::swap(&mut self.flags, &mut self.flags_above);
    }

    /// Writes the row, or reads it.
    pub(super) fn code(&mut self, coder: &mut impl BitCoder, models: &mut Models) {
        let (mut left, mut corner) = (0, 0);
        for (flags, &above) in self.flags.iter_mut().zip(&self.flags_above) {
            *flags = models.flags(coder, *flags, [left, above, corner]);
            (left, corner) = (*flags, above);
        }
        for number in 0..NUMBERS {
            self.code_number(coder, models, number);
        }
    }

    fn code_number(&mut self, coder: &mut impl BitCoder, models: &mut Models, number: usize) {
        // The number of the same vertex by which this one's error is expected.
        let (before, this) = self.missed.split_at_mut(number);
        let (missed, above) = (&mut this[0], &self.missed_above[number]);
        let other = |column: usize| match number {
            1 => before[0][column] / 3,
            2 => before[1][column],
            4 => before[3][column],
            5 => before[3][column].saturating_add(before[4][column]),
            _ => 0,
        };
        let mut columns = 0..;
        let width = self.flags.len();
        let flags = &self.flags;
        predict_row(&mut self.current[number], &self.above[number], flags, |_, value, prediction| {
            let at: usize = columns.next().unwrap_or(0);
            if !is_valid(flags[at]) {
                missed[at] = 0;
                return prediction;
            }
            let left = if at > 0 { missed[at - 1] } else { 0 };
            let (corner, right) = (above[at.saturating_sub(1)], above[(at + 1).min(width - 1)]);
            let around = [left, left, above[at], above[at], corner, right];
            let around = around.iter().fold(0, |sum: u32, &v| sum.saturating_add(v));
            let residual = value.wrapping_sub(prediction);
            let residual = models.residual(coder, number, residual, [around, other(at)]);
            missed[at] = residual.unsigned_abs();
            prediction.wrapping_add(residual)
        });
    }

    /// Rounds a vertex.
    pub(super) fn set(&mut self, column: usize, vertex: &Vertex, depth_m: f32) {
        let rounded = RoundedVertex::of(self.thinning, vertex, depth_m).unwrap_or_default();
        self.flags[column] = rounded.flags;
        if rounded.is_valid() {
            for (row, number) in self.current.iter_mut().zip(rounded.numbers) {
                row[column] = number;
            }
        }
    }

    /// The vertex of rounded numbers; `None` where there is none of that depth.
    pub(super) fn vertex(&self, column: usize, ray: [f32; 3]) -> Option<Vertex> {
        let numbers: [i32; NUMBERS] = std::array::from_fn(|number| self.current[number][column]);
        RoundedVertex { flags: self.flags[column], numbers }.vertex(self.thinning, ray)
    }
}
