//! A fixed surface that queries are matched against.

use crate::association::kd_tree::KdTree;
use crate::association::projection::GridCamera;
use tessera_geometry::{Camera, Pose, Twist};
use tessera_numerics::lanes::{Real, add, cross, scale};
use tessera_surface::SurfaceView;

/// Motion during the readout (method 1.6): where the camera was when a row of the grid was exposed.
///
/// The transform of a row is `exp(velocity t)`, applied as its series up to the third order: at
/// 3 rad/s and 15 ms from the stamp, what is left out moves a point at 3 m by 1e-6 m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShutterTable {
    rho: [f32; 3],
    phi: [f32; 3],
    /// Seconds from the stamp at row 0, and per row; both 0 for a global shutter.
    first_row_s: f32,
    per_row_s: f32,
    last_row: f32,
    /// The camera that was read out; `None` for that of the matcher.
    camera: Option<GridCamera>,
}

impl ShutterTable {
    /// The motion of a frame with this velocity per second in its camera frame.
    pub fn new(camera: &Camera, velocity: &Twist, n_rows: usize, step: usize, offset_px: f64) -> Self {
        let first_row_s = camera.row_time_s(offset_px);
        Self {
            rho: [velocity.rho.x, velocity.rho.y, velocity.rho.z].map(|v| v as f32),
            phi: [velocity.phi.x, velocity.phi.y, velocity.phi.z].map(|v| v as f32),
            first_row_s: first_row_s as f32,
            per_row_s: (camera.row_time_s(offset_px + step as f64) - first_row_s) as f32,
            last_row: n_rows.saturating_sub(1) as f32,
            camera: None,
        }
    }

    /// The same of a camera that is not the matcher's: its surface is a target of that grid.
    #[must_use]
    pub fn of_camera(self, camera: GridCamera) -> Self {
        Self { camera: Some(camera), ..self }
    }

    /// The camera that was read out, where it is not the matcher's.
    pub(crate) fn camera(&self) -> Option<GridCamera> {
        self.camera
    }

    /// As [`Self::new`], in place.
    pub fn fill(&mut self, camera: &Camera, velocity: &Twist, n_rows: usize, step: usize, offset_px: f64) {
        *self = Self::new(camera, velocity, n_rows, step, offset_px);
    }

    /// Whether all rows were exposed at once.
    #[inline(always)]
    pub fn is_global(&self) -> bool {
        self.per_row_s == 0.0
    }

    /// Seconds from the stamp to the exposure of a row, clamped to the grid.
    #[inline(always)]
    pub(crate) fn row_time_s(&self, row: f32) -> f32 {
        let row = if row > 0.0 { row } else { 0.0 };
        let row = if row < self.last_row { row } else { self.last_row };
        self.first_row_s + self.per_row_s * row
    }

    /// As [`Self::row_time_s`] for rows that lie inside the grid, one or eight.
    #[inline(always)]
    pub(crate) fn inner_row_time_s<T: Real>(&self, row: T) -> T {
        T::splat(self.first_row_s) + T::splat(self.per_row_s) * row
    }

    /// `exp(velocity seconds) * p`.
    #[inline(always)]
    pub(crate) fn move_point<T: Real>(&self, p: [T; 3], seconds: T) -> [T; 3] {
        let first = scale(seconds, self.speed(p));
        self.finish(p, first, seconds)
    }

    /// How fast a point at rest moves in the camera's frame, with its sign changed.
    #[inline(always)]
    pub(crate) fn speed<T: Real>(&self, p: [T; 3]) -> [T; 3] {
        add(cross(splat(self.phi), p), splat(self.rho))
    }

    /// The rotation of `exp(velocity seconds)` applied to a direction.
    #[inline(always)]
    pub(crate) fn turn<T: Real>(&self, n: [T; 3], seconds: T) -> [T; 3] {
        self.finish(n, scale(seconds, cross(splat(self.phi), n)), seconds)
    }

    /// `p + first + X first / 2 + X^2 first / 6` with `X = seconds [phi]x`.
    #[inline(always)]
    fn finish<T: Real>(&self, p: [T; 3], first: [T; 3], seconds: T) -> [T; 3] {
        let phi = splat(self.phi);
        let second = scale(T::splat(0.5) * seconds, cross(phi, first));
        let third = scale(T::splat(1.0 / 3.0) * seconds, cross(phi, second));
        add(add(add(p, first), second), third)
    }
}

#[inline(always)]
fn splat<T: Real>(v: [f32; 3]) -> [T; 3] {
    [T::splat(v[0]), T::splat(v[1]), T::splat(v[2])]
}

/// Rotation row by row, then translation, in `f32`.
pub(crate) fn flat(pose: &Pose) -> [f32; 12] {
    let r = pose.rotation.to_rotation_matrix();
    let m = r.matrix();
    let t = &pose.translation.vector;
    [
        m[(0, 0)],
        m[(0, 1)],
        m[(0, 2)],
        m[(1, 0)],
        m[(1, 1)],
        m[(1, 2)],
        m[(2, 0)],
        m[(2, 1)],
        m[(2, 2)],
        t.x,
        t.y,
        t.z,
    ]
    .map(|v| v as f32)
}

/// A surface to align to, as it was exposed, with its own readout motion.
#[derive(Clone, Copy, Debug)]
pub struct Target<'a> {
    /// The vertices, in place.
    pub surface: SurfaceView<'a>,
    /// How its rows moved.
    pub shutter: &'a ShutterTable,
    /// For the exact search; `None` searches by projection.
    pub tree: Option<&'a KdTree>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Vector3};
    use tessera_geometry::exp;

    #[test]
    fn the_series_agrees_with_the_exponential() {
        let camera =
            Camera { readout_s: 0.03, ..Camera::pinhole((640, 480), [525.0, 525.0, 319.5, 239.5], 5000.0) };
        let velocity = Twist { rho: Vector3::new(0.5, -0.3, 0.2), phi: Vector3::new(2.0, -1.5, 1.0) };
        let shutter = ShutterTable::new(&camera, &velocity, 120, 4, 1.5);
        for row in [0.0f32, 17.0, 60.0, 119.0] {
            let seconds = shutter.row_time_s(row);
            let exact_s = camera.row_time_s(f64::from(row) * 4.0 + 1.5);
            assert!((f64::from(seconds) - exact_s).abs() < 1e-8);
            let exact = exp(&velocity.scaled(exact_s)) * Point3::new(0.7, -0.4, 2.5);
            let series = shutter.move_point([0.7, -0.4, 2.5], seconds);
            for k in 0..3 {
                assert!((f64::from(series[k]) - exact[k]).abs() < 2e-6, "row {row}: {series:?} {exact}");
            }
        }
    }
}
