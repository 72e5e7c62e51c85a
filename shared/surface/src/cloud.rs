//! The organised cloud: one point per cell of `n x n` pixels (SPEC 1.1).

use crate::planes::Workspace;
use crate::settings::CellSample;
use tessera_geometry::{Camera, DepthNoise, RayTable};

/// What the cloud needs to know of the camera, made once per camera.
#[derive(Debug)]
pub(crate) struct CloudMaker {
    rays: RayTable,
    sample: CellSample,
    step: usize,
    metres_per_unit: f32,
    max_depth_m: f32,
    noise: DepthNoise,
}

/// One cell's measurement: depth and the pixel it belongs to, relative to the cell's corner.
struct CellDepth {
    depth_m: f32,
    row: f32,
    column: f32,
}

impl CloudMaker {
    pub(crate) fn new(
        camera: &Camera,
        step: usize,
        sample: CellSample,
        max_depth_m: f32,
        noise: DepthNoise,
    ) -> Self {
        Self {
            rays: RayTable::new(camera, 1),
            sample,
            step,
            metres_per_unit: (1.0 / camera.units_per_metre) as f32,
            max_depth_m,
            noise,
        }
    }

    /// Fills points, brightness and colour; returns the number of cells with a measurement.
    pub(crate) fn fill(&self, depth: &[u16], colour: Option<&[u8]>, w: &mut Workspace) -> usize {
        let mut n_measured = 0;
        for row in 0..w.grid.height {
            for column in 0..w.grid.width {
                let i = row * w.grid.width + column;
                let Some(cell) = self.cell_depth(depth, row, column) else {
                    w.points.set(i, [0.0; 3]);
                    w.intensity[i] = 0.0;
                    w.colour_row[i] = [0; 4];
                    continue;
                };
                n_measured += 1;
                w.points.set(i, self.point(row, column, &cell));
                // Colour at the pixel nearest to where the depth is.
                let (row_offset, column_offset) = ((cell.row + 0.5) as usize, (cell.column + 0.5) as usize);
                let pixel =
                    (row * self.step + row_offset) * self.rays.width + column * self.step + column_offset;
                let rgb = colour.map_or([128; 3], |c| [c[3 * pixel], c[3 * pixel + 1], c[3 * pixel + 2]]);
                let sum = u32::from(rgb[0]) + u32::from(rgb[1]) + u32::from(rgb[2]);
                w.intensity[i] = sum as f32 * (1.0 / 765.0);
                w.colour_row[i] = [rgb[0], rgb[1], rgb[2], row_offset as u8];
            }
        }
        n_measured
    }

    /// Back-projects a cell's depth through the ray of its (fractional) pixel.
    fn point(&self, row: usize, column: usize, cell: &CellDepth) -> [f32; 3] {
        let RayTable { width, height, x, y, .. } = &self.rays;
        let (r, c) = (row * self.step + cell.row as usize, column * self.step + cell.column as usize);
        let (dr, dc) = (cell.row.fract(), cell.column.fract());
        let (at, right, down) =
            (r * width + c, (c + 1 < *width) as usize, (r + 1 < *height) as usize * width);
        // Rays are smooth: linear between neighbouring pixels to 1e-7.
        let ray_x = x[at] + dc * (x[at + right] - x[at]) + dr * (x[at + down] - x[at]);
        let ray_y = y[at] + dc * (y[at + right] - y[at]) + dr * (y[at + down] - y[at]);
        [ray_x * cell.depth_m, ray_y * cell.depth_m, cell.depth_m]
    }

    fn metres(&self, raw: u16) -> f32 {
        // 0 and 65535 are no measurement; both fail the range test below.
        let depth_m = if raw == u16::MAX { 0.0 } else { f32::from(raw) * self.metres_per_unit };
        if depth_m <= self.max_depth_m { depth_m } else { 0.0 }
    }

    fn cell_depth(&self, depth: &[u16], row: usize, column: usize) -> Option<CellDepth> {
        let (top, left) = (row * self.step, column * self.step);
        let (n_rows, n_columns) =
            (self.step.min(self.rays.height - top), self.step.min(self.rays.width - left));
        let at = |r: usize, c: usize| self.metres(depth[(top + r) * self.rays.width + left + c]);
        match self.sample {
            CellSample::Corner => {
                let depth_m = at(0, 0);
                (depth_m > 0.0).then_some(CellDepth { depth_m, row: 0.0, column: 0.0 })
            }
            CellSample::Nearest => nearest_pixel(n_rows, n_columns, at),
            CellSample::Mean => {
                // The reference is the valid pixel nearest to the cell's middle.
                let reference = middle_pixel(n_rows, n_columns, at)?;
                let inverse_m = 1.0 / reference;
                let tolerance = 2.0 * self.noise.sigma_m(reference) * inverse_m * inverse_m;
                let (mut sum, mut n, mut sum_row, mut sum_column) = (0.0f32, 0.0f32, 0.0f32, 0.0f32);
                for r in 0..n_rows {
                    for c in 0..n_columns {
                        let depth_m = at(r, c);
                        let inverse = if depth_m > 0.0 { 1.0 / depth_m } else { 0.0 };
                        let here =
                            f32::from(u8::from((inverse - inverse_m).abs() <= tolerance && depth_m > 0.0));
                        sum += here * inverse;
                        sum_row += here * r as f32;
                        sum_column += here * c as f32;
                        n += here;
                    }
                }
                // Disparity is affine in the pixel on a plane, so its mean at the mean pixel is exact.
                Some(CellDepth { depth_m: n / sum, row: sum_row / n, column: sum_column / n })
            }
        }
    }
}

/// The valid pixel nearest to the corner, rows before columns among equals.
fn nearest_pixel(n_rows: usize, n_columns: usize, at: impl Fn(usize, usize) -> f32) -> Option<CellDepth> {
    let mut best: Option<(usize, CellDepth)> = None;
    for r in 0..n_rows {
        for c in 0..n_columns {
            let distance = r * r + c * c;
            let depth_m = at(r, c);
            if depth_m > 0.0 && best.as_ref().is_none_or(|(d, _)| distance < *d) {
                best = Some((distance, CellDepth { depth_m, row: r as f32, column: c as f32 }));
            }
        }
    }
    best.map(|(_, cell)| cell)
}

/// Depth of the valid pixel nearest to the middle of the cell.
fn middle_pixel(n_rows: usize, n_columns: usize, at: impl Fn(usize, usize) -> f32) -> Option<f32> {
    let first = at(n_rows / 2, n_columns / 2);
    if first > 0.0 {
        return Some(first);
    }
    let mut best: Option<(usize, f32)> = None;
    for r in 0..n_rows {
        for c in 0..n_columns {
            let (dr, dc) = ((2 * r + 1).abs_diff(n_rows), (2 * c + 1).abs_diff(n_columns));
            let distance = dr * dr + dc * dc;
            let depth_m = at(r, c);
            if depth_m > 0.0 && best.is_none_or(|(d, _)| distance < d) {
                best = Some((distance, depth_m));
            }
        }
    }
    best.map(|(_, depth_m)| depth_m)
}
