//! Rows of rounded vertices through Rice codes, each number predicted from the vertices to the left and above.

use super::rounded::{ALL_FLAGS, NUMBERS, Rounded, has};
use crate::vertex::Vertex;
use tessera_numerics::{RiceReader, RiceWriter, unzigzag, zigzag};

/// Flag of a vertex that is known before its row is read.
const KNOWN: u32 = ALL_FLAGS + 1;

/// The row in work and the one above it.
pub(super) struct RoundedRows {
    current: Rounded,
    above: Rounded,
    codes: Vec<u32>,
}

impl RoundedRows {
    pub(super) fn new(width: usize) -> Self {
        Self { current: Rounded::new(width), above: Rounded::new(width), codes: vec![0; width] }
    }

    /// Begins a row, of which nothing is known.
    pub(super) fn next(&mut self) {
        std::mem::swap(&mut self.current, &mut self.above);
        self.current.flags.fill(0);
    }

    /// The row in work.
    pub(super) fn current(&self) -> &Rounded {
        &self.current
    }

    /// Rounds the vertices of the row.
    pub(super) fn set<'a>(&mut self, vertices: impl ExactSizeIterator<Item = &'a Vertex>) {
        self.current.set_all(vertices);
    }

    /// Makes known what others have: at each `step`-th column from `first` on, those behind `from`, `n` of them.
    pub(super) fn know(
        &mut self,
        (first, step): (usize, usize),
        others: &Rounded,
        (from, n): (usize, usize),
    ) {
        let columns = || (first..).step_by(step);
        for (column, flags) in columns().zip(&others.flags[from..from + n]) {
            self.current.flags[column] = flags | KNOWN;
        }
        for (row, other) in self.current.numbers.iter_mut().zip(&others.numbers) {
            columns().zip(&other[from..from + n]).for_each(|(column, number)| row[column] = *number);
        }
    }

    /// Writes the vertices of the row that are not known.
    pub(super) fn write(&mut self, writer: &mut RiceWriter) {
        let mut codes = std::mem::take(&mut self.codes);
        codes.clear();
        let mut left = 0;
        for &flags in &self.current.flags {
            if !has(flags, KNOWN) {
                codes.push(flags ^ left);
            }
            left = flags & ALL_FLAGS;
        }
        writer.row(&codes);
        for number in 0..NUMBERS.len() {
            self.residuals(number, &mut codes);
            writer.row(&codes);
        }
        self.codes = codes;
    }

    /// Reads the vertices of the row that are not known; `None` where there is no code.
    pub(super) fn read(&mut self, reader: &mut RiceReader) -> Option<()> {
        let mut codes = std::mem::take(&mut self.codes);
        codes.resize(self.current.flags.len(), 0);
        let n_unknown = self.n_to_code(0);
        reader.row(&mut codes[..n_unknown])?;
        let (mut left, mut changes) = (0, codes[..n_unknown].iter());
        for flags in &mut self.current.flags {
            if !has(*flags, KNOWN) {
                *flags = (left ^ changes.next()?) & ALL_FLAGS;
            }
            left = *flags & ALL_FLAGS;
        }
        for (number, &flag) in NUMBERS.iter().enumerate() {
            let n = self.n_to_code(flag);
            reader.row(&mut codes[..n])?;
            let mut residuals = codes[..n].iter();
            self.complete(number, |prediction| {
                prediction.wrapping_add(residuals.next().map_or(0, |&code| unzigzag(code)))
            });
        }
        self.codes = codes;
        Some(())
    }

    /// How many vertices that are not known have a flag.
    fn n_to_code(&self, flag: u32) -> usize {
        self.current.flags.iter().filter(|&&flags| is_coded(flags, flag)).count()
    }

    /// Codes of one number of the vertices to be written. All values being there, none waits for the one before
    /// it, as it does where they are read.
    fn residuals(&mut self, number: usize, codes: &mut Vec<u32>) {
        let Self { current: Rounded { flags, numbers }, above, .. } = self;
        let (flag, values, above) = (NUMBERS[number], &mut numbers[number], &above.numbers[number]);
        if flag != 0 {
            let is_missing = |flags: u32| !has(flags, flag) && !has(flags, KNOWN);
            for column in (0..values.len()).filter(|column| is_missing(flags[*column])) {
                values[column] = match column {
                    0 => above[0],
                    _ => predicted(values[column - 1], above[column], above[column - 1]),
                };
            }
        }
        codes.clear();
        codes.push(zigzag(values[0].wrapping_sub(above[0])));
        codes.extend(
            values.windows(2).zip(above.windows(2)).map(|(values, above)| {
                zigzag(values[1].wrapping_sub(predicted(values[0], above[1], above[0])))
            }),
        );
        let mut n = 0;
        for (column, &flags) in flags.iter().enumerate() {
            codes[n] = codes[column];
            n += usize::from(is_coded(flags, flag));
        }
        codes.truncate(n);
    }

    /// Completes the row of one number: what is known stays, what is coded becomes what `value_of` makes of its
    /// prediction, and the rest is its prediction.
    #[inline]
    fn complete(&mut self, number: usize, mut value_of: impl FnMut(i32) -> i32) {
        let flag = NUMBERS[number];
        let Self { current, above, .. } = self;
        let value_of = |flags, value, prediction| {
            if is_coded(flags, flag) {
                value_of(prediction)
            } else if has(flags, KNOWN) {
                value
            } else {
                prediction
            }
        };
        predict_row(&mut current.numbers[number], &above.numbers[number], &current.flags, value_of);
    }
}

/// Whether the number of a flag is coded: the vertex has it, and is not known.
#[inline]
fn is_coded(flags: u32, flag: u32) -> bool {
    flags & (flag | KNOWN) == flag
}

/// The median of the left value, the one above, and the plane through both and the one between them (Weinberger,
/// Seroussi and Sapiro, "LOCO-I", 1996).
#[inline]
fn predicted(left: i32, above: i32, above_left: i32) -> i32 {
    let plane = left.wrapping_add(above).wrapping_sub(above_left);
    plane.clamp(left.min(above), left.max(above))
}

/// Walks over a row: each value becomes what `value_of` makes of its flags, of itself, and of its prediction.
#[inline]
fn predict_row(
    current: &mut [i32],
    above: &[i32],
    flags: &[u32],
    mut value_of: impl FnMut(u32, i32, i32) -> i32,
) {
    let (mut left, mut above_left) = (above[0], above[0]);
    for ((value, &above), &flags) in current.iter_mut().zip(above).zip(flags) {
        *value = value_of(flags, *value, predicted(left, above, above_left));
        (left, above_left) = (*value, above);
    }
}
