//! Scale of each parameter: the change that moves the image by one pixel, which makes unlike units
//! comparable.

use crate::derivative::ray_derivative;
use crate::parameters::{N_PARAMETERS, Parameters};
use tessera_geometry::{Camera, Twist};

/// Pixels between the places at which the image is looked at.
const SPACING_PX: usize = 20;
/// A camera at rest would need an endless readout time: turning by less counts as this, rad/s.
const LEAST_TURN_RAD_PER_S: f64 = 0.02;

/// For each parameter the change that moves the image by one pixel (root mean square over the
/// image; for the readout time over the frames too). A depth offset's is the width of a pixel at
/// the median depth.
pub(crate) fn one_pixel(camera: &Camera, velocities: &[Twist], median_depth_m: f64) -> Parameters {
    let mut squares = [0.0; N_PARAMETERS];
    let mut n = 0.0;
    for row in (0..camera.height as usize).step_by(SPACING_PX) {
        for column in (0..camera.width as usize).step_by(SPACING_PX) {
            let ray = camera.ray(row as f64, column as f64);
            for (k, [dx, dy]) in ray_derivative(camera, ray.x, ray.y).into_iter().enumerate() {
                squares[k] += camera.fx * camera.fx * (dx * dx + dy * dy);
            }
            n += 1.0;
        }
    }
    let turns: f64 = velocities.iter().map(|v| v.phi.norm_squared()).sum();
    let turn_rad_per_s = (turns / velocities.len().max(1) as f64).sqrt().max(LEAST_TURN_RAD_PER_S);
    let mut sizes = Parameters::zeros();
    for k in 0..9 {
        sizes[k] = (n / squares[k]).sqrt();
    }
    // Rows spread evenly over the readout: its root mean square distance from the middle.
    let row_spread = (1.0f64 / 12.0).sqrt();
    sizes[9] = 1.0 / (camera.fx.abs() * turn_rad_per_s * row_spread);
    sizes[10] = median_depth_m / camera.fx.abs();
    sizes
}

/// A change of the parameters in pixels; a parameter of size 0 does not change.
pub(crate) fn in_pixels(change: &Parameters, sizes: &Parameters) -> Parameters {
    change.zip_map(sizes, |change, size| if size == 0.0 { 0.0 } else { change / size })
}
