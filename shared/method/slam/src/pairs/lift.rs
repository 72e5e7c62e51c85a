//! From a feature's pixel to a ray in the depth camera's frame at the frame's stamp, and to the point
//! where the ray meets the surface (method 14.2).
//!
//! The colour camera is taken as the depth camera with another focal length about the same principal
//! point, exposed `lag_s` later. A pixel's ray starts where the camera was then.

use crate::estimation::MISSED;
use crate::map::context::Context;
use nalgebra::{Matrix3, Vector3};
use tessera_features::{Feature, Observation, PointEstimate};
use tessera_geometry::Twist;
use tessera_surface::{SurfaceView, Vertex};

/// A point moved by `exp(velocity seconds)`, as the series up to the second order.
#[inline(always)]
fn moved(p: &Vector3<f64>, velocity: &Twist, seconds: f64) -> Vector3<f64> {
    let first = velocity.phi.cross(p) + velocity.rho;
    p + first * seconds + velocity.phi.cross(&first) * (0.5 * seconds * seconds)
}

/// A direction turned by `exp(velocity seconds)`, as the series up to the second order.
#[inline(always)]
fn turned(d: &Vector3<f64>, velocity: &Twist, seconds: f64) -> Vector3<f64> {
    let first = velocity.phi.cross(d);
    d + first * seconds + velocity.phi.cross(&first) * (0.5 * seconds * seconds)
}

#[inline(always)]
fn vector(v: [f32; 3]) -> Vector3<f64> {
    Vector3::from(v.map(f64::from))
}

/// Observations of a frame's features at its stamp: rays, with points where the surface has depth.
///
/// `velocity`: the frame's own motion per second in its camera frame.
pub(crate) fn lift(
    context: &Context,
    features: &[Feature],
    surface: &SurfaceView<'_>,
    velocity: &Twist,
) -> Vec<Observation> {
    let arch = context.registration.isa.arch();
    arch.dispatch(Lift { lifter: Lifter { context, surface, velocity }, features })
}

/// All features lifted, compiled for each instruction set: rounding down is an instruction on most, and a
/// call where the oldest processors are served as well.
struct Lift<'a> {
    lifter: Lifter<'a>,
    features: &'a [Feature],
}

impl pulp::WithSimd for Lift<'_> {
    type Output = Vec<Observation>;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) -> Vec<Observation> {
        let Self { lifter, features } = self;
        let mut observations = Vec::with_capacity(features.len());
        for feature in features {
            observations.push(lifter.observe(feature));
        }
        observations
    }
}

struct Lifter<'a> {
    context: &'a Context,
    surface: &'a SurfaceView<'a>,
    velocity: &'a Twist,
}

