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
        let Self { current: Rounded { flags, numbers }, above, codes } = self;
        codes.resize(flags.iter().filter(|flags| is_coded(**flags, 0)).count(), 0);
        reader.row(codes)?;
        let (mut left, mut changes) = (0, codes.iter());
        for flags in flags.iter_mut() {
            if !has(*flags, KNOWN) {
                *flags = (left ^ changes.next()?) & ALL_FLAGS;
            }
            left = *flags & ALL_FLAGS;
        }
        let ([x, y, z, u, v, r, g, b], above) = (numbers, &above.numbers);
        let mut rest = Rest { reader, flags, codes };
        rest.complete(NUMBERS[0], [x, y, z], [&above[0], &above[1], &above[2]])?;
        rest.complete(NUMBERS[3], [u, v], [&above[3], &above[4]])?;
        rest.complete(NUMBERS[5], [r, g, b], [&above[5], &above[6], &above[7]])
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
}

/// What is left to read of a row whose flags are known.
struct Rest<'a, 'b> {
    reader: &'a mut RiceReader<'b>,
    flags: &'a [u32],
    codes: &'a mut Vec<u32>,
}

impl Rest<'_, '_> {
    /// Completes the rows of numbers with one flag: what is known stays, what is coded is its prediction and the
    /// residual that is read, and the rest is its prediction. Each prediction waits for the value before it, so the
    /// numbers go together.
    fn complete<const N: usize>(
        &mut self,
        flag: u32,
        values: [&mut Vec<i32>; N],
        above: [&Vec<i32>; N],
    ) -> Option<()> {
        let Self { reader, flags, codes } = self;
        let n = flags.iter().filter(|flags| is_coded(**flags, flag)).count();
        codes.resize(N * n, 0);
        for number in 0..N {
            reader.row(&mut codes[number * n..][..n])?;
        }
        let residuals: [&[u32]; N] = std::array::from_fn(|number| &codes[number * n..][..n]);
        let values = values.map(|row| &mut row[..flags.len()]);
        let above = above.map(|row| &row[..flags.len()]);
        let (mut left, mut above_left, mut next) = (above.map(|row| row[0]), above.map(|row| row[0]), 0);
        for (column, &flags) in flags.iter().enumerate() {
            let (is_coded, is_known) = (is_coded(flags, flag), has(flags, KNOWN));
            for number in 0..N {
                let here = above[number][column];
                let mut value = predicted(left[number], here, above_left[number]);
                if is_coded {
                    value = value.wrapping_add(unzigzag(residuals[number][next]));
                } else if is_known {
                    value = values[number][column];
                }
                values[number][column] = value;
                (left[number], above_left[number]) = (value, here);
            }
            next += usize::from(is_coded);
        }
        Some(())
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
