//! Corners of one level: local maxima of the score, above a lower threshold in cells without any.

use crate::fast::{RUN, ScoreRow, score_row, suppress};
use crate::pyramid::Plane;
use std::ops::Range;
use tessera_numerics::{Bits, WORD};

/// Pixels around a corner that its descriptor reads: no corner is nearer to the border.
pub(crate) const MARGIN: usize = 18;

/// A local maximum of the corner score.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Corner {
    pub(crate) row: u16,
    pub(crate) column: u16,
    pub(crate) score: u8,
    /// Cell of the image, row by row.
    pub(crate) cell: u32,
    /// Scores left, right, above and below.
    pub(crate) around: [u8; 4],
}

impl Corner {
    /// Place in reading order.
    pub(crate) fn place(&self) -> (u16, u16) {
        (self.row, self.column)
    }

    /// Row and column of the maximum of the parabolas through the scores around.
    pub(crate) fn sub_pixel(&self) -> [f32; 2] {
        let [left, right, above, below] = self.around.map(f32::from);
        let peak = f32::from(self.score);
        let offset = |before: f32, after: f32| {
            let curvature = 2.0 * peak - before - after;
            if curvature > 0.0 { 0.5 * (after - before) / curvature } else { 0.0 }
        };
        [f32::from(self.row) + offset(above, below), f32::from(self.column) + offset(left, right)]
    }
}

/// Buffers: three rows of scores, of which the middle one is searched.
#[derive(Clone, Debug, Default)]
pub(crate) struct ScoreRows {
    rows: [ScoreRow; 3],
    /// Whether a cell has a corner above the threshold.
    is_taken: Vec<bool>,
}

/// Square cells over a level.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CellGrid {
    cell_px: usize,
    pub(crate) columns: usize,
    pub(crate) rows: usize,
}

impl CellGrid {
    pub(crate) fn new(width: usize, height: usize, cell_px: usize) -> Self {
        Self { cell_px, columns: width.div_ceil(cell_px), rows: height.div_ceil(cell_px) }
    }

    pub(crate) fn n_cells(&self) -> usize {
        self.columns * self.rows
    }

    /// Rows or columns of `n` cells from one on, inside `all`.
    fn pixels(&self, first: usize, n: usize, all: &Range<usize>) -> Range<usize> {
        (first * self.cell_px).max(all.start)..((first + n) * self.cell_px).min(all.end)
    }

    #[inline(always)]
    fn cell(&self, row: usize, column: usize) -> u32 {
        // 32 bits divide faster than 64.
        let cell_px = self.cell_px as u32;
        row as u32 / cell_px * self.columns as u32 + column as u32 / cell_px
    }
}

/// Region where corners can be.
#[derive(Clone, Debug)]
struct ImagePart {
    rows: Range<usize>,
    columns: Range<usize>,
}

/// Replaces `corners` by those above `threshold`, and those above `low` in cells without any.
#[inline(always)]
pub(crate) fn detect(
    plane: &Plane,
    grid: &CellGrid,
    [threshold, low]: [u8; 2],
    scores: &mut ScoreRows,
    corners: &mut Vec<Corner>,
) {
    corners.clear();
    let &Plane { width, height, .. } = plane;
    if width <= 2 * MARGIN || height <= 2 * MARGIN {
        return;
    }
    scores.rows.iter_mut().for_each(|row| row.scores.resize(width + 2 * RUN, 0));
    let all = ImagePart { rows: MARGIN..height - MARGIN, columns: MARGIN..width - MARGIN };
    scan(plane, grid, &all, threshold, &mut scores.rows, corners);
    scores.is_taken.clear();
    scores.is_taken.resize(grid.n_cells(), low >= threshold);
    corners.iter().for_each(|corner| scores.is_taken[corner.cell as usize] = true);
    for row in 0..grid.rows {
        let mut first = 0;
        while first < grid.columns {
            // Neighbouring cells without a corner are scanned together.
            let is_taken = &scores.is_taken[row * grid.columns..][first..grid.columns];
            let n_empty = is_taken.iter().take_while(|&&is_taken| !is_taken).count();
            let part = ImagePart {
                rows: grid.pixels(row, 1, &all.rows),
                columns: grid.pixels(first, n_empty, &all.columns),
            };
            scan(plane, grid, &part, low, &mut scores.rows, corners);
            first += n_empty + 1;
        }
    }
}

