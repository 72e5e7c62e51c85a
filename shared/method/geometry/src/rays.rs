//! Rays of a subsampled pixel grid, undistorted once per camera.

use crate::Camera;

/// `(x/z, y/z)` for each pixel of the grid that takes every `n`-th row and column.
///
/// Pixel `(r, c)` of the grid is pixel `(n r, n c)` of the image: no half-pixel shift (method 1.1).
#[derive(Clone, Debug)]
pub struct RayTable {
    /// Columns of the grid.
    pub width: usize,
    /// Rows of the grid.
    pub height: usize,
    /// Subsampling step, pixels of the image.
    pub step: usize,
    /// `x/z`, row by row.
    pub x: Vec<f32>,
    /// `y/z`, row by row.
    pub y: Vec<f32>,
}

impl RayTable {
    /// Undistorts the rays of every `step`-th pixel.
    pub fn new(camera: &Camera, step: usize) -> Self {
        let width = (camera.width as usize).div_ceil(step);
        let height = (camera.height as usize).div_ceil(step);
        let mut x = Vec::with_capacity(width * height);
        let mut y = Vec::with_capacity(width * height);
        for row in 0..height {
            for column in 0..width {
                let ray = camera.ray((row * step) as f64, (column * step) as f64);
                x.push(ray.x as f32);
                y.push(ray.y as f32);
            }
        }
        Self { width, height, step, x, y }
    }
}
