//! The vertices that come first: each third one of each third row, and those beside them that a caller names.

use super::FIRST_SPACING;
use super::rounded::{ALL_FLAGS, NUMBERS, Rounded, has};
use super::rows::RoundedRows;
use crate::vertex::{Grid, Vertex};
use tessera_numerics::{RiceReader, RiceWriter, unzigzag, zigzag};

const SPACING: usize = FIRST_SPACING as usize;

/// The first vertices of a surface.
pub struct FirstVertices {
    grid: Grid,
    /// Vertices in a row of the spaced ones.
    width: usize,
    spaced: Rounded,
    /// Places of those beside, rising.
    places: Vec<usize>,
    beside: Rounded,
}

impl FirstVertices {
    fn new(grid: Grid, beside: &[usize]) -> Self {
        let (width, height) = (grid.width.div_ceil(SPACING), grid.height.div_ceil(SPACING));
        let is_beside = |place: &usize| *place < grid.len() && !is_spaced(grid, *place);
        let mut places: Vec<usize> = beside.iter().copied().filter(is_beside).collect();
        places.sort_unstable();
        places.dedup();
        let (spaced, beside) = (Rounded::new(width * height), Rounded::new(places.len()));
        Self { grid, width, spaced, places, beside }
    }

    /// Writes those of a whole grid; of the others nothing is asked.
    pub(super) fn write(
        writer: &mut RiceWriter,
        grid: Grid,
        vertex_at: &impl Fn(usize) -> Vertex,
        beside: &[usize],
    ) -> Self {
        let mut first = Self::new(grid, beside);
        let (mut rows, mut line) = (RoundedRows::new(first.width), Vec::with_capacity(first.width));
        for (row, begin) in (0..grid.len()).step_by(SPACING * grid.width).enumerate() {
            rows.next();
            line.clear();
            line.extend((begin..begin + grid.width).step_by(SPACING).map(vertex_at));
            rows.set(line.iter());
            rows.write(writer);
            first.take(row, rows.current());
        }
        first.write_beside(writer, vertex_at);
        first
    }

    pub(super) fn grid(&self) -> Grid {
        self.grid
    }

    /// Places of those beside, rising.
    pub(super) fn places(&self) -> &[usize] {
        &self.places
    }

    /// Reads them; `None` where the bytes are none of this grid.
    pub(super) fn read(reader: &mut RiceReader, grid: Grid, beside: &[usize]) -> Option<Self> {
        let mut first = Self::new(grid, beside);
        let mut rows = RoundedRows::new(first.width);
        for row in 0..grid.height.div_ceil(SPACING) {
            rows.next();
            rows.read(reader)?;
            first.take(row, rows.current());
        }
        first.read_beside(reader)?;
        Some(first)
    }

    fn take(&mut self, row: usize, line: &Rounded) {
        let at = row * self.width..(row + 1) * self.width;
        self.spaced.flags[at.clone()].copy_from_slice(&line.flags);
        for (all, line) in self.spaced.numbers.iter_mut().zip(&line.numbers) {
            all[at.clone()].copy_from_slice(line);
        }
    }

    /// Those beside are told by what differs from the nearest spaced one.
    fn write_beside(&mut self, writer: &mut RiceWriter, vertex_at: &impl Fn(usize) -> Vertex) {
        let nearest = self.nearest();
        let vertices: Vec<Vertex> = self.places.iter().copied().map(vertex_at).collect();
        self.beside.set_all(vertices.iter());
        let flags = self.beside.flags.iter().zip(&nearest);
        let mut codes: Vec<u32> = flags.map(|(flags, near)| flags ^ self.spaced.flags[*near]).collect();
        writer.row(&codes);
        for (number, &flag) in NUMBERS.iter().enumerate() {
            codes.clear();
            self.each_beside(&nearest, (number, flag), |value, near| {
                codes.push(zigzag(value.wrapping_sub(near)));
                value
            });
            writer.row(&codes);
        }
    }

    fn read_beside(&mut self, reader: &mut RiceReader) -> Option<()> {
        let nearest = self.nearest();
        let mut codes = vec![0; self.places.len()];
        reader.row(&mut codes)?;
        for ((flags, code), near) in self.beside.flags.iter_mut().zip(&codes).zip(&nearest) {
            *flags = (self.spaced.flags[*near] ^ code) & ALL_FLAGS;
        }
        for (number, &flag) in NUMBERS.iter().enumerate() {
            let n = self.beside.flags.iter().filter(|&&flags| has(flags, flag)).count();
            reader.row(&mut codes[..n])?;
            let mut residuals = codes[..n].iter();
            self.each_beside(&nearest, (number, flag), |_, near| {
                near.wrapping_add(residuals.next().map_or(0, |&code| unzigzag(code)))
            });
        }
        Some(())
    }

    /// The spaced vertex nearest to each one beside.
    fn nearest(&self) -> Vec<usize> {
        let Self { grid, width, .. } = *self;
        let height = grid.height.div_ceil(SPACING);
        let nearest = |at: usize, n: usize| ((at + SPACING / 2) / SPACING).min(n - 1);
        let of =
            |place: &usize| nearest(place / grid.width, height) * width + nearest(place % grid.width, width);
        self.places.iter().map(of).collect()
    }

    /// A number of those beside: with its flag it becomes what `value_of` makes of it and of the nearest one's,
    /// elsewhere the nearest one's.
    fn each_beside(
        &mut self,
        nearest: &[usize],
        (number, flag): (usize, u32),
        mut value_of: impl FnMut(i32, i32) -> i32,
    ) {
        let values = self.beside.numbers[number].iter_mut().zip(&self.beside.flags).zip(nearest);
        for ((value, flags), near) in values {
            let near = self.spaced.numbers[number][*near];
            *value = if has(*flags, flag) { value_of(*value, near) } else { near };
        }
    }

    /// Makes those of a row known to it.
    pub(super) fn put(&self, row: usize, rows: &mut RoundedRows) {
        if row.is_multiple_of(SPACING) {
            rows.know((0, SPACING), &self.spaced, (row / SPACING * self.width, self.width));
        }
        let begin = row * self.grid.width;
        let before = |place: usize| self.places.partition_point(|at| *at < place);
        for at in before(begin)..before(begin + self.grid.width) {
            rows.know((self.places[at] - begin, 1), &self.beside, (at, 1));
        }
    }

    /// The vertex at a place of the grid; the default where it is none of the first ones.
    pub fn vertex(&self, place: usize) -> Vertex {
        if is_spaced(self.grid, place) {
            let (row, column) = (place / self.grid.width / SPACING, place % self.grid.width / SPACING);
            let at = row * self.width + column;
            return if at < self.spaced.flags.len() { self.spaced.vertex(at) } else { Vertex::default() };
        }
        self.places.binary_search(&place).map_or_else(|_| Vertex::default(), |at| self.beside.vertex(at))
    }
}

fn is_spaced(grid: Grid, place: usize) -> bool {
    (place / grid.width).is_multiple_of(SPACING) && (place % grid.width).is_multiple_of(SPACING)
}
