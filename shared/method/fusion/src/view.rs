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
    /// The quad that it is seen in, by its first node.
    quad: usize,
    /// Weights of the quad's corners.
    weights: [f32; 4],
}

/// A point in the camera's frame and where in the grid it is seen.
#[derive(Clone, Copy)]
pub(crate) struct ProjectedPoint {
    at: Vector3<f32>,
    row: f32,
    column: f32,
}

/// A vertex as it is looked up again and again: 32 bytes.
#[derive(Clone, Copy)]
struct QuadCorner {
    /// Normal of the tangent plane, and less its distance from the camera, metres.
    plane: [f32; 4],
    depth_m: f32,
    /// Cosine of the angle between the normal and the line of sight; NaN where nothing was measured.
    cosine: f32,
    rgb: [u8; 3],
}

/// A view with its poses tabulated for every row of the grid, and its quads tested.
pub(crate) struct PreparedView<'a> {
    view: &'a View<'a>,
    max_depth_m: f32,
    nodes: Vec<QuadCorner>,
    /// Whether the quad below and to the right of each node is one piece of a surface.
    is_quad: Vec<bool>,
    camera_from_world: Vec<Isometry3<f32>>,
    world_from_camera: Vec<Pose>,
    /// Whether the camera moved during the readout.
    is_rolling: bool,
}

impl<'a> PreparedView<'a> {
    pub(crate) fn new(view: &'a View<'a>, max_depth_m: f64) -> Self {
        let grid = &view.surface.grid;
        let max_depth_m = max_depth_m as f32;
        let shutter = RollingShutter::new(view.camera, &view.velocity, grid.step);
        let world_from_camera: Vec<Pose> = (0..grid.height)
            .map(|row| view.world_from_camera * shutter.stamp_from_row((row * grid.step) as f64))
            .collect();
        let camera_from_world: Vec<Isometry3<f32>> =
            world_from_camera.iter().map(|pose| pose.inverse().cast::<f32>()).collect();
        let is_rolling = camera_from_world.windows(2).any(|rows| rows[0] != rows[1]);
        let nodes: Vec<QuadCorner> = view.surface.vertices.iter().map(|v| node(v, max_depth_m)).collect();
        let is_quad = (0..nodes.len()).map(|k| is_one_surface(&nodes, k, grid.width)).collect();
        Self { view, max_depth_m, nodes, is_quad, camera_from_world, world_from_camera, is_rolling }
    }

