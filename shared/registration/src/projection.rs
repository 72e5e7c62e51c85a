//! From a point to the cell of the grid that sees it.

use tessera_geometry::Camera;
use tessera_surface::Grid;

/// The camera in grid coordinates and `f32`, for projecting query points.
#[derive(Clone, Debug)]
pub struct GridCamera {
    /// Shape of the grid.
    pub grid: Grid,
    fx: f32,
    fy: f32,
    cx: f32,
    cy: f32,
    distortion: Option<[f32; 5]>,
}

impl GridCamera {
    /// `offset_px`: where the measurement of a cell lies relative to the cell's first pixel, for
    /// instance `(step - 1) / 2` when cells are averaged and 0 when they are picked.
    pub fn new(camera: &Camera, grid: Grid, offset_px: f64) -> Self {
        let step = grid.step as f64;
        Self {
            grid,
            fx: (camera.fx / step) as f32,
            fy: (camera.fy / step) as f32,
            cx: ((camera.cx - offset_px) / step) as f32,
            cy: ((camera.cy - offset_px) / step) as f32,
            distortion: camera.is_distorted().then(|| camera.distortion.map(|k| k as f32)),
        }
    }

    /// Fractional `(row, column)` of the grid; `None` at or behind the camera.
    #[inline]
    pub fn project(&self, p: [f32; 3]) -> Option<(f32, f32)> {
        if !(p[2] > 0.05) {
            return None;
        }
        let inverse = 1.0 / p[2];
        let (mut x, mut y) = (p[0] * inverse, p[1] * inverse);
        if let Some([k1, k2, p1, p2, k3]) = self.distortion {
            let r2 = x * x + y * y;
            // Beyond the image the polynomial folds back; such points are not seen.
            if r2 > 1.2 {
                return None;
            }
            let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
            let xy = x * y;
            let xd = x * radial + 2.0 * p1 * xy + p2 * (r2 + 2.0 * x * x);
            y = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * xy;
            x = xd;
        }
        Some((self.fy * y + self.cy, self.fx * x + self.cx))
    }
}
