//! Which points may lie in space that a surface's camera saw through: a cheap test of many points at once, before
//! an exact one of the few that pass.

use crate::association::projection::GridCamera;
use crate::association::target::flat;
use crate::sampling::Sample;
use tessera_geometry::Pose;
use tessera_numerics::lanes::transform;
use tessera_numerics::{Isa, prefetch};
use tessera_surface::SurfaceView;

/// Points that are projected at a time.
const RUN: usize = 64;
/// How far the projection in `f32` may be from that in `f64`, cells and metres: far more than it is.
const SLACK_CELLS: f32 = 0.25;
const SLACK_M: f32 = 1e-3;

/// A surface seen from a frame.
#[derive(Clone, Copy, Debug)]
pub struct FreeSpaceView<'a> {
    /// The surface.
    pub surface: SurfaceView<'a>,
    /// Maps points of the frame into the surface's frame.
    pub view_from_camera: Pose,
}

/// Sets the bit `bit` of `flags[k]` unless sample `k` certainly has no free space about it: its cell lies
/// outside the inner part of the grid, or the vertex in its cell is valid and lies less than `behind_m` behind it.
///
/// `camera` without an offset: a cell begins at its first pixel. Never wrong in one direction: a point all
/// of whose 3x3 cells lie farther than `behind_m` behind it has its bit set.
///
/// # Panics
/// When there are more samples than flags.
pub fn mark_free_space(
    camera: &GridCamera,
    isa: Isa,
    view: &FreeSpaceView<'_>,
    samples: &[Sample],
    behind_m: f32,
    bit: u32,
    flags: &mut [u32],
) {
    let motion = flat(&view.view_from_camera);
    isa.arch().dispatch(MarkFreeSpace { camera, view, samples, behind_m, bit, flags, motion });
}

struct MarkFreeSpace<'a> {
    camera: &'a GridCamera,
    view: &'a FreeSpaceView<'a>,
    samples: &'a [Sample],
    behind_m: f32,
    bit: u32,
    flags: &'a mut [u32],
    motion: [f32; 12],
}

impl pulp::WithSimd for MarkFreeSpace<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        let Self { camera, view, samples, behind_m, bit, flags, motion } = self;
        let grid = view.surface.grid;
        if view.surface.vertices.len() < grid.len() {
            // Nothing can be excluded by a surface that is not there.
            flags[..samples.len()].iter_mut().for_each(|flags| *flags |= 1 << bit);
            return;
        }
        let (last_row, last_column) = (grid.height as f32 - 1.0, grid.width as f32 - 1.0);
        let mut located = [[0.0; RUN]; 3];
        for (samples, flags) in samples.chunks(RUN).zip(flags[..samples.len()].chunks_mut(RUN)) {
            locate(camera, &motion, samples, &mut located);
            let [z, row, column] = &located;
            let cell = |k: usize| {
                // A cast saturates, NaN becomes 0.
                let row = (row[k].max(0.0) as usize).min(grid.height - 1);
                row * grid.width + (column[k].max(0.0) as usize).min(grid.width - 1)
            };
            (0..samples.len()).for_each(|k| prefetch(&view.surface.vertices[cell(k)]));
            for (k, flags) in flags.iter_mut().enumerate() {
                // Not written as a comparison that a NaN fails: what is not known may lie in free space.
                let is_outside = (row[k] < 1.0 - SLACK_CELLS)
                    | (column[k] < 1.0 - SLACK_CELLS)
                    | (row[k] > last_row + SLACK_CELLS)
                    | (column[k] > last_column + SLACK_CELLS);
                let is_projected = (row[k] > UNSEEN) & (column[k] > UNSEEN);
                let vertex = &view.surface.vertices[cell(k)];
                // The projected cell is one of the nine about the exact one.
                let is_before = vertex.is_valid() & (vertex.position[2] < z[k] + behind_m - SLACK_M);
                let is_excluded = (z[k] < -SLACK_M) | (is_projected & (is_outside | is_before));
                *flags |= u32::from(!is_excluded) << bit;
            }
        }
    }
}

/// Rows and columns below are those of a point that was not projected.
const UNSEEN: f32 = -1e5;

