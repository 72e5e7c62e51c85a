//! Neighbours of a vertex along valid mesh edges, up to four rings away (SPEC 2.2).

use crate::mesh::{DIAGONAL, DOWN, RIGHT};
use crate::vertex::Grid;

/// Offsets of the six neighbours, as `(row, column)`, and how to read the edge to each.
const STEPS: [(isize, isize, u8, bool); 6] = [
    (0, 1, RIGHT, true),
    (1, 0, DOWN, true),
    (1, 1, DIAGONAL, true),
    (0, -1, RIGHT, false),
    (-1, 0, DOWN, false),
    (-1, -1, DIAGONAL, false),
];

/// Collects the vertices at graph distance `1..=rings` of `vertex`, in order of distance.
pub(crate) struct RingWalk {
    found: Vec<usize>,
    /// Stamp of the walk that last reached a vertex, so that nothing has to be cleared.
    reached: Vec<u32>,
    walk: u32,
}

impl RingWalk {
    pub(crate) fn new(grid: Grid) -> Self {
        Self { found: Vec::with_capacity(61), reached: vec![0; grid.len()], walk: 0 }
    }

    pub(crate) fn neighbours(&mut self, bits: &[u8], grid: Grid, vertex: usize, rings: u32) -> &[usize] {
        self.walk = self.walk.wrapping_add(1);
        if self.walk == 0 {
            self.reached.fill(0);
            self.walk = 1;
        }
        self.found.clear();
        self.found.push(vertex);
        self.reached[vertex] = self.walk;
        let mut ring_start = 0;
        for _ in 0..rings {
            let ring_end = self.found.len();
            for k in ring_start..ring_end {
                let from = self.found[k];
                let (row, column) = (from / grid.width, from % grid.width);
                for (dr, dc, bit, is_forward) in STEPS {
                    let (Some(r), Some(c)) = (row.checked_add_signed(dr), column.checked_add_signed(dc))
                    else {
                        continue;
                    };
                    if r >= grid.height || c >= grid.width {
                        continue;
                    }
                    let to = r * grid.width + c;
                    let edge_of = if is_forward { from } else { to };
                    if bits[edge_of] & bit != 0 && self.reached[to] != self.walk {
                        self.reached[to] = self.walk;
                        self.found.push(to);
                    }
                }
            }
            ring_start = ring_end;
        }
        &self.found[1..]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_mesh_has_6_18_36_60_neighbours_and_a_cut_stops_the_walk() {
        let grid = Grid { width: 13, height: 13, step: 1 };
        let mut bits = vec![RIGHT | DOWN | DIAGONAL; grid.len()];
        let centre = 6 * 13 + 6;
        let mut walk = RingWalk::new(grid);
        for (rings, expected) in [(1, 6), (2, 18), (3, 36), (4, 60)] {
            assert_eq!(walk.neighbours(&bits, grid, centre, rings).len(), expected);
        }
        // Cut every edge between column 6 and 7: nothing to the right is reached.
        for row in 0..13 {
            bits[row * 13 + 6] &= DOWN;
        }
        assert!(walk.neighbours(&bits, grid, centre, 4).iter().all(|v| v % 13 <= 6));
    }
}
