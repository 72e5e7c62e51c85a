//! Where queries fall in the target's grid, many at once.

use crate::columns::Columns3;
use crate::lanes::transform;
use crate::projection::GridCamera;
use crate::target::ShutterTable;
use tessera_surface::Grid;

/// Queries of one run moved into the target's frame, and the cells that see them.
#[derive(Debug, Default)]
pub(crate) struct Located {
    /// Query in the target's frame at its stamp.
    pub(crate) q: Columns3,
    /// Query in the frame of the target row that saw it: there the target's vertices are compared.
    pub(crate) q_row: Columns3,
    /// Fractional place in the grid; negative where it is not seen.
    pub(crate) row: Vec<f32>,
    pub(crate) column: Vec<f32>,
}

impl Located {
    pub(crate) fn resize(&mut self, n: usize) {
        self.q.resize(n);
        self.q_row.resize(n);
        self.row.resize(n, 0.0);
        self.column.resize(n, 0.0);
    }

    /// Fills the first `x.len()` places from query points given by coordinate.
    #[inline(always)]
    pub(crate) fn fill(
        &mut self,
        camera: GridCamera,
        target_from_query: &[f32; 12],
        shutter: ShutterTable,
        [x, y, z]: [&[f32]; 3],
    ) {
        let n = x.len();
        let q = [&mut self.q.x[..n], &mut self.q.y[..n], &mut self.q.z[..n]];
        let q_row = [&mut self.q_row.x[..n], &mut self.q_row.y[..n], &mut self.q_row.z[..n]];
        let place = [&mut self.row[..n], &mut self.column[..n]];
        let (y, z) = (&y[..n], &z[..n]);
        let [qx, qy, qz] = q;
        let [rx, ry, rz] = q_row;
        let [row, column] = place;
        if shutter.is_global() {
            locate_run::<false>(
                camera,
                target_from_query,
                shutter,
                x,
                y,
                z,
                qx,
                qy,
                qz,
                rx,
                ry,
                rz,
                row,
                column,
            );
        } else {
            locate_run::<true>(
                camera,
                target_from_query,
                shutter,
                x,
                y,
                z,
                qx,
                qy,
                qz,
                rx,
                ry,
                rz,
                row,
                column,
            );
        }
    }
}

impl Located {
    /// The cell that sees a query; `None` outside the image.
    #[inline(always)]
    pub(crate) fn cell(&self, place: usize, grid: Grid) -> Option<(usize, usize)> {
        // Rounded, not truncated (TRAPS 11).
        let (row, column) = (self.row[place] + 0.5, self.column[place] + 0.5);
        let is_inside =
            (row >= 0.0) & (column >= 0.0) & (row < grid.height as f32) & (column < grid.width as f32);
        is_inside.then_some((row as usize, column as usize))
    }
}

#[inline(always)]
#[expect(
    clippy::too_many_arguments,
    reason = "each output is an argument, so that it is known to overlap nothing"
)]
fn locate_run<const IS_ROLLING: bool>(
    camera: GridCamera,
    motion: &[f32; 12],
    shutter: ShutterTable,
    x: &[f32],
    y: &[f32],
    z: &[f32],
    qx: &mut [f32],
    qy: &mut [f32],
    qz: &mut [f32],
    rx: &mut [f32],
    ry: &mut [f32],
    rz: &mut [f32],
    row: &mut [f32],
    column: &mut [f32],
) {
    let n = x.len();
    let (y, z) = (&y[..n], &z[..n]);
    let (qx, qy, qz) = (&mut qx[..n], &mut qy[..n], &mut qz[..n]);
    let (rx, ry, rz) = (&mut rx[..n], &mut ry[..n], &mut rz[..n]);
    let (row, column) = (&mut row[..n], &mut column[..n]);
    for k in 0..n {
        let q = transform(motion, [x[k], y[k], z[k]]);
        let mut seen = camera.project(q);
        let mut q_row = q;
        if IS_ROLLING {
            // Two fixed-point steps find the row whose exposure saw the point (SPEC 1.6).
            q_row = shutter.move_point(q, -shutter.row_time_s(seen.0));
            seen = camera.project(q_row);
            q_row = shutter.move_point(q, -shutter.row_time_s(seen.0));
            seen = camera.project(q_row);
        }
        (qx[k], qy[k], qz[k]) = (q[0], q[1], q[2]);
        (rx[k], ry[k], rz[k]) = (q_row[0], q_row[1], q_row[2]);
        (row[k], column[k]) = seen;
    }
}