impl Lifter<'_> {
    #[inline(always)]
    fn observe(&self, feature: &Feature) -> Observation {
        let camera = &self.context.camera;
        let [depth_row, depth_column] = self.pixel_of_depth(feature);
        let direction = camera.ray(depth_row, depth_column);
        let seconds = self.context.colour.lag_s + camera.row_time_s(f64::from(feature.pixel[0]));
        let direction = turned(&direction, self.velocity, seconds);
        let direction = direction / direction.z;
        let origin = moved(&Vector3::zeros(), self.velocity, seconds);
        let focal_px = camera.focal_px() * self.context.colour.focal_ratio;
        let ray_sigma = f64::from(feature.sigma_px) / focal_px;
        let beside = self.vertex_at(depth_row, depth_column);
        // A match, not a closure: that would be compiled apart, for the oldest processors.
        let depth = match beside {
            Some((vertex, _)) => self.meet(&origin, &direction, vertex.position[2]),
            None => None,
        };
        let ray = [direction.x, direction.y];
        let Some((position_m, slope, is_inner)) = depth else {
            return Observation { ray, ray_sigma, point: None };
        };
        // Seen from the depth camera's own centre, which the ray misses by the motion during the lag.
        let ray = [position_m.x / position_m.z, position_m.y / position_m.z];
        let noise_m = f64::from(self.context.noise.sigma_m(position_m.z as f32));
        let of_slope_m = slope * ray_sigma * position_m.z;
        let depth_sigma_m = (noise_m * noise_m + of_slope_m * of_slope_m).sqrt();
        let point = PointEstimate::on_ray(ray, ray_sigma, position_m.z, depth_sigma_m);
        Observation { ray, ray_sigma, point: Some(PointEstimate { is_inner, ..point }) }
    }

    /// Where a ray meets the surface, the tangent of the angle at which it does, and whether inside it; `about_m` is
    /// about the depth there.
    #[inline(always)]
    fn meet(
        &self,
        origin: &Vector3<f64>,
        direction: &Vector3<f64>,
        about_m: f32,
    ) -> Option<(Vector3<f64>, f64, bool)> {
        let (vertex, grid_row) = self.vertex(&(origin + direction * f64::from(about_m)))?;
        let camera = &self.context.camera;
        let row = (grid_row * self.context.grid.step) as f64 + self.context.offset_px;
        let seconds = camera.row_time_s(row);
        let on_surface = moved(&vector(vertex.position), self.velocity, seconds);
        let normal = turned(&vector(vertex.normal), self.velocity, seconds);
        let along = normal.dot(direction);
        let cosine = along.abs() / (direction.norm() * normal.norm());
        let position = origin + direction * (normal.dot(&(on_surface - origin)) / along);
        // A ray along the surface meets it nowhere.
        let slope = ((1.0 - cosine * cosine).max(0.0)).sqrt() / cosine;
        (position.z > 0.0).then(|| (position, slope, vertex.is_inner()))
    }

    /// The vertex of the cell in which a point of the frame at its stamp is seen, and its row.
    #[inline(always)]
    fn vertex(&self, point: &Vector3<f64>) -> Option<(Vertex, usize)> {
        let camera = &self.context.camera;
        let (mut row, mut column) = camera.project(point)?;
        if camera.readout_s != 0.0 {
            let seconds = -camera.row_time_s(row.clamp(0.0, f64::from(camera.height)));
            (row, column) = camera.project(&turned(point, self.velocity, seconds))?;
        }
        self.vertex_at(row, column)
    }

    #[inline(always)]
    fn pixel_of_depth(&self, feature: &Feature) -> [f64; 2] {
        let [row, column] = feature.pixel.map(f64::from);
        self.context.colour.pixel_of_depth(&self.context.camera, row, column)
    }

    /// The vertex of the cell of a pixel of the depth image, and its row: inside a surface, or at a border where that
    /// goes on beyond a gap.
    #[inline(always)]
    fn vertex_at(&self, row: f64, column: f64) -> Option<(Vertex, usize)> {
        let grid = self.context.grid;
        let cell = |pixel: f64, n: usize| {
            let place = ((pixel - self.context.offset_px) / grid.step as f64 + 0.5).floor();
            (place >= 0.0 && place < n as f64).then_some(place as usize)
        };
        let (row, column) = (cell(row, grid.height)?, cell(column, grid.width)?);
        let vertex = self.surface.vertices.get(row * grid.width + column)?;
        let vertex = if vertex.is_inner() { *vertex } else { self.on_plane(vertex, [row, column])? };
        Some((vertex, row))
    }

    /// A vertex at a border, on the plane of itself and the next ones that were measured up and down its column, along
    /// its row and both diagonals, where all nine agree with one. So a surface goes on beyond a gap; a silhouette,
    /// behind which a structured light camera measures nothing for a while, moves along its object with the view, and
    /// is no point. Unlike those inside, borders are not smoothed: the plane does that.
    ///
    /// A plane `n . p = 1` is linear in inverse depth, `1/z = n . (x/z, y/z, 1)`, where triangulation's noise is the
    /// same at all depths.
    fn on_plane(&self, vertex: &Vertex, [row, column]: [usize; 2]) -> Option<Vertex> {
        let SurfaceView { grid, vertices } = *self.surface;
        if !vertex.is_valid() {
            return None;
        }
        let beside = |at: usize, by: isize, n: usize| at.checked_add_signed(by).filter(|at| *at < n);
        let next = |[down, right]: [isize; 2]| {
            let step =
                |[r, c]: &[usize; 2]| Some([beside(*r, down, grid.height)?, beside(*c, right, grid.width)?]);
            let cells = std::iter::successors(step(&[row, column]), step);
            cells.map(|[r, c]| &vertices[r * grid.width + c]).find(|other| other.is_valid())
        };
        // Down and right: the last of nine is the vertex itself.
        let directions = (-1..=1).flat_map(|down| (-1..=1).map(move |right| [down, right]));
        let mut measured = [*vertex; 9];
        for (other, direction) in measured.iter_mut().zip(directions.filter(|d| *d != [0, 0])) {
            *other = *next(direction)?;
        }
        let measured = measured.map(|v| {
            let point = vector(v.position);
            let sigma_m = f64::from(self.context.noise.sigma_m(v.position[2]));
            Measured {
                ray: point / point.z,
                inverse_depth: 1.0 / point.z,
                weight: (point.z * point.z / sigma_m).powi(2),
            }
        });
        let plane = plane(&measured)?;
        let pixel = [row, column].map(|k| (k * grid.step) as f64 + self.context.offset_px);
        let ray = self.context.camera.ray(pixel[0], pixel[1]);
        let depth_m = 1.0 / plane.dot(&ray);
        let [position, normal] = [ray * depth_m, -plane.normalize()].map(|v| v.map(|v| v as f32).into());
        (depth_m > 0.0).then_some(Vertex { position, normal, ..*vertex })
    }
}