/// Adds the local maxima above `floor` of a part of the image, in reading order.
#[inline(always)]
fn scan(
    plane: &Plane,
    grid: &CellGrid,
    part: &ImagePart,
    floor: u8,
    score_rows: &mut [ScoreRow; 3],
    corners: &mut Vec<Corner>,
) {
    if part.rows.is_empty() || part.columns.is_empty() {
        return;
    }
    let columns = part.columns.start - 1..part.columns.end + 1;
    let [above, middle, below] = score_rows;
    for row in part.rows.start - 1..part.rows.end + 1 {
        std::mem::swap(above, middle);
        std::mem::swap(middle, below);
        score_row(&plane.pixels, plane.width, row, columns.clone(), floor, below);
        if row > part.rows.start {
            maxima([above, middle, below], grid, row - 1, &part.columns, floor, corners);
        }
    }
}

#[inline(always)]
fn maxima(
    rows: [&ScoreRow; 3],
    grid: &CellGrid,
    row: usize,
    columns: &Range<usize>,
    floor: u8,
    corners: &mut Vec<Corner>,
) {
    let [above, middle, below] = rows.map(|row| &row.scores[..]);
    let runs = rows[1]
        .runs
        .iter()
        .enumerate()
        .flat_map(|(word, bits)| Bits(*bits).map(move |bit| word * WORD + bit));
    for run in runs {
        let first = columns.start - 1 + run * RUN;
        let kept = suppress([above, middle, below], first, floor);
        // Most runs with a score have no maximum.
        if kept.iter().fold(0, |any, &score| any | score) == 0 {
            continue;
        }
        for (word, bytes) in kept.as_chunks().0.iter().enumerate() {
            let mut bits = u64::from_le_bytes(*bytes);
            while bits != 0 {
                let byte = bits.trailing_zeros() as usize / 8;
                bits &= !(0xff << (8 * byte));
                let column = first + 8 * word + byte;
                if columns.contains(&column) {
                    corners.push(Corner {
                        row: row as u16,
                        column: column as u16,
                        score: middle[column],
                        cell: grid.cell(row, column),
                        around: [middle[column - 1], middle[column + 1], above[column], below[column]],
                    });
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_numerics::SplitMix64;

    fn detected(plane: &Plane, cell_px: usize, thresholds: [u8; 2]) -> Vec<Corner> {
        let grid = CellGrid::new(plane.width, plane.height, cell_px);
        let (mut scores, mut corners) = (ScoreRows::default(), Vec::new());
        detect(plane, &grid, thresholds, &mut scores, &mut corners);
        corners
    }

    /// Left half of high contrast, right half of low contrast.
    fn plane() -> Plane {
        let mut random = SplitMix64::new(2);
        let (width, height) = (200, 120);
        let mut blocks = [0; 50 * 30];
        blocks.iter_mut().for_each(|value| *value = random.below(256));
        let value = |i: usize| {
            let (row, column) = (i / width, i % width);
            let value = blocks[row / 4 * 50 + column / 4];
            (if column < 96 { value } else { 100 + value / 16 }) as u8
        };
        Plane { width, height, pixels: (0..width * height).map(value).collect() }
    }

    #[test]
    fn weak_corners_stay_only_where_there_is_nothing_better() {
        let plane = plane();
        let (strong, both) = (detected(&plane, 32, [20, 20]), detected(&plane, 32, [20, 5]));
        assert!(strong.len() > 50 && strong.iter().all(|c| c.column < 103 && c.score > 20));
        let places = |corners: &[Corner]| -> Vec<_> { corners.iter().map(|c| (c.row, c.column)).collect() };
        assert_eq!(places(&both)[..strong.len()], places(&strong));
        let weak = &both[strong.len()..];
        assert!(weak.len() > 50 && weak.iter().all(|c| c.score > 5 && c.score <= 20));
        assert!(weak.iter().all(|w| strong.iter().all(|s| s.cell != w.cell)));
        // The whole image at the low threshold has the same ones.
        let all = places(&detected(&plane, 32, [5, 5]));
        assert!(places(weak).iter().all(|place| all.contains(place)));
    }

    #[test]
    fn the_peak_of_the_parabola_is_between_pixels() {
        let around = [10, 30, 20, 20];
        let corner = Corner { row: 9, column: 7, score: 40, cell: 0, around };
        assert_eq!(corner.sub_pixel(), [9.0, 7.25]);
    }
}
