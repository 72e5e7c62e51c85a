//! A surface as seen from one place, and how far a point is from it.

use nalgebra::{Point3, Vector3};
use tessera_geometry::{Camera, Pose, RollingShutter, Twist};
use tessera_numerics::lanes::{LANES, Lanes, Real, transform};
use tessera_surface::{SurfaceView, Vertex};

/// A surface and where its camera stood.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The camera of the depth image.
    pub camera: &'a Camera,
    /// The surface, in the camera's frame.
    pub surface: SurfaceView<'a>,
    /// Pose of the camera at the frame's stamp.
    pub world_from_camera: Pose,
    /// Its motion per second in its own frame, for the rolling shutter.
    pub velocity: Twist,
}

/// Measurements of eight points by a view.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SeenLine {
    /// Whether a point was measured, and is not too far behind the surface; else nothing below counts.
    pub(crate) is_seen: [bool; LANES],
    /// Signed distance to the surface, metres; positive in front.
    pub(crate) distance_m: Lanes,
    /// Depth of the surface there, metres.
    pub(crate) depth_m: Lanes,
    /// Cosine of the angle between the surface's normal and the line of sight.
    pub(crate) cosine: Lanes,
    /// The quad that it is seen in, by its first node.
    quad: [usize; LANES],
    /// Weights of the quad's corners.
    weights: [[f32; 4]; LANES],
}

/// A vertex as it is looked up again and again: the normal of its tangent plane, less that plane's distance
/// from the camera in metres, depth in metres, and the cosine of the angle between the normal and the line
/// of sight, NaN where nothing was measured. Two numbers are spare, so that it is added as one.
type QuadCorner = [f32; LANES];
const DEPTH: usize = 4;
const COSINE: usize = 5;

/// A view with its poses tabulated for every row of the grid, and its quads tested.
pub(crate) struct PreparedView<'a> {
    view: &'a View<'a>,
    max_depth_m: f32,
    projection: GridProjection,
    nodes: Vec<QuadCorner>,
    /// Red, green, blue of each node; one is spare.
    colours: Vec<[f32; 4]>,
    /// Whether the quad below and to the right of each node is one piece of a surface.
    is_quad: Vec<bool>,
    /// Rotation row by row, then translation, of each row of the grid.
    camera_from_world: Vec<[f32; 12]>,
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
        let camera_from_world: Vec<[f32; 12]> =
            world_from_camera.iter().map(|pose| numbers(&pose.inverse())).collect();
        let is_rolling = camera_from_world.windows(2).any(|rows| rows[0] != rows[1]);
        let nodes: Vec<QuadCorner> = view.surface.vertices.iter().map(|v| node(v, max_depth_m)).collect();
        let colour = |vertex: &Vertex| {
            let [r, g, b] = vertex.rgb().map(f32::from);
            [r, g, b, 0.0]
        };
        Self {
            view,
            max_depth_m,
            projection: GridProjection::new(view.camera, grid.step),
            is_quad: (0..nodes.len()).map(|k| is_one_surface(&nodes, k, grid.width)).collect(),
            nodes,
            colours: view.surface.vertices.iter().map(colour).collect(),
            camera_from_world,
            world_from_camera,
            is_rolling,
        }
    }

    /// Whether the camera moved during the readout.
    pub(crate) fn is_rolling(&self) -> bool {
        self.is_rolling
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

    /// How far eight points of the world are from the surface. Not seen is what was not measured, and what
    /// is farther behind it than `least_distance_m`, a negative number.
    #[inline(always)]
    pub(crate) fn look<const IS_ROLLING: bool>(
        &self,
        point_in_world: [Lanes; 3],
        least_distance_m: f32,
    ) -> SeenLine {
        let grid = &self.view.surface.grid;
        let mut point = transform(&self.camera_from_world[grid.height / 2], point_in_world);
        let (mut row, mut column) = self.projection.project(point);
        if IS_ROLLING {
            // The row decides on the pose, and the pose on the row: once more from where it falls first.
            for k in 0..LANES {
                let at_row = row.0[k].clamp(0.0, grid.height as f32 - 1.0) as usize;
                let moved = transform(&self.camera_from_world[at_row], point_in_world.map(|axis| axis.0[k]));
                point.iter_mut().zip(moved).for_each(|(axis, value)| axis.0[k] = value);
            }
            (row, column) = self.projection.project(point);
        }
        self.measure(point, (row, column), least_distance_m)
    }

    /// Measurement by the quads around eight points of the camera's frame, projected to `row` and `column`.
    #[inline(always)]
    fn measure(&self, point: [Lanes; 3], (row, column): (Lanes, Lanes), least_distance_m: f32) -> SeenLine {
        let grid = &self.view.surface.grid;
        let (last_row, last_column) = (grid.height as f32 - 1.0, grid.width as f32 - 1.0);
        let (mut is_inside, mut quad, mut weights) = ([false; LANES], [0; LANES], [[0.0; 4]; LANES]);
        // Corners of each point's quad, all at once in memory, lest the compiler take them apart.
        let mut said: [QuadCorner; LANES] = [[0.0; LANES]; LANES];
        for k in 0..LANES {
            let (at_row, at_column) = (row.0[k], column.0[k]);
            let is_in_grid =
                (at_row >= 0.0) & (at_column >= 0.0) & (at_row < last_row) & (at_column < last_column);
            if !(is_in_grid & (point[2].0[k] > 0.0)) {
                continue;
            }
            let (r, c) = (at_row as usize, at_column as usize);
            let first = r * grid.width + c;
            if !self.is_quad[first] {
                continue;
            }
            let (v, u) = (at_row - r as f32, at_column - c as f32);
            let shares = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
            let [a, b, c, d] = corners(first, grid.width).map(|corner| &self.nodes[corner]);
            for (at, sum) in said[k].iter_mut().enumerate() {
                *sum = a[at] * shares[0] + b[at] * shares[1] + c[at] * shares[2] + d[at] * shares[3];
            }
            (is_inside[k], quad[k], weights[k]) = (true, first, shares);
        }
        let [nx, ny, nz, offset, depth_m, cosine] =
            std::array::from_fn(|at| Lanes(std::array::from_fn(|k| said[k][at])));
        let distance_m = nx * point[0] + ny * point[1] + nz * point[2] + offset;
        let is_seen = std::array::from_fn(|k| {
            is_inside[k] & (distance_m.0[k] >= least_distance_m) & (cosine.0[k] > LEAST_COSINE)
        });
        SeenLine { is_seen, distance_m, depth_m, cosine, quad, weights }
    }

    /// Red, green, blue of the surface where one of the points was seen.
    #[inline(always)]
    pub(crate) fn colour(&self, seen: &SeenLine, k: usize) -> [f32; 3] {
        let mut rgb = [0.0; 4];
        let corners = corners(seen.quad[k], self.view.surface.grid.width);
        for (corner, weight) in corners.into_iter().zip(seen.weights[k]) {
            rgb.iter_mut().zip(self.colours[corner]).for_each(|(sum, c)| *sum += weight * c);
        }
        [rgb[0], rgb[1], rgb[2]]
    }
}

