//! From a feature's pixel to a ray in the depth camera's frame at the frame's stamp, and to the point
//! where the ray meets the surface (method 14.2).
//!
//! The colour camera is taken as the depth camera with another focal length about the same principal
//! point, exposed `lag_s` later. A pixel's ray starts where the camera was then.

use crate::map::context::Context;
use nalgebra::Vector3;
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
        let Some((position_m, slope)) = depth else { return Observation { ray, ray_sigma, point: None } };
        // Seen from the depth camera's own centre, which the ray misses by the motion during the lag.
        let ray = [position_m.x / position_m.z, position_m.y / position_m.z];
        let noise_m = f64::from(self.context.noise.sigma_m(position_m.z as f32));
        let of_slope_m = slope * ray_sigma * position_m.z;
        let depth_sigma_m = (noise_m * noise_m + of_slope_m * of_slope_m).sqrt();
        let point = PointEstimate::on_ray(ray, ray_sigma, position_m.z, depth_sigma_m);
        Observation { ray, ray_sigma, point: Some(point) }
    }

    /// Where a ray meets the surface, and the tangent of the angle at which it does; `about_m` is about
    /// the depth there.
    #[inline(always)]
    fn meet(
        &self,
        origin: &Vector3<f64>,
        direction: &Vector3<f64>,
        about_m: f32,
    ) -> Option<(Vector3<f64>, f64)> {
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
        (position.z > 0.0).then(|| (position, ((1.0 - cosine * cosine).max(0.0)).sqrt() / cosine))
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

    /// The vertex of the cell of a pixel of the depth image, and its row.
    #[inline(always)]
    fn vertex_at(&self, row: f64, column: f64) -> Option<(Vertex, usize)> {
        let grid = self.context.grid;
        let cell = |pixel: f64, n: usize| {
            let place = ((pixel - self.context.offset_px) / grid.step as f64 + 0.5).floor();
            (place >= 0.0 && place < n as f64).then_some(place as usize)
        };
        let (row, column) = (cell(row, grid.height)?, cell(column, grid.width)?);
        let vertex = self.surface.vertices.get(row * grid.width + column)?;
        vertex.is_inner().then_some((*vertex, row))
    }
}
