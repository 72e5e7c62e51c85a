//! A surface as another camera would have measured it: pixels and raw depths stay.

use nalgebra::{Matrix2, Vector2, Vector3};
use rayon::prelude::*;
use tessera_geometry::Camera;
use tessera_surface::{Grid, Vertex};

/// Rays of the grid under two cameras, so that vertices made with one can be moved to the other.
///
/// Exact at the grid's own pixels, and to second order in the distance from them, which for a
/// filtered vertex is a cell at most.
#[derive(Clone, Debug)]
pub struct SurfaceWarp {
    nodes: Vec<Node>,
    offset_m: f64,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    from: Vector2<f64>,
    to: Vector2<f64>,
    /// Derivative of the new ray by the old one.
    slope: Matrix2<f64>,
}

impl SurfaceWarp {
    /// From surfaces made with `from` to those that `to` would have made. `offset_px`: where the
    /// measurement of a cell lies relative to the cell's first pixel.
    pub fn new(from: &Camera, to: &Camera, grid: Grid, offset_px: f64) -> Self {
        let nodes = (0..grid.len()).into_par_iter().map(|i| {
            let row = (i / grid.width * grid.step) as f64 + offset_px;
            let column = (i % grid.width * grid.step) as f64 + offset_px;
            let (old, new) = (from.ray(row, column), to.ray(row, column));
            // Old ray to pixel, pixel to new ray.
            let focal = |camera: &Camera| Vector2::new(camera.fx, camera.fy);
            let to_pixel = Matrix2::from_diagonal(&focal(from)) * slope(from, old.x, old.y);
            let from_pixel = Matrix2::from_diagonal(&focal(to)) * slope(to, new.x, new.y);
            let inverse = from_pixel.try_inverse().unwrap_or_else(Matrix2::identity);
            Node { from: old.xy(), to: new.xy(), slope: inverse * to_pixel }
        });
        Self { nodes: nodes.collect(), offset_m: to.depth_offset_m - from.depth_offset_m }
    }

    /// Moves all vertices of a surface; invalid ones stay as they are.
    pub fn apply(&self, vertices: &[Vertex]) -> Vec<Vertex> {
        vertices.iter().zip(&self.nodes).map(|(vertex, node)| self.moved(vertex, node)).collect()
    }

    fn moved(&self, vertex: &Vertex, node: &Node) -> Vertex {
        let position = Vector3::from(vertex.position.map(f64::from));
        if !vertex.is_valid() || !(position.z + self.offset_m > 0.0) {
            return *vertex;
        }
        let z = position.z + self.offset_m;
        let old = position.xy() / position.z;
        let new = node.to + node.slope * (old - node.from);
        // The surface's tangents move by A = d new point / d old point, its normal by A^-T:
        // A = [ s  r; 0 0 1 ] with s = slope z / old z and r = new - s old.
        let s = node.slope * (z / position.z);
        let normal = Vector3::from(vertex.normal.map(f64::from));
        let across = s.transpose().try_inverse().unwrap_or_else(Matrix2::identity) * normal.xy();
        let along = normal.z - (new - s * old).dot(&across);
        let turned = Vector3::new(across.x, across.y, along).normalize();
        Vertex {
            position: [(new.x * z) as f32, (new.y * z) as f32, z as f32],
            normal: [turned.x as f32, turned.y as f32, turned.z as f32],
            ..*vertex
        }
    }
}

fn slope(camera: &Camera, x: f64, y: f64) -> Matrix2<f64> {
    let [a, b, d] = camera.distortion_slope(x, y);
    Matrix2::new(a, b, b, d)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_surface::{Reconstructor, SurfaceSettings};

    fn camera(fx: f64, distortion: [f64; 5], depth_offset_m: f64) -> Camera {
        Camera {
            width: 640,
            height: 480,
            fx,
            fy: fx + 3.0,
            cx: 318.0,
            cy: 243.0,
            units_per_metre: 5000.0,
            distortion,
            readout_s: 0.0,
            depth_offset_m,
            colour_registered: true,
            colour_lag_s: 0.0,
            colour_focal_ratio: 1.0,
        }
    }

    #[test]
    fn a_moved_surface_is_the_one_that_the_other_camera_makes() {
        // A slanted wall with a bend.
        let pixels = (0..480u16).flat_map(|row| (0..640u16).map(move |column| (row, column)));
        let depth: Vec<u16> =
            pixels.map(|(row, column)| 7000 + 4 * row + 3 * column / 2 + 2 * column.abs_diff(300)).collect();
        let from = camera(525.0, [0.0; 5], 0.0);
        let to = camera(514.0, [0.1, -0.2, 0.002, -0.001, 0.05], 0.02);
        let make = |camera: &Camera| {
            let mut maker = Reconstructor::new(camera, &SurfaceSettings::default()).unwrap();
            let mut vertices = vec![Vertex::default(); maker.grid().len()];
            maker.reconstruct(&depth, None, &mut vertices);
            (maker.grid(), vertices)
        };
        let ((grid, old), (_, new)) = (make(&from), make(&to));
        let moved = SurfaceWarp::new(&from, &to, grid, 1.5).apply(&old);
        let mut n = 0;
        for (a, b) in moved.iter().zip(&new).filter(|(a, b)| a.is_inner() && b.is_inner()) {
            let apart =
                |u: &[f32; 3], v: &[f32; 3]| (0..3).map(|k| (u[k] - v[k]).powi(2)).sum::<f32>().sqrt();
            assert!(apart(&a.position, &b.position) < 2e-4, "{a:?} {b:?}");
            assert!(apart(&a.normal, &b.normal) < 2e-3, "{a:?} {b:?}");
            n += 1;
        }
        assert!(n > 15_000, "{n} vertices compared");
    }
}