    /// Usable vertices: point and normal in the world.
    pub(crate) fn points(&self) -> impl Iterator<Item = (Vector3<f64>, Vector3<f64>)> + '_ {
        let surface = &self.view.surface;
        let rows = surface.vertices.chunks(surface.grid.width.max(1)).zip(&self.world_from_camera);
        rows.flat_map(move |(row, pose)| {
            let near = row.iter().filter(move |vertex| is_usable(vertex, self.max_depth_m));
            near.map(move |vertex| {
                let point = Point3::from(vertex.position.map(f64::from));
                ((pose * point).coords, pose.rotation * Vector3::from(vertex.normal.map(f64::from)))
            })
        })
    }

    /// Points of the world along x, `spacing_m` apart from the first one, as the camera sees them.
    #[inline]
    pub(crate) fn project_line<const LANES: usize>(
        &self,
        first: &Vector3<f32>,
        spacing_m: f32,
    ) -> [ProjectedPoint; LANES] {
        let grid = &self.view.surface.grid;
        let camera_from_world = &self.camera_from_world[grid.height / 2];
        let start = (camera_from_world * Point3::from(*first)).coords;
        let along = camera_from_world.rotation * Vector3::x() * spacing_m;
        let mut line = std::array::from_fn(|k| self.project(start + along * k as f32));
        if self.is_rolling {
            // The row decides on the pose, and the pose on the row: once more from where it falls first.
            for (k, seen) in line.iter_mut().enumerate() {
                let row = seen.row.clamp(0.0, grid.height as f32 - 1.0) as usize;
                let point = first + Vector3::x() * (spacing_m * k as f32);
                *seen = self.project((self.camera_from_world[row] * Point3::from(point)).coords);
            }
        }
        line
    }

    /// How far a projected point is from the surface; `None` where nothing was measured, or where the
    /// point is farther behind it than `least_distance_m`, a negative number.
    #[inline]
    pub(crate) fn look(&self, point: &ProjectedPoint, least_distance_m: f32) -> Option<SeenPoint> {
        let grid = &self.view.surface.grid;
        let ProjectedPoint { at, row, column } = *point;
        if !(row >= 0.0 && column >= 0.0 && at.z > 0.0) {
            return None;
        }
        let (r, c) = (row as usize, column as usize);
        if r + 1 >= grid.height || c + 1 >= grid.width {
            return None;
        }
        let quad = r * grid.width + c;
        if !self.is_quad[quad] {
            return None;
        }
        let (v, u) = (row - r as f32, column - c as f32);
        let weights = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
        let corners = corners(quad, grid.width).map(|k| &self.nodes[k]);
        let mut plane = [0.0; 4];
        let (mut depth_m, mut cosine) = (0.0, 0.0);
        for (node, weight) in corners.into_iter().zip(weights) {
            plane.iter_mut().zip(node.plane).for_each(|(sum, p)| *sum += weight * p);
            depth_m += weight * node.depth_m;
            cosine += weight * node.cosine;
        }
        let distance_m = plane[0] * at.x + plane[1] * at.y + plane[2] * at.z + plane[3];
        let is_seen = distance_m >= least_distance_m && cosine > LEAST_COSINE;
        is_seen.then_some(SeenPoint { distance_m, depth_m, cosine, quad, weights })
    }

    /// Red, green, blue of the surface where the point was seen.
    pub(crate) fn colour(&self, seen: &SeenPoint) -> [f32; 3] {
        let mut rgb = [0.0; 3];
        for (k, weight) in corners(seen.quad, self.view.surface.grid.width).into_iter().zip(seen.weights) {
            rgb.iter_mut().zip(self.nodes[k].rgb).for_each(|(sum, c)| *sum += weight * f32::from(c));
        }
        rgb
    }

    #[inline]
    fn project(&self, at: Vector3<f32>) -> ProjectedPoint {
        let camera = self.view.camera;
        let per_step = 1.0 / self.view.surface.grid.step as f64;
        let (x, y) = camera.distort(f64::from(at.x / at.z), f64::from(at.y / at.z));
        let row = ((camera.fy * y + camera.cy) * per_step) as f32;
        let column = ((camera.fx * x + camera.cx) * per_step) as f32;
        ProjectedPoint { at, row, column }
    }
}

/// Corners of a quad farther apart in depth than this share of it are on two surfaces.
const MOST_SLOPE: f32 = 0.06;
/// A surface seen at a flatter angle is not measured.
const LEAST_COSINE: f32 = 0.1;

fn is_usable(vertex: &Vertex, max_depth_m: f32) -> bool {
    vertex.is_valid() && vertex.position[2] <= max_depth_m
}

fn node(vertex: &Vertex, max_depth_m: f32) -> QuadCorner {
    let (position, normal) = (Vector3::from(vertex.position), Vector3::from(vertex.normal));
    let offset = -normal.dot(&position);
    let cosine = if is_usable(vertex, max_depth_m) { offset / position.norm() } else { f32::NAN };
    let plane = [normal.x, normal.y, normal.z, offset];
    QuadCorner { plane, depth_m: position.z, cosine, rgb: vertex.rgb() }
}

/// The corners of the quad below and to the right of node `k`.
fn corners(k: usize, width: usize) -> [usize; 4] {
    [k, k + 1, k + width, k + width + 1]
}

/// Whether all corners of a quad were measured, at depths of one surface; no node of the last row or
/// column has one.
fn is_one_surface(nodes: &[QuadCorner], k: usize, width: usize) -> bool {
    if k % width + 1 >= width || k + width + 1 >= nodes.len() {
        return false;
    }
    let corners = corners(k, width).map(|k| &nodes[k]);
    let depths = corners.map(|node| node.depth_m);
    let nearest = depths.into_iter().fold(f32::INFINITY, f32::min);
    let farthest = depths.into_iter().fold(f32::NEG_INFINITY, f32::max);
    corners.iter().all(|node| !node.cosine.is_nan()) && farthest - nearest < MOST_SLOPE * nearest
}
