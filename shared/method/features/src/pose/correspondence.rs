//! Observations of a matched feature.

use nalgebra::{Matrix3, Vector2, Vector3};

/// A point with its uncertainty, in the frame of its camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointEstimate {
    /// Position, metres.
    pub position_m: Vector3<f64>,
    /// Covariance, metres²; positive definite.
    pub covariance_m2: Matrix3<f64>,
    /// Whether it is inside a surface, and not at its border.
    pub is_inner: bool,
}

impl PointEstimate {
    /// The point inside a surface at depth `depth_m` on a ray `(x/z, y/z)`: standard deviation `depth_sigma_m` along
    /// the ray's depth and `ray_sigma * depth` across.
    pub fn on_ray(ray: [f64; 2], ray_sigma: f64, depth_m: f64, depth_sigma_m: f64) -> Self {
        let direction = Vector3::new(ray[0], ray[1], 1.0);
        let across = ray_sigma * depth_m;
        let covariance_m2 = direction * direction.transpose() * (depth_sigma_m * depth_sigma_m)
            + Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0)) * (across * across);
        Self { position_m: direction * depth_m, covariance_m2, is_inner: true }
    }
}

/// One side of a correspondence, in the frame of its camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Bearing `(x/z, y/z)` of the corner, without distortion.
    pub ray: [f64; 2],
    /// Standard deviation of each coordinate of `ray`: that of the pixel over the focal length.
    pub ray_sigma: f64,
    /// The point, where depth is known.
    pub point: Option<PointEstimate>,
}

impl Observation {
    pub(crate) fn ray(&self) -> Vector2<f64> {
        Vector2::from(self.ray)
    }

    /// Unit vector towards the corner.
    pub(crate) fn bearing(&self) -> Vector3<f64> {
        Vector3::new(self.ray[0], self.ray[1], 1.0).normalize()
    }
}

/// A match as two observations of one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correspondence {
    /// In the query's camera, whose pose is sought.
    pub query: Observation,
    /// In the target's camera.
    pub target: Observation,
}

impl Correspondence {
    /// Whether either side is inside a surface.
    pub fn is_inner(&self) -> bool {
        [&self.query, &self.target].iter().any(|side| side.point.is_some_and(|point| point.is_inner))
    }
}
