//! Neighbours of a vertex along valid mesh edges, up to four rings away (method 2.2).

use crate::planes::{PlaneLayout, QuadMesh};

/// Collects the vertices at graph distance `1..=rings` of one, in order of distance.
pub(crate) struct RingWalk {
    found: Vec<usize>,
    /// Stamp of the walk that last reached a vertex, so that nothing has to be cleared.
    reached: Vec<u32>,
    walk: u32,
}

impl RingWalk {
    pub(crate) fn new(layout: PlaneLayout) -> Self {
        Self { found: Vec::with_capacity(61), reached: vec![0; layout.len()], walk: 0 }
    }

    /// Places in padded planes; `vertex` is one too.
    pub(crate) fn neighbours(
        &mut self,
        mesh: &QuadMesh,
        stride: usize,
        vertex: usize,
        rings: u32,
    ) -> &[usize] {
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
                // Backward edges are kept by the neighbour they come from.
                let steps = [
                    (from + 1, mesh.right[from]),
                    (from + stride, mesh.down[from]),
                    (from + stride + 1, mesh.diagonal[from]),
                    (from - 1, mesh.right[from - 1]),
                    (from - stride, mesh.down[from - stride]),
                    (from - stride - 1, mesh.diagonal[from - stride - 1]),
                ];
                for (to, edge) in steps {
                    if edge > 0.0 && self.reached[to] != self.walk {
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
    use crate::planes::Workspace;
    use crate::vertex::Grid;

    #[test]
    fn a_full_mesh_has_6_18_36_60_neighbours_and_a_cut_stops_the_walk() {
        let mut w = Workspace::new(Grid { width: 13, height: 13, step: 1 });
        let layout = w.layout;
        for row in 0..13 {
            for column in 0..13 {
                let i = layout.row(row) + column;
                w.mesh.right[i] = f32::from(u8::from(column < 12));
                w.mesh.down[i] = f32::from(u8::from(row < 12));
                w.mesh.diagonal[i] = w.mesh.right[i] * w.mesh.down[i];
            }
        }
        let centre = layout.row(6) + 6;
        let mut walk = RingWalk::new(layout);
        for (rings, expected) in [(1, 6), (2, 18), (3, 36), (4, 60)] {
            assert_eq!(walk.neighbours(&w.mesh, layout.stride, centre, rings).len(), expected);
        }
        // Cut every edge between columns 6 and 7: nothing to the right is reached.
        for row in 0..13 {
            w.mesh.right[layout.row(row) + 6] = 0.0;
            w.mesh.diagonal[layout.row(row) + 6] = 0.0;
        }
        let column = |i: usize| i % layout.stride - 1;
        assert!(walk.neighbours(&w.mesh, layout.stride, centre, 4).iter().all(|&v| column(v) <= 6));
    }
}
