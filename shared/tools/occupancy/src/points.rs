//! Points of keyframes, thinned to one a voxel in an order that depends on the points alone.

use nalgebra::{Point3, Vector3};
use std::collections::HashMap;
use tessera_geometry::{Camera, Pose, RollingShutter, Twist, Vector6};
use tessera_surface::Vertex;

/// A coloured point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColouredPoint {
    /// Metres.
    pub position: [f32; 3],
    /// Red, green, blue; all zero without colour.
    pub rgb: [u8; 3],
}

impl ColouredPoint {
    /// The point as another frame has it.
    pub fn moved(&self, to_from_own: &Pose) -> Self {
        let moved = to_from_own * Point3::from(self.position.map(f64::from));
        Self { position: moved.coords.map(|metres| metres as f32).into(), rgb: self.rgb }
    }
}

#[derive(Clone, Copy, Default)]
struct PointSum {
    position: [f64; 3],
    rgb: [u32; 3],
    n: u32,
}

/// The mean of the points in each voxel, voxels in the order of their first point.
pub struct PointThinner {
    edge_m: f64,
    index: HashMap<[i32; 3], u32>,
    sums: Vec<PointSum>,
}

impl PointThinner {
    /// Nothing yet, in voxels of that edge, metres.
    pub fn new(edge_m: f64) -> Self {
        Self { edge_m, index: HashMap::new(), sums: Vec::new() }
    }

    /// Adds a point; one that is not finite or farther than 2^31 voxels away is left out.
    pub fn add(&mut self, point: &ColouredPoint) {
        let position = point.position.map(f64::from);
        let cell = position.map(|metres| (metres / self.edge_m).floor());
        if !cell.iter().all(|c| c.abs() < f64::from(i32::MAX)) {
            return;
        }
        let next = self.sums.len() as u32;
        let slot = *self.index.entry(cell.map(|c| c as i32)).or_insert(next);
        if slot == next {
            self.sums.push(PointSum::default());
        }
        let sum = &mut self.sums[slot as usize];
        sum.position.iter_mut().zip(position).for_each(|(total, metres)| *total += metres);
        sum.rgb.iter_mut().zip(point.rgb).for_each(|(total, part)| *total += u32::from(part));
        sum.n += 1;
    }

    /// The mean point of each voxel.
    pub fn points(&self) -> Vec<ColouredPoint> {
        let mean = |sum: &PointSum| ColouredPoint {
            position: sum.position.map(|total| (total / f64::from(sum.n)) as f32),
            rgb: sum.rgb.map(|total| ((total + sum.n / 2) / sum.n) as u8),
        };
        self.sums.iter().map(mean).collect()
    }
}

/// How the surface of a keyframe was seen.
pub struct KeyframeView<'a> {
    /// The camera of the depth images.
    pub camera: &'a Camera,
    /// Pixels between neighbouring vertices.
    pub step: usize,
    /// The keyframe's own motion per second in its camera frame, `rho phi`.
    pub velocity: [f64; 6],
}

/// The usable points of a surface, in its camera's axes at its stamp, one a voxel of `edge_m`; points
/// farther than `max_depth_m` are left out.
pub fn thinned_surface(
    vertices: &[Vertex],
    seen: &KeyframeView<'_>,
    max_depth_m: f64,
    edge_m: f64,
) -> Vec<ColouredPoint> {
    let velocity = Twist::from_vector(&Vector6::from(seen.velocity));
    let shutter = RollingShutter::new(seen.camera, &velocity, seen.step);
    let width = (seen.camera.width as usize).div_ceil(seen.step);
    let mut thinner = PointThinner::new(edge_m);
    for (row, line) in vertices.chunks(width).enumerate() {
        let usable = |vertex: &&Vertex| vertex.is_valid() && f64::from(vertex.position[2]) <= max_depth_m;
        for vertex in line.iter().filter(usable) {
            let image_row = (row * seen.step) as f64 + f64::from(vertex.row_offset());
            let stamp_from_row = shutter.stamp_from_row(image_row);
            let exposed = Vector3::from(vertex.position.map(f64::from));
            let position = stamp_from_row.rotation * exposed + stamp_from_row.translation.vector;
            thinner.add(&ColouredPoint {
                position: position.map(|metres| metres as f32).into(),
                rgb: vertex.rgb(),
            });
        }
    }
    thinner.points()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_a_voxel_become_their_mean_in_order_of_appearance() {
        let mut thinner = PointThinner::new(0.1);
        for (x, grey) in [(0.51, 10), (-0.01, 0), (0.53, 20), (f32::NAN, 0), (f32::MAX, 0)] {
            thinner.add(&ColouredPoint { position: [x, 0.0, 0.0], rgb: [grey; 3] });
        }
        let points = thinner.points();
        assert_eq!(points.len(), 2);
        assert!((points[0].position[0] - 0.52).abs() < 1e-6 && points[0].rgb == [15; 3]);
        assert_eq!(points[1].position[0], -0.01);
    }

    #[test]
    fn a_surface_gives_its_usable_points_without_the_rolling_shutter() {
        let camera =
            Camera { readout_s: 0.03, ..Camera::pinhole((8, 480), [500.0, 500.0, 4.0, 240.0], 1000.0) };
        let seen = KeyframeView { camera: &camera, step: 4, velocity: [0.0, 1.0, 0.0, 0.0, 0.0, 0.0] };
        let mut vertices = vec![Vertex::default(); 2 * 120];
        let at = |z| Vertex {
            position: [0.0, 0.0, z],
            flags_rgb: Vertex::pack(Vertex::VALID, 0, [1, 2, 3]),
            ..Vertex::default()
        };
        // In the first row one that is usable, in the last one that is too far, others are invalid.
        vertices[1] = at(2.0);
        vertices[238] = at(7.0);
        let points = thinned_surface(&vertices, &seen, 6.0, 0.05);
        assert_eq!(points.len(), 1);
        assert_eq!((points[0].position[2], points[0].rgb), (2.0, [1, 2, 3]));
        // The first row is exposed 15 ms before the stamp, while the camera moves at 1 m/s along y.
        assert!((points[0].position[1] + 0.015).abs() < 1e-3, "{:?}", points[0]);
    }

    #[test]
    fn a_point_moves_with_its_frame() {
        let point = ColouredPoint { position: [1.0, 2.0, 3.0], rgb: [9; 3] };
        assert_eq!(point.moved(&Pose::translation(0.5, 0.0, -1.0)).position, [1.5, 2.0, 2.0]);
    }
}
