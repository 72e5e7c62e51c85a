//! The floor of a map: the lowest large surface of those that face up.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use std::collections::BTreeMap;
use tessera_geometry::Pose;
use tessera_surface::Vertex;

/// Of a keyframe's vertices each so many.
const STRIDE: usize = 7;
/// Cosine of 60 degrees: up is at most so far from the top of the first image.
const MOST_TILT_COS: f64 = 0.5;
/// Cosine of 10 degrees: normals of one direction.
const SAME_COS: f64 = 0.985;
/// Cells of the histogram of directions for each unit of the normal's components.
const CELLS_PER_UNIT: f64 = 10.0;
/// Height of a level, metres.
const LEVEL_M: f64 = 0.05;
/// Share of the largest level's area from which on a level is a floor: reflections make smaller ones.
const LEAST_SHARE: f64 = 0.2;
/// Samples from which on anything is found.
const LEAST_SAMPLES: usize = 200;

struct FloorSample {
    position: [f32; 3],
    normal: [f32; 3],
    /// Area of the surface that the vertex stands for, in units of its pixels.
    area: f32,
}

/// Samples of surfaces that may face up.
#[derive(Default)]
pub struct FloorFinder {
    samples: Vec<FloorSample>,
}

/// The floor, as a frame with z up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Floor {
    /// To the frame on the floor below the first camera: x where that looked, y to its left, z up.
    pub grid_from_world: Pose,
    /// Height of the first camera above the floor, metres.
    pub camera_height_m: f64,
    /// Angle between up and the top of the first image, degrees.
    pub tilt_deg: f64,
}

impl FloorFinder {
    /// Takes in the surface of a keyframe; vertices farther than `max_depth_m` are left out.
    pub fn add(&mut self, vertices: &[Vertex], world_from_camera: &Pose, max_depth_m: f64) {
        for vertex in vertices.iter().step_by(STRIDE).filter(|vertex| vertex.is_valid()) {
            let depth_m = f64::from(vertex.position[2]);
            let normal = world_from_camera.rotation * Vector3::from(vertex.normal.map(f64::from));
            if !(depth_m <= max_depth_m && -normal.y >= MOST_TILT_COS) {
                continue;
            }
            let position = Vector3::from(vertex.position.map(f64::from));
            let in_world = world_from_camera.rotation * position + world_from_camera.translation.vector;
            self.samples.push(FloorSample {
                position: in_world.map(|v| v as f32).into(),
                normal: normal.map(|v| v as f32).into(),
                area: (depth_m * depth_m) as f32,
            });
        }
    }

    /// The floor; `None` where too little faces up.
    pub fn find(&self) -> Option<Floor> {
        let up = self.up()?;
        let levels = || {
            let faces_up = |sample: &&FloorSample| normal(sample).dot(&up) >= SAME_COS;
            let height = |sample: &FloorSample| Vector3::from(sample.position.map(f64::from)).dot(&up);
            self.samples.iter().filter(faces_up).map(move |sample| (height(sample), f64::from(sample.area)))
        };
        let mut areas: BTreeMap<i64, f64> = BTreeMap::new();
        for (height_m, area) in levels() {
            *areas.entry((height_m / LEVEL_M).floor() as i64).or_default() += area;
        }
        let largest = areas.values().copied().fold(0.0, f64::max);
        let (lowest, _) = areas.iter().find(|(_, area)| **area >= LEAST_SHARE * largest)?;
        // The level and the one above it: a floor may lie across their border.
        let near = levels().filter(|(height_m, _)| {
            let level = (height_m / LEVEL_M).floor() as i64;
            level == *lowest || level == lowest + 1
        });
        let (sum, area) = near.fold((0.0, 0.0), |(sum, total), (h, area)| (sum + h * area, total + area));
        Some(Floor::of(up, -sum / area))
    }

    /// The direction that most surface faces.
    fn up(&self) -> Option<Vector3<f64>> {
        if self.samples.len() < LEAST_SAMPLES {
            return None;
        }
        let mut cells: BTreeMap<[i64; 2], (f64, Vector3<f64>)> = BTreeMap::new();
        for sample in &self.samples {
            let normal = normal(sample);
            let cell = [normal.x, normal.z].map(|v| (v * CELLS_PER_UNIT).floor() as i64);
            let (area, sum) = cells.entry(cell).or_default();
            *area += f64::from(sample.area);
            *sum += normal * f64::from(sample.area);
        }
        let most = cells.values().max_by(|a, b| a.0.total_cmp(&b.0))?;
        let mut up = most.1.try_normalize(0.0)?;
        for _ in 0..5 {
            let same = self.samples.iter().filter(|sample| normal(sample).dot(&up) >= SAME_COS);
            let sum = same.fold(Vector3::zeros(), |sum, s| sum + normal(s) * f64::from(s.area));
            up = sum.try_normalize(0.0)?;
        }
        Some(up)
    }
}

