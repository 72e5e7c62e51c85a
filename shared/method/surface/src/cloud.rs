//! The organised cloud: one point per cell of `n x n` pixels (method 1.1).

use crate::cell::{CellDepth, CellRule};
use crate::colour;
use crate::columns::CellSums;
use crate::planes::Workspace;
use crate::settings::SurfaceSettings;
use tessera_geometry::{Camera, DepthNoise};
use tessera_numerics::{Bits, WORD};

/// Turns pixels into points; knows the camera's rays.
#[derive(Debug)]
pub(crate) struct CloudMaker {
    /// Rays through where a whole cell is measured, row by row.
    centre_x: Vec<f32>,
    centre_y: Vec<f32>,
    rule: CellRule,
    width: usize,
    height: usize,
    step: usize,
    /// Where a whole cell is measured, pixels from its first.
    offset: f32,
    /// Cells per pixel.
    per_pixel: f32,
    sums: CellSums,
}

impl CloudMaker {
    pub(crate) fn new(camera: &Camera, settings: &SurfaceSettings) -> Self {
        let (step, variant) = (settings.step as usize, settings.variant);
        let noise = DepthNoise::default();
        let (width, height) = (camera.width as usize, camera.height as usize);
        let (rows, columns) = (height.div_ceil(step), width.div_ceil(step));
        let offset = if variant.is_paper() { 0.0 } else { (step as f64 - 1.0) / 2.0 };
        let centre = |i: usize| {
            let (row, column) = (i / columns * step, i % columns * step);
            camera.ray(row as f64 + offset, column as f64 + offset)
        };
        Self {
            centre_x: (0..rows * columns).map(|i| centre(i).x as f32).collect(),
            centre_y: (0..rows * columns).map(|i| centre(i).y as f32).collect(),
            rule: CellRule::new(camera, step, variant, settings.max_depth_m, noise),
            width,
            height,
            step,
            offset: offset as f32,
            per_pixel: 1.0 / step as f32,
            sums: CellSums::new(width, columns),
        }
    }

    /// Fills points, intensity and colour; returns the number of cells with a measurement.
    #[inline(always)]
    pub(crate) fn fill(&mut self, depth: &[u16], colour: Option<&[u8]>, w: &mut Workspace) -> usize {
        let mut n_measured = 0;
        for row in 0..w.layout.grid.height {
            n_measured += self.fill_row(row, depth, w);
            colour::middle(row, self.step, self.width, colour, w);
        }
        n_measured
    }

    #[inline(always)]
    fn fill_row(&mut self, row: usize, depth: &[u16], w: &mut Workspace) -> usize {
        let (start, n) = (w.layout.row(row), w.layout.grid.width);
        let is_whole = self.rule.averages() && (row + 1) * self.step <= self.height;
        let n_whole = if is_whole { self.width / self.step } else { 0 };
        self.sums.mean_m.fill(0.0);
        if is_whole {
            let rows = &depth[row * self.step * self.width..];
            self.sums.fill(rows, self.width, self.step, &self.rule);
        }
        let means = &self.sums.mean_m[..n];
        let rays = (&self.centre_x[row * n..(row + 1) * n], &self.centre_y[row * n..(row + 1) * n]);
        let [x, y, z] = w.points.run_mut(start, n);
        point_row(rays, means, x, y, z);
        let offsets = &mut w.colour_row[row * n..(row + 1) * n];
        let whole_row_offset = if self.rule.averages() { self.step / 2 } else { 0 } as u8;
        offsets.iter_mut().for_each(|c| c[3] = whole_row_offset);
        for first in (0..n).step_by(WORD) {
            // Not whole: a hole, a depth edge or a steep slope.
            let mut others = 0;
            for column in first..n.min(first + WORD) {
                let is_empty = (column < n_whole) & (self.sums.cell_most[column] == 0);
                others |= u64::from((means[column] == 0.0) & !is_empty) << (column - first);
            }
            for place in Bits(others) {
                let column = first + place;
                let (top, left) = (row * self.step, column * self.step);
                let size = (self.step.min(self.height - top), self.step.min(self.width - left));
                let cell = self.rule.measure(&depth[top * self.width + left..], self.width, size);
                [x[column], y[column], z[column]] =
                    cell.map_or([0.0; 3], |cell| self.point(row, column, n, &cell));
                offsets[column][3] = cell.map_or(0, |cell| (cell.row + 0.5) as u8);
            }
        }
        z.iter().filter(|&&z| z > 0.0).count()
    }

    /// Back-projects a cell's depth through the ray of its (fractional) pixel: from the ray of a
    /// whole cell by the slope between neighbouring cells (rays are smooth: 1e-6 over a cell).
    #[inline(always)]
    fn point(&self, row: usize, column: usize, n: usize, cell: &CellDepth) -> [f32; 3] {
        let i = row * n + column;
        let (x, y) = (&self.centre_x, &self.centre_y);
        let right = if column + 1 < n { (i, i + 1) } else { (i - 1, i) };
        let down = if i + n < x.len() { (i, i + n) } else { (i - n, i) };
        let (dr, dc) =
            ((cell.row - self.offset) * self.per_pixel, (cell.column - self.offset) * self.per_pixel);
        let ray_x = x[i] + dc * (x[right.1] - x[right.0]) + dr * (x[down.1] - x[down.0]);
        let ray_y = y[i] + dc * (y[right.1] - y[right.0]) + dr * (y[down.1] - y[down.0]);
        [ray_x * cell.depth_m, ray_y * cell.depth_m, cell.depth_m]
    }
}

#[inline(always)]
fn point_row((ray_x, ray_y): (&[f32], &[f32]), depth_m: &[f32], x: &mut [f32], y: &mut [f32], z: &mut [f32]) {
    let n = x.len();
    let (ray_x, ray_y, depth_m, y, z) = (&ray_x[..n], &ray_y[..n], &depth_m[..n], &mut y[..n], &mut z[..n]);
    for c in 0..n {
        [x[c], y[c], z[c]] = [ray_x[c] * depth_m[c], ray_y[c] * depth_m[c], depth_m[c]];
    }
}
