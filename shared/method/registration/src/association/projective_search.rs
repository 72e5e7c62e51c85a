//! Projection of queries into the target's grid, many at once.

use crate::association::columns::Columns3;
use crate::association::projection::GridCamera;
use crate::association::target::ShutterTable;
use tessera_numerics::lanes::transform;

/// Queries of one run moved into the target's frame, and the cells that see them.
#[derive(Debug, Default)]
pub(crate) struct Located {
    /// Query in the target's frame at its stamp.
    pub(crate) q: Columns3,
    /// Query in the frame of the target row that saw it: there the target's vertices are compared.
    pub(crate) q_row: Columns3,
    /// Row and column of the cell that sees it, in the upper and lower half: a camera has fewer than 65,536; [`UNSEEN`]
    /// outside the image.
    cells: Vec<u32>,
}

/// No cell.
const UNSEEN: u32 = u32::MAX;

impl Located {
    pub(crate) fn resize(&mut self, n: usize) {
        self.q.resize(n);
        self.q_row.resize(n);
        self.cells.resize(n, UNSEEN);
    }

    /// Fills the first `x.len()` places from query points given by coordinate.
    #[inline(always)]
    pub(crate) fn fill(&mut self, seen_by: &SeenBy<'_>, points: [&[f32]; 3]) {
        if seen_by.shutter.is_global() {
            self.fill_runs::<false>(seen_by, points);
        } else {
            self.fill_runs::<true>(seen_by, points);
        }
    }

    #[inline(always)]
    fn fill_runs<const IS_ROLLING: bool>(&mut self, seen_by: &SeenBy<'_>, [x, y, z]: [&[f32]; 3]) {
        let (mut run, mut cells) = ([[0.0; RUN]; 6], [UNSEEN; RUN]);
        for from in (0..x.len()).step_by(RUN) {
            let to = x.len().min(from + RUN);
            locate::<IS_ROLLING>(seen_by, [&x[from..to], &y[from..to], &z[from..to]], &mut run, &mut cells);
            let [qx, qy, qz, rx, ry, rz] = &run;
            self.cells[from..to].copy_from_slice(&cells[..to - from]);
            for (column, found) in [
                (&mut self.q.x, qx),
                (&mut self.q.y, qy),
                (&mut self.q.z, qz),
                (&mut self.q_row.x, rx),
                (&mut self.q_row.y, ry),
                (&mut self.q_row.z, rz),
            ] {
                column[from..to].copy_from_slice(&found[..to - from]);
            }
        }
    }

    /// The cell that sees a query; `None` outside the image.
    #[inline(always)]
    pub(crate) fn cell(&self, place: usize) -> Option<(usize, usize)> {
        let cell = self.cells[place];
        (cell != UNSEEN).then_some(((cell >> 16) as usize, (cell & 0xffff) as usize))
    }
}

/// The target as a camera: where it was, and how it reads out.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SeenBy<'a> {
    pub(crate) camera: GridCamera,
    /// Rotation row by row, then translation.
    pub(crate) target_from_query: &'a [f32; 12],
    pub(crate) shutter: ShutterTable,
}

/// Queries that are located at a time. Their coordinates are put down in one array of a fixed
/// size first: columns of their own might overlap for all that the compiler knows, and it would
/// handle one query at a time.
const RUN: usize = 64;

#[inline(always)]
fn locate<const IS_ROLLING: bool>(
    seen_by: &SeenBy<'_>,
    [x, y, z]: [&[f32]; 3],
    run: &mut [[f32; RUN]; 6],
    cells: &mut [u32; RUN],
) {
    let SeenBy { camera, target_from_query, shutter } = *seen_by;
    let n = x.len().min(RUN);
    let (height, width) = (camera.grid.height as f32, camera.grid.width as f32);
    let (y, z) = (&y[..n], &z[..n]);
    for k in 0..n {
        let q = transform(target_from_query, [x[k], y[k], z[k]]);
        let mut seen = camera.project(q);
        let mut q_row = q;
        if IS_ROLLING {
            // Two fixed-point steps find the row whose exposure saw the point (method 1.6).
            q_row = shutter.move_point(q, -shutter.row_time_s(seen.0));
            seen = camera.project(q_row);
            q_row = shutter.move_point(q, -shutter.row_time_s(seen.0));
            seen = camera.project(q_row);
        }
        for (column, value) in run.iter_mut().zip([q[0], q[1], q[2], q_row[0], q_row[1], q_row[2]]) {
            column[k] = value;
        }
        // Rounded, not truncated (method T11).
        let (row, column) = (seen.0 + 0.5, seen.1 + 0.5);
        let is_inside = (row >= 0.0) & (column >= 0.0) & (row < height) & (column < width);
        let cell = (row as i32) << 16 | column as i32;
        cells[k] = if is_inside { cell as u32 } else { UNSEEN };
    }
}
