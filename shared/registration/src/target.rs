//! A fixed surface that queries are matched against.

use tessera_geometry::{Camera, Pose, Twist, exp};
use tessera_surface::SurfaceView;

/// Motion during the readout, one rigid transform per row of the grid (SPEC 1.6).
#[derive(Clone, Debug)]
pub struct ShutterTable {
    /// `stamp_from_row` as rotation (row by row) and translation; empty: global shutter.
    rows: Vec<[f32; 12]>,
}

impl ShutterTable {
    /// Tabulates `exp(velocity * row time)` for each row of the grid; nothing without a readout.
    ///
    /// `velocity`: the frame's own motion per second in its camera frame.
    pub fn new(camera: &Camera, velocity: &Twist, n_rows: usize, step: usize, offset_px: f64) -> Self {
        let mut table = Self { rows: Vec::new() };
        table.fill(camera, velocity, n_rows, step, offset_px);
        table
    }

    /// As [`Self::new`], reusing the buffer.
    pub fn fill(&mut self, camera: &Camera, velocity: &Twist, n_rows: usize, step: usize, offset_px: f64) {
        self.rows.clear();
        if camera.readout_s == 0.0 {
            return;
        }
        self.rows.extend((0..n_rows).map(|row| {
            let time_s = camera.row_time_s((row * step) as f64 + offset_px);
            flat(&exp(&velocity.scaled(time_s)))
        }));
    }

    /// Whether there is any motion to undo.
    #[inline]
    pub fn is_global(&self) -> bool {
        self.rows.is_empty()
    }

    /// Transform of a row, clamped to the grid.
    #[inline]
    pub(crate) fn row(&self, row: usize) -> &[f32; 12] {
        &self.rows[row.min(self.rows.len() - 1)]
    }
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

#[inline]
pub(crate) fn rotate(m: &[f32; 12], v: [f32; 3]) -> [f32; 3] {
    [
        m[0] * v[0] + m[1] * v[1] + m[2] * v[2],
        m[3] * v[0] + m[4] * v[1] + m[5] * v[2],
        m[6] * v[0] + m[7] * v[1] + m[8] * v[2],
    ]
}

#[inline]
pub(crate) fn transform(m: &[f32; 12], v: [f32; 3]) -> [f32; 3] {
    let r = rotate(m, v);
    [r[0] + m[9], r[1] + m[10], r[2] + m[11]]
}

#[inline]
pub(crate) fn transform_inverse(m: &[f32; 12], v: [f32; 3]) -> [f32; 3] {
    let d = [v[0] - m[9], v[1] - m[10], v[2] - m[11]];
    [
        m[0] * d[0] + m[3] * d[1] + m[6] * d[2],
        m[1] * d[0] + m[4] * d[1] + m[7] * d[2],
        m[2] * d[0] + m[5] * d[1] + m[8] * d[2],
    ]
}

/// A surface to align to, as it was exposed, with its own readout motion.
#[derive(Clone, Copy, Debug)]
pub struct Target<'a> {
    /// The vertices, in place.
    pub surface: SurfaceView<'a>,
    /// How its rows moved.
    pub shutter: &'a ShutterTable,
}
