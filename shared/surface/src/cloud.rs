//! The organised cloud: one point per cell of `n x n` pixels (SPEC 1.1).

use crate::cell::{CellDepth, CellRule};
use crate::planes::Workspace;
use crate::settings::{CellBrightness, CellSample, SurfaceSettings};
use tessera_geometry::{Camera, DepthNoise};

/// Turns pixels into points; knows the camera's rays.
#[derive(Debug)]
pub(crate) struct CloudMaker {
    /// Rays through where a whole cell is measured, row by row.
    centre_x: Vec<f32>,
    centre_y: Vec<f32>,
    rule: CellRule,
    brightness: CellBrightness,
    width: usize,
    height: usize,
    step: usize,
    /// Where a whole cell is measured, pixels from its first.
    offset: f32,
    /// Cells per pixel.
    per_pixel: f32,
    /// Sums, least and largest raw depth of each image column over the rows of a cell.
    columns: ColumnSums,
}

#[derive(Debug, Default)]
struct ColumnSums {
    sum: Vec<u32>,
    least: Vec<u16>,
    most: Vec<u16>,
    /// The same for each cell, and its mean depth.
    cell_sum: Vec<u32>,
    cell_least: Vec<u16>,
    cell_most: Vec<u16>,
    mean_m: Vec<f32>,
}

impl CloudMaker {
    pub(crate) fn new(camera: &Camera, settings: &SurfaceSettings) -> Self {
        let (step, sample) = (settings.step as usize, settings.cell_sample);
        let noise = DepthNoise::new(settings.noise);
        let (width, height) = (camera.width as usize, camera.height as usize);
        let (rows, columns) = (height.div_ceil(step), width.div_ceil(step));
        let offset = match sample {
            CellSample::Mean => (step as f64 - 1.0) / 2.0,
            CellSample::Corner | CellSample::Nearest => 0.0,
        };
        let centre = |i: usize| {
            let (row, column) = (i / columns * step, i % columns * step);
            camera.ray(row as f64 + offset, column as f64 + offset)
        };
        Self {
            centre_x: (0..rows * columns).map(|i| centre(i).x as f32).collect(),
            centre_y: (0..rows * columns).map(|i| centre(i).y as f32).collect(),
            rule: CellRule::new(camera, step, sample, settings.max_depth_m, noise),
            brightness: settings.cell_brightness,
            width,
            height,
            step,
            offset: offset as f32,
            per_pixel: 1.0 / step as f32,
            columns: ColumnSums {
                sum: vec![0; width],
                least: vec![0; width],
                most: vec![0; width],
                cell_sum: vec![0; columns],
                cell_least: vec![0; columns],
                cell_most: vec![0; columns],
                mean_m: vec![0.0; columns],
            },
        }
    }

    /// Fills points, brightness and colour; returns the number of cells with a measurement.
    #[inline(always)]
    pub(crate) fn fill(&mut self, depth: &[u16], colour: Option<&[u8]>, w: &mut Workspace) -> usize {
        let mut n_measured = 0;
        for row in 0..w.layout.grid.height {
            n_measured += self.fill_row(row, depth, w);
            colours(row, self.step, self.width, colour, w);
            if let Some(colour) = colour
                && self.brightness == CellBrightness::Mean
            {
                mean_brightness(row, self.step, self.width, colour, w);
            }
        }
        n_measured
    }