/// The camera in coordinates of the grid and `f32`.
struct GridProjection {
    fx: f32,
    fy: f32,
    cx: f32,
    cy: f32,
    distortion: [f32; 5],
}

impl GridProjection {
    fn new(camera: &Camera, step: usize) -> Self {
        let per_step = 1.0 / step as f64;
        let [fx, fy, cx, cy] =
            [camera.fx, camera.fy, camera.cx, camera.cy].map(|value| (value * per_step) as f32);
        Self { fx, fy, cx, cy, distortion: camera.distortion.map(|k| k as f32) }
    }

    /// Row and column of points of the camera's frame.
    #[inline(always)]
    fn project(&self, p: [Lanes; 3]) -> (Lanes, Lanes) {
        let [k1, k2, p1, p2, k3] = self.distortion.map(Lanes::splat);
        let (one, two) = (Lanes::splat(1.0), Lanes::splat(2.0));
        let inverse = one / p[2];
        let (x, y) = (p[0] * inverse, p[1] * inverse);
        let (xx, xy, yy) = (x * x, x * y, y * y);
        let r2 = xx + yy;
        let radial = one + r2 * (k1 + r2 * (k2 + r2 * k3));
        let xd = x * radial + two * p1 * xy + p2 * (r2 + two * xx);
        let yd = y * radial + p1 * (r2 + two * yy) + two * p2 * xy;
        let [fx, fy, cx, cy] = [self.fx, self.fy, self.cx, self.cy].map(Lanes::splat);
        (fy * yd + cy, fx * xd + cx)
    }
}

/// Rotation row by row, then translation.
fn numbers(pose: &Pose) -> [f32; 12] {
    let (rotation, t) = (pose.rotation.to_rotation_matrix(), &pose.translation);
    let r = rotation.matrix().transpose();
    std::array::from_fn(|k| if k < 9 { r.as_slice()[k] as f32 } else { t.vector[k - 9] as f32 })
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
    [normal.x, normal.y, normal.z, offset, position.z, cosine, 0.0, 0.0]
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
    let depths = corners.map(|node| node[DEPTH]);
    let nearest = depths.into_iter().fold(f32::INFINITY, f32::min);
    let farthest = depths.into_iter().fold(f32::NEG_INFINITY, f32::max);
    corners.iter().all(|node| !node[COSINE].is_nan()) && farthest - nearest < MOST_SLOPE * nearest
}