impl Floor {
    /// A floor so far below a first camera whose image's top is up.
    pub fn below_level_camera(camera_height_m: f64) -> Self {
        Self::of(-Vector3::y(), camera_height_m)
    }

    fn of(up: Vector3<f64>, camera_height_m: f64) -> Self {
        // The view along up has no direction on the floor: there the image's top leads.
        let ahead = |axis: Vector3<f64>| (axis - up * axis.dot(&up)).try_normalize(1e-3);
        let x = ahead(Vector3::z()).or_else(|| ahead(-Vector3::y())).unwrap_or_else(Vector3::x);
        let rotation = Matrix3::from_rows(&[x.transpose(), up.cross(&x).transpose(), up.transpose()]);
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
        let origin = Vector3::new(0.0, 0.0, camera_height_m);
        Self {
            grid_from_world: Pose::from_parts(origin.into(), rotation),
            camera_height_m,
            tilt_deg: (-up.y).clamp(-1.0, 1.0).acos().to_degrees(),
        }
    }
}

fn normal(sample: &FloorSample) -> Vector3<f64> {
    Vector3::from(sample.normal.map(f64::from))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    fn plane(height_m: f64, n: usize, depth_m: f32, up: Vector3<f64>) -> Vec<Vertex> {
        let side = up.cross(&Vector3::x()).normalize();
        let place = |k: usize| up * height_m + side * f64::from(k as u32 % 50) * 0.02;
        let vertex = |k: usize| {
            let at = place(k);
            Vertex {
                position: [at.x as f32 + 0.01 * (k / 50) as f32, at.y as f32, at.z as f32 + depth_m],
                normal: up.map(|v| v as f32).into(),
                flags_rgb: Vertex::pack(Vertex::VALID, 0, [0; 3]),
                ..Vertex::default()
            }
        };
        (0..n * STRIDE).map(vertex).collect()
    }

    #[test]
    fn the_floor_is_the_lowest_large_level_and_its_frame_stands_on_it() {
        // The camera looks down by 20 degrees; a table has twice the area of the floor.
        let tilt = 20f64.to_radians();
        let up = Vector3::new(0.0, -tilt.cos(), -tilt.sin());
        let mut finder = FloorFinder::default();
        for (height_m, n) in [(-0.52, 800), (-1.23, 400), (-1.6, 20)] {
            finder.add(&plane(height_m, n, 0.0, up), &Pose::identity(), 4.0);
        }
        finder.add(&plane(-3.0, 5000, 9.0, up), &Pose::identity(), 4.0);
        let floor = finder.find().unwrap();
        assert!((floor.camera_height_m - 1.23).abs() < 1e-3, "{floor:?}");
        assert!((floor.tilt_deg - 20.0).abs() < 0.01, "{floor:?}");
        let on_floor = floor.grid_from_world * Point3::from(up * -1.23);
        assert!(on_floor.coords.norm() < 1e-3, "{on_floor}");
        let ahead = floor.grid_from_world * Point3::new(0.0, 0.0, 1.0);
        assert!((ahead.x - tilt.cos()).abs() < 1e-6 && ahead.y.abs() < 1e-9, "{ahead}");
        let right = floor.grid_from_world * Point3::new(1.0, 0.0, 0.0);
        assert!((right.y + 1.0).abs() < 1e-6, "{right}");
    }

    #[test]
    fn walls_are_no_floor_and_a_level_camera_has_one_when_told() {
        let mut finder = FloorFinder::default();
        finder.add(&plane(1.0, 900, 2.0, Vector3::new(0.0, 0.0, -1.0)), &Pose::identity(), 4.0);
        assert_eq!(finder.find(), None);
        let at = Floor::below_level_camera(0.8).grid_from_world * Point3::new(0.0, 0.8, 2.0);
        assert!((at - Point3::new(2.0, 0.0, 0.0)).norm() < 1e-9, "{at}");
    }
}
