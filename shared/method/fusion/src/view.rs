//! A surface as seen from one place, and how far a point is from it.

use nalgebra::{Isometry3, Point3, Vector3};
use tessera_geometry::{Camera, Pose, RollingShutter, Twist};
use tessera_surface::{SurfaceView, Vertex};

/// A surface and where its camera stood.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The camera of the depth image.
    pub camera: &'a Camera,
    /// The surface, in the camera's frame.
    pub surface: SurfaceView<'a>,
    /// Where the camera stood at the frame's stamp.
    pub world_from_camera: Pose,
    /// Its motion per second in its own frame, for the rolling shutter.
    pub velocity: Twist,
}

/// What a view knows of a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SeenPoint {
    /// Signed distance to the surface, metres; positive in front.
    pub(crate) distance_m: f32,
    /// Depth of the surface there, metres.
    pub(crate) depth_m: f32,
    /// Cosine of the angle between the surface's normal and the line of sight.
    pub(crate) cosine: f32,
    /// Red, green, blue.
    pub(crate) rgb: [f32; 3],
}

/// A view with its poses tabulated for every row of the grid.
pub(crate) struct PreparedView<'a> {
    view: &'a View<'a>,
    camera_from_world: Vec<Isometry3<f32>>,
    world_from_camera: Vec<Pose>,
}

impl<'a> PreparedView<'a> {
    pub(crate) fn new(view: &'a View<'a>) -> Self {
        let grid = &view.surface.grid;
        let shutter = RollingShutter::new(view.camera, &view.velocity, grid.step);
        let world_from_camera: Vec<Pose> = (0..grid.height)
            .map(|row| view.world_from_camera * shutter.stamp_from_row((row * grid.step) as f64))
            .collect();
        let camera_from_world = world_from_camera.iter().map(|pose| pose.inverse().cast::<f32>()).collect();
        Self { view, camera_from_world, world_from_camera }
    }

    /// Valid vertices not farther than `max_depth_m`: point and normal in the world.
    pub(crate) fn points(&self, max_depth_m: f64) -> impl Iterator<Item = (Vector3<f64>, Vector3<f64>)> + '_ {
        let surface = &self.view.surface;
        let rows = surface.vertices.chunks(surface.grid.width.max(1)).zip(&self.world_from_camera);
        rows.flat_map(move |(row, pose)| {
            let near = row.iter().filter(move |vertex| is_usable(vertex, max_depth_m as f32));
            near.map(move |vertex| {
                let point = Point3::from(vertex.position.map(f64::from));
                ((pose * point).coords, pose.rotation * Vector3::from(vertex.normal.map(f64::from)))
            })
        })
    }

    /// How far a point of the world is from the surface; `None` where nothing was measured.
    pub(crate) fn look(&self, point: &Vector3<f32>, max_depth_m: f32) -> Option<SeenPoint> {
        let grid = &self.view.surface.grid;
        // The row decides on the pose, and the pose on the row: once more from where it falls first.
        let middle = grid.height / 2;
        let first = self.camera_from_world.get(middle)? * Point3::from(*point);
        let (row, _) = self.project(&first)?;
        let row = (row.clamp(0.0, grid.height as f64 - 1.0)) as usize;
        let at = self.camera_from_world[row] * Point3::from(*point);
        let (row, column) = self.project(&at)?;
        if !(row >= 0.0 && column >= 0.0) {
            return None;
        }
        let (r, c) = (row as usize, column as usize);
        if r + 1 >= grid.height || c + 1 >= grid.width {
            return None;
        }
        let (v, u) = ((row - r as f64) as f32, (column - c as f64) as f32);
        let k = r * grid.width + c;
        let corners = [
            (k, (1.0 - u) * (1.0 - v)),
            (k + 1, u * (1.0 - v)),
            (k + grid.width, (1.0 - u) * v),
            (k + grid.width + 1, u * v),
        ];
        self.mean(&at.coords, corners, max_depth_m)
    }

    /// Row and column in the grid.
    fn project(&self, point: &Point3<f32>) -> Option<(f64, f64)> {
        let (row, column) = self.view.camera.project(&point.coords.cast::<f64>())?;
        let step = self.view.surface.grid.step as f64;
        Some((row / step, column / step))
    }

    /// The mean of the corners of a quad; none where it is no quad of one surface.
    fn mean(&self, at: &Vector3<f32>, corners: [(usize, f32); 4], max_depth_m: f32) -> Option<SeenPoint> {
        let mut seen = SeenPoint { distance_m: 0.0, depth_m: 0.0, cosine: 0.0, rgb: [0.0; 3] };
        let mut depths = [f32::INFINITY, f32::NEG_INFINITY];
        for (k, weight) in corners {
            let vertex = &self.view.surface.vertices[k];
            if !is_usable(vertex, max_depth_m) {
                return None;
            }
            let (position, normal) = (Vector3::from(vertex.position), Vector3::from(vertex.normal));
            seen.distance_m += weight * normal.dot(&(at - position));
            seen.depth_m += weight * position.z;
            seen.cosine -= weight * normal.dot(&position) / position.norm();
            seen.rgb.iter_mut().zip(vertex.rgb()).for_each(|(sum, c)| *sum += weight * f32::from(c));
            depths = [depths[0].min(position.z), depths[1].max(position.z)];
        }
        let is_one = depths[1] - depths[0] < MOST_SLOPE * depths[0];
        (is_one && seen.cosine > LEAST_COSINE).then_some(seen)
    }
}

/// Corners of a quad farther apart in depth than this share of it are on two surfaces.
const MOST_SLOPE: f32 = 0.06;
/// A surface seen at a flatter angle is not measured.
const LEAST_COSINE: f32 = 0.1;

fn is_usable(vertex: &Vertex, max_depth_m: f32) -> bool {
    vertex.is_valid() && vertex.position[2] <= max_depth_m
}
