//! Derivative of a measured point by the camera's parameters.

use crate::parameters::N_PARAMETERS;
use nalgebra::{Point3, SMatrix, Vector3};
use tessera_geometry::{Camera, Pose, Twist, exp};

/// Derivative of a point by each parameter, metres per unit.
pub(crate) type PointDerivative = SMatrix<f64, 3, N_PARAMETERS>;

/// A point as the row that saw it was exposed.
pub(crate) struct Exposed {
    /// In the camera's frame at that row's time.
    pub(crate) point: Vector3<f64>,
    /// `camera_at_stamp_from_camera_at_row`.
    pub(crate) stamp_from_row: Pose,
    /// Row's time from the stamp, in units of the readout time.
    pub(crate) share_of_readout: f64,
}

/// Undoes the readout's motion: two fixed-point steps find the row (method 1.6).
pub(crate) fn expose(camera: &Camera, velocity: &Twist, point_at_stamp: &Vector3<f64>) -> Exposed {
    let mut exposed =
        Exposed { point: *point_at_stamp, stamp_from_row: Pose::identity(), share_of_readout: 0.0 };
    for _ in 0..2 {
        let last = f64::from(camera.height) - 1.0;
        let row = camera.project(&exposed.point).map_or(0.5 * last, |(row, _)| row.clamp(0.0, last));
        exposed.share_of_readout = (row + 0.5) / f64::from(camera.height) - 0.5;
        exposed.stamp_from_row = exp(&velocity.scaled(exposed.share_of_readout * camera.readout_s));
        exposed.point = exposed.stamp_from_row.inverse_transform_point(&Point3::from(*point_at_stamp)).coords;
    }
    exposed
}

/// Derivative of a point at its frame's stamp: its pixel and its raw depth stay, the ray through
/// the pixel, the depth's offset and the time of the row change.
pub(crate) fn point_derivative(
    camera: &Camera,
    velocity: &Twist,
    point_at_stamp: &Vector3<f64>,
) -> PointDerivative {
    let exposed = expose(camera, velocity, point_at_stamp);
    let z = exposed.point.z;
    let (x, y) = (exposed.point.x / z, exposed.point.y / z);
    let mut at_row = PointDerivative::zeros();
    for (k, [dx, dy]) in ray_derivative(camera, x, y).into_iter().enumerate() {
        at_row.set_column(k, &Vector3::new(z * dx, z * dy, 0.0));
    }
    at_row.set_column(10, &Vector3::new(x, y, 1.0));
    let mut at_stamp = exposed.stamp_from_row.rotation.to_rotation_matrix().matrix() * at_row;
    let moved = (velocity.rho + velocity.phi.cross(point_at_stamp)) * exposed.share_of_readout;
    at_stamp.set_column(9, &moved);
    at_stamp
}

/// Derivative of the ideal ray `(x, y, 1)` through a fixed pixel by `fx fy cx cy k1 k2 p1 p2 k3`:
/// the distorted ray changes by the intrinsics, and undoing the distortion changes by the lens.
pub(crate) fn ray_derivative(camera: &Camera, x: f64, y: f64) -> [[f64; 2]; 9] {
    let (xd, yd) = camera.distort(x, y);
    let [a, b, d] = camera.distortion_slope(x, y);
    let determinant = a * d - b * b;
    let r2 = x * x + y * y;
    let by_distorted = |u: f64, v: f64| [(d * u - b * v) / determinant, (a * v - b * u) / determinant];
    let by_lens = |u: f64, v: f64| by_distorted(-u, -v);
    [
        by_distorted(-xd / camera.fx, 0.0),
        by_distorted(0.0, -yd / camera.fy),
        by_distorted(-1.0 / camera.fx, 0.0),
        by_distorted(0.0, -1.0 / camera.fy),
        by_lens(x * r2, y * r2),
        by_lens(x * r2 * r2, y * r2 * r2),
        by_lens(2.0 * x * y, r2 + 2.0 * y * y),
        by_lens(r2 + 2.0 * x * x, 2.0 * x * y),
        by_lens(x * r2 * r2 * r2, y * r2 * r2 * r2),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::{of_camera, with_parameters};

    fn camera() -> Camera {
        Camera {
            width: 640,
            height: 480,
            fx: 517.3,
            fy: 516.5,
            cx: 318.6,
            cy: 255.3,
            units_per_metre: 5000.0,
            distortion: [0.26, -0.95, -0.0054, 0.0026, 1.16],
            readout_s: 0.03,
            depth_offset_m: 0.01,
            colour_registered: true,
            colour_lag_s: 0.0,
            colour_focal_ratio: 1.0,
        }
    }

    /// The point at the stamp that a pixel with a raw depth stands for.
    fn back_project(
        camera: &Camera,
        velocity: &Twist,
        (row, column): (f64, f64),
        raw_m: f64,
    ) -> Vector3<f64> {
        let point = camera.ray(row, column) * (raw_m + camera.depth_offset_m);
        exp(&velocity.scaled(camera.row_time_s(row))).transform_point(&Point3::from(point)).coords
    }

    #[test]
    fn the_derivative_is_that_of_back_projection() {
        let camera = camera();
        let velocity = Twist { rho: Vector3::new(0.3, -0.2, 0.1), phi: Vector3::new(1.5, -0.8, 0.6) };
        for pixel in [(20.0, 30.0), (240.0, 320.0), (100.0, 600.0), (470.0, 15.0)] {
            let point = back_project(&camera, &velocity, pixel, 1.9);
            let derivative = point_derivative(&camera, &velocity, &point);
            for k in 0..N_PARAMETERS {
                let step = 1e-6;
                let moved = |sign: f64| {
                    let mut values = of_camera(&camera);
                    values[k] += sign * step;
                    back_project(&with_parameters(&camera, &values), &velocity, pixel, 1.9)
                };
                let numeric = (moved(1.0) - moved(-1.0)) / (2.0 * step);
                let error = (numeric - derivative.column(k)).norm();
                // The row is found in two steps: to a few hundredths of a pixel.
                assert!(error < 1e-2 * (numeric.norm() + 1e-3), "parameter {k} at {pixel:?}: {error}");
            }
        }
    }
}