/// A vertex as measured.
struct Measured {
    /// `(x/z, y/z, 1)`.
    ray: Vector3<f64>,
    /// Per metre.
    inverse_depth: f64,
    /// Inverse variance of the inverse depth, metres².
    weight: f64,
}

/// The plane of vertices, `n` of `n . p = 1`, per metre, by least squares of their inverse depths; `None` where they
/// are on none: beyond the chi-square of the six that are left of nine at which a plane is missed seldom enough.
fn plane(measured: &[Measured; 9]) -> Option<Vector3<f64>> {
    let (mut information, mut sum) = (Matrix3::zeros(), Vector3::zeros());
    for Measured { ray, inverse_depth, weight } in measured {
        information += ray * ray.transpose() * *weight;
        sum += ray * (inverse_depth * weight);
    }
    let plane = information.cholesky()?.solve(&sum);
    let squared = measured.iter().map(|m| (plane.dot(&m.ray) - m.inverse_depth).powi(2) * m.weight);
    let half = 0.5 * squared.sum::<f64>();
    // Of six degrees of freedom it is larger with this probability.
    let larger = libm::exp(-half) * (1.0 + half + 0.5 * half * half);
    (larger >= MISSED).then_some(plane)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::test_wall::context;

    /// Depth at which a feature is seen on the border of a wall 2 m away: seven columns beside it nothing is measured,
    /// and from there on a depth or nothing.
    fn depth_beside(beyond_m: Option<f32>) -> Option<f64> {
        let context = context();
        let (grid, camera) = (context.grid, &context.camera);
        let at = [grid.height / 2, grid.width / 2];
        let vertex = |cell: usize| {
            let (row, column) = (cell / grid.width, cell % grid.width);
            let depth_m = if column <= at[1] { Some(2.0) } else { beyond_m.filter(|_| column > at[1] + 7) };
            let Some(depth_m) = depth_m else { return Vertex::default() };
            let pixel = [row, column].map(|k| (k * grid.step) as f64 + context.offset_px);
            let ray = camera.ray(pixel[0], pixel[1]).map(|v| v as f32 * depth_m);
            let border = if column == at[1] { Vertex::BOUNDARY } else { 0 };
            let flags_rgb = Vertex::pack(Vertex::VALID | border, 0, [0; 3]);
            Vertex { position: ray.into(), normal: [0.0, 0.0, -1.0], flags_rgb, reserved: 0 }
        };
        let vertices: Vec<Vertex> = (0..grid.len()).map(vertex).collect();
        let pixel = at.map(|k| (k * grid.step) as f32 + context.offset_px as f32);
        let feature = Feature { pixel, sigma_px: 2.0, ..Feature::default() };
        let surface = SurfaceView { grid, vertices: &vertices };
        let seen = lift(&context, &[feature], &surface, &Twist::default());
        seen[0].point.map(|point| point.position_m.z)
    }

    #[test]
    fn a_border_has_depth_where_its_surface_goes_on_beyond_the_gap_alone() {
        assert!(depth_beside(Some(2.0)).is_some_and(|z| (z - 2.0).abs() < 1e-3));
        assert_eq!(
            depth_beside(Some(2.5)),
            None,
            "the wall ends before something, in whose shadow nothing is measured"
        );
        assert_eq!(depth_beside(Some(1.5)), None, "something is before the wall");
        assert_eq!(depth_beside(None), None, "nothing tells where the wall ends");
    }

    #[test]
    fn nine_depths_are_on_a_plane_or_at_a_step_within_the_noise_of_single_ones() {
        let sigma = 0.003;
        let found = |off_sigmas: [f64; 9]| {
            let measured = std::array::from_fn(|k| {
                let ray = Vector3::new(0.01 * (k % 3) as f64, 0.01 * (k / 3) as f64, 1.0);
                let inverse_depth = Vector3::new(0.5, -0.2, 0.4).dot(&ray) + sigma * off_sigmas[k];
                Measured { ray, inverse_depth, weight: 1.0 / (sigma * sigma) }
            });
            plane(&measured)
        };
        let exact = found([0.0; 9]).unwrap();
        assert!((exact - Vector3::new(0.5, -0.2, 0.4)).norm() < 1e-9, "{exact}");
        assert!(found([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0]).is_some());
        // The middle column and the left one are beside the right one: no residual of the plane is beyond 2.
        let step = [0.0, 0.0, 6.0];
        assert_eq!(found(std::array::from_fn(|k| step[k % 3])), None);
    }
}
