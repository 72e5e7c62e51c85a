//! The projective search: from the cell that sees a query down to the nearest vertex (method 10.2).

use tessera_numerics::prefetch;
use tessera_surface::{SurfaceView, Vertex};

/// The row and column of the valid vertex nearest to `q`, found by descent: the nearest of the 3x3 cells around a cell,
/// then around that one, until the middle is nearest or `reach` steps are used up, of which there is at
/// least one. Near the solution this reads nine vertices, whatever the reach.
#[inline(always)]
pub(crate) fn nearest(
    surface: &SurfaceView<'_>,
    (row, column): (usize, usize),
    reach: u32,
    q: [f32; 3],
) -> Option<(usize, usize)> {
    let (width, height) = (surface.grid.width, surface.grid.height);
    // Squared distance and place in one number: distances are not negative, so their bits order as
    // they do, and the least of these numbers needs no branch to find. A camera has fewer than 65,536
    // rows and columns.
    let mut best = u64::MAX;
    let mut look = |row: usize, column: usize| {
        let vertex = &surface.vertices[row * width + column];
        best = best.min(key(vertex, q) | ((row as u64) << 16) | column as u64);
        best
    };
    let mut middle = (row, column);
    let mut now = around(middle, (width, height), &mut look);
    for _ in 1..reach.max(1) {
        // Nothing valid here, or a distance that is not a number.
        if !is_found(now) {
            return None;
        }
        let next = place_of(now);
        if next == middle {
            break;
        }
        // One cell on: only the row and the column that came into view are new.
        let columns = [next.1.saturating_sub(1), next.1, (next.1 + 1).min(width - 1)];
        let rows = [next.0.saturating_sub(1), next.0, (next.0 + 1).min(height - 1)];
        if next.0 != middle.0 {
            let row = if next.0 > middle.0 { rows[2] } else { rows[0] };
            for column in columns {
                now = look(row, column);
            }
        }
        if next.1 != middle.1 {
            let column = if next.1 > middle.1 { columns[2] } else { columns[0] };
            for row in rows {
                now = look(row, column);
            }
        }
        middle = next;
    }
    is_found(now).then(|| place_of(now))
}

/// Row and column in the lower half of a key.
#[inline(always)]
fn place_of(key: u64) -> (usize, usize) {
    ((key as u32 >> 16) as usize, (key & 0xffff) as usize)
}

/// Asks for the cache lines that [`nearest`] reads first from this cell: of three vertices in a row,
/// half a line each, the outer two lie in all the lines there are.
#[inline(always)]
pub(crate) fn read_ahead(surface: &SurfaceView<'_>, (row, column): (usize, usize)) {
    let (width, height) = (surface.grid.width, surface.grid.height);
    for row in [row.saturating_sub(1), row, (row + 1).min(height - 1)] {
        for column in [column.saturating_sub(1), (column + 1).min(width - 1)] {
            prefetch(&surface.vertices[row * width + column]);
        }
    }
}

/// Looks at the 3x3 cells around a cell, as far as they lie in the image.
#[inline(always)]
fn around(
    middle: (usize, usize),
    (width, height): (usize, usize),
    look: &mut impl FnMut(usize, usize) -> u64,
) -> u64 {
    let columns = [middle.1.saturating_sub(1), middle.1, (middle.1 + 1).min(width - 1)];
    let mut best = u64::MAX;
    // As many rows as there are: a number that the compiler knows would have it gather all nine vertices
    // at once, which is slower than reading them.
    for row in middle.0.saturating_sub(1)..=(middle.0 + 1).min(height - 1) {
        for column in columns {
            best = look(row, column);
        }
    }
    best
}

#[inline(always)]
fn is_found(best: u64) -> bool {
    (best >> 32) as u32 <= f32::INFINITY.to_bits()
}

/// The squared distance's bits in the upper half; above all numbers where the vertex is not valid.
#[inline(always)]
fn key(v: &Vertex, q: [f32; 3]) -> u64 {
    let d = [v.position[0] - q[0], v.position[1] - q[1], v.position[2] - q[2]];
    let distance_sq = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    let invalid = (v.flags_rgb & Vertex::VALID).wrapping_sub(1);
    u64::from(distance_sq.to_bits() | invalid) << 32
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_numerics::SplitMix64;
    use tessera_surface::Grid;

    /// The descent with all 3x3 cells read again around each middle, those beyond the image being its
    /// border.
    fn nearest_by_all_cells(
        surface: &SurfaceView<'_>,
        mut middle: (usize, usize),
        reach: u32,
        q: [f32; 3],
    ) -> Option<(usize, usize)> {
        let (width, height) = (surface.grid.width, surface.grid.height);
        let mut best = u64::MAX;
        for _ in 0..reach.max(1) {
            for row in [middle.0.saturating_sub(1), middle.0, (middle.0 + 1).min(height - 1)] {
                for column in [middle.1.saturating_sub(1), middle.1, (middle.1 + 1).min(width - 1)] {
                    let vertex = &surface.vertices[row * width + column];
                    best = best.min(key(vertex, q) | ((row as u64) << 16) | column as u64);
                }
            }
            if !is_found(best) {
                return None;
            }
            middle = place_of(best);
        }
        Some(middle)
    }

    #[test]
    fn the_descent_finds_what_reading_all_cells_finds() {
        let mut random = SplitMix64::for_frame(7, 5);
        for (width, height) in [(1, 1), (2, 1), (1, 3), (2, 2), (9, 7), (30, 20)] {
            let grid = Grid { width, height, step: 4 };
            let vertices: Vec<Vertex> = (0..grid.len())
                .map(|i| Vertex {
                    // Steps of a centimetre about a wall: equal distances do occur.
                    position: [(i % width) as f32, (i / width) as f32, random.below(30) as f32]
                        .map(|c| 0.01 * c),
                    flags_rgb: Vertex::pack(if random.below(4) == 0 { 0 } else { Vertex::VALID }, 0, [0; 3]),
                    ..Vertex::default()
                })
                .collect();
            let surface = SurfaceView { grid, vertices: &vertices };
            for row in 0..height {
                for column in 0..width {
                    let q = [random.below(width), random.below(height), random.below(30)]
                        .map(|c| 0.01 * c as f32);
                    for reach in 0..5 {
                        let expected = nearest_by_all_cells(&surface, (row, column), reach, q);
                        let found = nearest(&surface, (row, column), reach, q);
                        assert_eq!(found, expected, "{width}x{height} at {row}, {column}, reach {reach}");
                    }
                }
            }
        }
    }
}