    #[inline(always)]
    fn fill_row(&mut self, row: usize, depth: &[u16], w: &mut Workspace) -> usize {
        let (start, n) = (w.layout.row(row), w.layout.grid.width);
        let whole_columns = self.width / self.step;
        let is_whole = self.rule.averages() && (row + 1) * self.step <= self.height;
        self.columns.mean_m.fill(0.0);
        if is_whole {
            self.columns.fill(&depth[row * self.step * self.width..], self.width, self.step);
            self.columns.whole_cells(whole_columns, self.step, &self.rule);
        }
        let means = &self.columns.mean_m[..n];
        let rays = (&self.centre_x[row * n..(row + 1) * n], &self.centre_y[row * n..(row + 1) * n]);
        let [x, y, z] = w.points.run_mut(start, n);
        point_row(rays, means, x, y, z);
        let whole_row_offset = if self.rule.averages() { self.step / 2 } else { 0 };
        let mut n_measured = 0;
        for column in 0..n {
            let mut row_offset = whole_row_offset;
            if means[column] == 0.0
                && !(is_whole && column < whole_columns && self.columns.cell_most[column] == 0)
            {
                // Not whole: a hole, a depth edge or a steep slope.
                let (top, left) = (row * self.step, column * self.step);
                let size = (self.step.min(self.height - top), self.step.min(self.width - left));
                let cell = self.rule.measure(&depth[top * self.width + left..], self.width, size);
                let point = cell.map_or([0.0; 3], |cell| self.point(row, column, n, &cell));
                row_offset = cell.map_or(0, |cell| (cell.row + 0.5) as usize);
                w.points.set(start + column, point);
            }
            n_measured += usize::from(w.points.z[start + column] > 0.0);
            w.colour_row[row * n + column][3] = row_offset as u8;
        }
        n_measured
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

impl ColumnSums {
    #[inline(always)]
    fn fill(&mut self, rows: &[u16], width: usize, n_rows: usize) {
        let (sum, least, most) = (&mut self.sum[..width], &mut self.least[..width], &mut self.most[..width]);
        sum.fill(0);
        least.fill(u16::MAX);
        most.fill(0);
        for row in rows.chunks_exact(width).take(n_rows) {
            for c in 0..width {
                sum[c] += u32::from(row[c]);
                least[c] = least[c].min(row[c]);
                most[c] = most[c].max(row[c]);
            }
        }
    }

    #[inline(always)]
    fn sum_cells<const STEP: usize>(&mut self) {
        sum_row::<STEP>(&self.sum, &mut self.cell_sum);
        least_row::<STEP>(&self.least, &mut self.cell_least);
        most_row::<STEP>(&self.most, &mut self.cell_most);
    }

    /// Mean depth of each cell all of whose pixels lie on one surface; 0 for the others.
    #[inline(always)]
    fn whole_cells(&mut self, n_cells: usize, step: usize, rule: &CellRule) {
        match step {
            2 => self.sum_cells::<2>(),
            4 => self.sum_cells::<4>(),
            8 => self.sum_cells::<8>(),
            _ => self.sum_cells::<1>(),
        }
        mean_row(
            rule,
            &self.cell_least[..n_cells],
            &self.cell_most[..n_cells],
            &self.cell_sum[..n_cells],
            &mut self.mean_m[..n_cells],
        );
    }
}

#[inline(always)]
fn sum_row<const STEP: usize>(columns: &[u32], cells: &mut [u32]) {
    for (cell, run) in cells.iter_mut().zip(columns.chunks_exact(STEP)) {
        *cell = run.iter().sum();
    }
}

#[inline(always)]
fn least_row<const STEP: usize>(columns: &[u16], cells: &mut [u16]) {
    for (cell, run) in cells.iter_mut().zip(columns.chunks_exact(STEP)) {
        *cell = run.iter().fold(u16::MAX, |a, &b| a.min(b));
    }
}

#[inline(always)]
fn most_row<const STEP: usize>(columns: &[u16], cells: &mut [u16]) {
    for (cell, run) in cells.iter_mut().zip(columns.chunks_exact(STEP)) {
        *cell = run.iter().fold(0, |a, &b| a.max(b));
    }
}

#[inline(always)]
fn mean_row(rule: &CellRule, least: &[u16], most: &[u16], sum: &[u32], out: &mut [f32]) {
    let n = out.len();
    let (least, most, sum) = (&least[..n], &most[..n], &sum[..n]);
    for c in 0..n {
        out[c] = rule.whole_mean(least[c], most[c], sum[c]);
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

/// Brightness and colour at the middle pixel of each cell of a row.
#[inline(always)]
fn colours(row: usize, step: usize, width: usize, colour: Option<&[u8]>, w: &mut Workspace) {
    let (start, n) = (w.layout.row(row), w.layout.grid.width);
    let Some(colour) = colour else {
        w.intensity[start..start + n].fill(0.5);
        for c in &mut w.colour_row[row * n..(row + 1) * n] {
            *c = [128, 128, 128, c[3]];
        }
        return;
    };
    let height = colour.len() / (3 * width);
    let pixel_row = (row * step + step / 2).min(height - 1);
    let line = &colour[3 * pixel_row * width..3 * (pixel_row + 1) * width];
    for column in 0..n {
        let at = 3 * (column * step + step / 2).min(width - 1);
        let rgb = [line[at], line[at + 1], line[at + 2]];
        let sum = u32::from(rgb[0]) + u32::from(rgb[1]) + u32::from(rgb[2]);
        w.intensity[start + column] = sum as f32 * (1.0 / 765.0);
        let out = &mut w.colour_row[row * n + column];
        *out = [rgb[0], rgb[1], rgb[2], out[3]];
    }
}

/// Mean brightness of each cell of a row.
fn mean_brightness(row: usize, step: usize, width: usize, colour: &[u8], w: &mut Workspace) {
    let (start, n) = (w.layout.row(row), w.layout.grid.width);
    let sums = &mut w.intensity[start..start + n];
    sums.fill(0.0);
    let lines = colour.chunks_exact(3 * width).skip(row * step).take(step);
    let n_lines = lines.len() as f32;
    for line in lines {
        for (sum, cell) in sums.iter_mut().zip(line.chunks(3 * step)) {
            let bytes = cell.iter().map(|&c| u32::from(c)).sum::<u32>();
            *sum += bytes as f32 / cell.len() as f32;
        }
    }
    sums.iter_mut().for_each(|sum| *sum *= 1.0 / (255.0 * n_lines));
}
