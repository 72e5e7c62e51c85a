//! From a point to the cell of the grid that sees it.

use tessera_geometry::Camera;
use tessera_surface::Grid;

/// The camera in grid coordinates and `f32`, for projecting query points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridCamera {
    /// Shape of the grid.
    pub grid: Grid,
    fx: f32,
    fy: f32,
    cx: f32,
    cy: f32,
    distortion: [f32; 5],
    /// Beyond this square of the distance from the axis the image has ended, and the distortion's
    /// polynomial may fold back into it.
    largest_r2: f32,
}

impl GridCamera {
    /// `offset_px`: where the measurement of a cell lies relative to the cell's first pixel, for
    /// instance `(step - 1) / 2` when cells are averaged and 0 when they are picked.
    pub fn new(camera: &Camera, grid: Grid, offset_px: f64) -> Self {
        let step = grid.step as f64;
        let (bottom, right) = (f64::from(camera.height), f64::from(camera.width));
        let corners = [(0.0, 0.0), (0.0, right), (bottom, 0.0), (bottom, right)];
        let largest_r2 = corners
            .map(|(row, column)| camera.ray(row, column))
            .iter()
            .map(|ray| ray.x * ray.x + ray.y * ray.y)
            .fold(0.0, f64::max);
        Self {
            grid,
            fx: (camera.fx / step) as f32,
            fy: (camera.fy / step) as f32,
            cx: ((camera.cx - offset_px) / step) as f32,
            cy: ((camera.cy - offset_px) / step) as f32,
            distortion: camera.distortion.map(|k| k as f32),
            largest_r2: (1.1 * largest_r2) as f32,
        }
    }

    /// Fractional `(row, column)` of the grid; negative where the point is not seen: behind the
    /// camera or far outside the image. Without branches, so that many points go at once.
    #[inline(always)]
    pub(crate) fn project(&self, p: [f32; 3]) -> (f32, f32) {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let inverse = 1.0 / p[2];
        let (x, y) = (p[0] * inverse, p[1] * inverse);
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let xy = x * y;
        let xd = x * radial + 2.0 * p1 * xy + p2 * (r2 + 2.0 * x * x);
        let yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * xy;
        let is_seen = (p[2] > 0.05) & (r2 <= self.largest_r2);
        let (row, column) = (self.fy * yd + self.cy, self.fx * xd + self.cx);
        (if is_seen { row } else { -1e6 }, if is_seen { column } else { -1e6 })
    }
}
