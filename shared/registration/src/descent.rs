//! The projective search: from the cell that sees a query down to the nearest vertex (SPEC 10.2).

use tessera_surface::{SurfaceView, Vertex};

/// How far a descent goes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    /// Steps, at least one.
    pub(crate) steps: u32,
    /// Cells between neighbours in the first step: a power of two, halved when the middle is
    /// nearest, from coarse to fine.
    pub(crate) stride: usize,
}

/// The valid vertex nearest to `q`, found by descent: the nearest of the 3x3 cells around a cell,
/// then around that one, until the middle is nearest at stride 1 or the steps are used up. Near the
/// solution this reads nine vertices, whatever the reach.
#[inline(always)]
pub(crate) fn nearest(
    surface: &SurfaceView<'_>,
    (row, column): (usize, usize),
    reach: Reach,
    q: [f32; 3],
) -> Option<usize> {
    let grid = surface.grid;
    // Squared distance and place in one number: distances are not negative, so their bits order as
    // they do, and the least of these numbers needs no branch to find.
    let mut best = u64::MAX;
    let mut middle = (row, column);
    let mut stride = reach.stride;
    for _ in 0..reach.steps.max(1) {
        let columns = [middle.1.saturating_sub(stride), middle.1, (middle.1 + stride).min(grid.width - 1)];
        let rows = [middle.0.saturating_sub(stride), middle.0, (middle.0 + stride).min(grid.height - 1)];
        for r in rows {
            for c in columns {
                let at = r * grid.width + c;
                best = best.min(key(&surface.vertices[at], q) | at as u64);
            }
        }
        // Nothing valid here, or a distance that is no number.
        if (best >> 32) as u32 > f32::INFINITY.to_bits() {
            return None;
        }
        let vertex = best as u32 as usize;
        if vertex == middle.0 * grid.width + middle.1 {
            if stride == 1 {
                break;
            }
            stride /= 2;
        }
        middle = (vertex / grid.width, vertex % grid.width);
    }
    Some(best as u32 as usize)
}

/// The squared distance's bits in the upper half; above all numbers where the vertex is not valid.
#[inline(always)]
fn key(v: &Vertex, q: [f32; 3]) -> u64 {
    let d = [v.position[0] - q[0], v.position[1] - q[1], v.position[2] - q[2]];
    let distance_sq = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    let invalid = (v.flags_rgb & Vertex::VALID).wrapping_sub(1);
    u64::from(distance_sq.to_bits() | invalid) << 32
}