#[inline(always)]
fn locate(camera: &GridCamera, motion: &[f32; 12], samples: &[Sample], located: &mut [[f32; RUN]; 3]) {
    let mut points = [[0.0; RUN]; 3];
    for (k, sample) in samples.iter().enumerate() {
        (0..3).for_each(|c| points[c][k] = sample.point[c]);
    }
    let ([x, y, z], [depth, row, column]) = (&points, located);
    for k in 0..RUN {
        let q = transform(motion, [x[k], y[k], z[k]]);
        (row[k], column[k]) = camera.project(q);
        depth[k] = q[2];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_geometry::{Camera, Twist, exp};
    use tessera_numerics::SplitMix64;
    use tessera_surface::{Grid, Vertex};

    /// The definition: of the nine cells about the point's, at least one is valid, and none is valid and less than
    /// `behind_m` behind it.
    fn is_in_free_space(camera: &Camera, view: &FreeSpaceView<'_>, point: [f32; 3], behind_m: f32) -> bool {
        let p = view.view_from_camera * nalgebra::Point3::from(point.map(f64::from));
        let Some((row, column)) = camera.project(&p.coords) else { return false };
        let grid = view.surface.grid;
        let [row, column] = [row, column].map(|pixel| (pixel / grid.step as f64).floor() as i64);
        if row < 1 || column < 1 || row >= grid.height as i64 - 1 || column >= grid.width as i64 - 1 {
            return false;
        }
        let cells = (row - 1..=row + 1).flat_map(|r| (column - 1..=column + 1).map(move |c| (r, c)));
        let mut valid = cells
            .map(|(r, c)| &view.surface.vertices[r as usize * grid.width + c as usize])
            .filter(|vertex| vertex.is_valid())
            .peekable();
        valid.peek().is_some() && valid.all(|vertex| vertex.position[2] >= p.z as f32 + behind_m)
    }

    #[test]
    fn no_point_in_free_space_is_missed_and_most_others_are_left_out() {
        let pinhole = Camera::pinhole((640, 480), [517.3, 516.5, 318.6, 255.3], 5000.0);
        let camera = Camera { distortion: [0.2624, -0.9531, -0.0054, 0.0026, 1.1633], ..pinhole };
        let grid = Grid { width: 160, height: 120, step: 4 };
        let of_grid = GridCamera::new(&camera, grid, 0.0);
        let mut random = SplitMix64::new(4);
        let vertex = |random: &mut SplitMix64| Vertex {
            position: [0.0, 0.0, if random.below(9) == 0 { 3.0 } else { 2.0 }],
            flags_rgb: Vertex::pack(if random.below(9) == 0 { 0 } else { Vertex::VALID }, 0, [0; 3]),
            normal: [0.0, 0.0, -1.0],
            ..Vertex::default()
        };
        let mut vertices: Vec<Vertex> = (0..grid.len()).map(|_| vertex(&mut random)).collect();
        // A part of the view in which everything is far.
        vertices.iter_mut().take(50 * grid.width).for_each(|v| v.position[2] = 3.0);
        let twist = Twist {
            rho: nalgebra::Vector3::new(0.1, -0.05, 0.08),
            phi: nalgebra::Vector3::new(0.02, 0.1, -0.05),
        };
        let surface = SurfaceView { grid, vertices: &vertices };
        let view = FreeSpaceView { surface, view_from_camera: exp(&twist) };
        let mut coordinate = |reach: f32| reach * (2.0 * random.unit() as f32 - 1.0);
        // Most are seen, some lie beside the image or behind the camera.
        let mut sample = || {
            let z = 1.6 + coordinate(1.7);
            let point = [z * coordinate(0.7), z * coordinate(0.55), z];
            Sample { point, normal: [0.0, 0.0, -1.0], grid_row: 0 }
        };
        let mut samples: Vec<Sample> = (0..5003).map(|_| sample()).collect();
        samples[7].point = [f32::NAN; 3];
        let mut flags = vec![0; samples.len()];
        mark_free_space(&of_grid, Isa::default(), &view, &samples, 0.1, 2, &mut flags);
        let is_free = |sample: &Sample| is_in_free_space(&camera, &view, sample.point, 0.1);
        let free: Vec<bool> = samples.iter().map(is_free).collect();
        assert!(free.iter().zip(&flags).all(|(is_free, flags)| !is_free || *flags == 1 << 2));
        let n_free = free.iter().filter(|is_free| **is_free).count();
        let n_marked = flags.iter().filter(|flags| **flags > 0).count();
        assert!(n_free > 300 && n_marked < 2 * n_free, "{n_free} free, {n_marked} marked");
    }
}
