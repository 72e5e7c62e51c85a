//! Depth of a few points made into an image, as phones have it.

use crate::fields::draw_fields;
use crate::render::Scratch;
use crate::sensor::{inverse_depth, to_raw};
use tessera_geometry::{Camera, RayTable};

/// Half the width of the square over which depth is averaged, pixels.
const BLUR_PX: usize = 3;
/// Standard deviation as a share of the depth.
const SIGMA_SHARE: f32 = 0.004;
/// Pixels of the image for one of the field of errors.
const ERROR_PX: usize = 4;
/// Depths that are measured at all, metres.
const RANGE_M: std::ops::RangeInclusive<f32> = 0.2..=6.0;

/// Depth as the sensor would measure it; `key` names the frame's random draws.
pub(super) fn measure(
    camera: &Camera,
    rays: &RayTable,
    key: u64,
    scratch: &mut Scratch,
    depth_raw: &mut [u16],
) {
    let (width, height) = (rays.width, rays.height);
    draw_fields(key, width, height, scratch);
    let Scratch { planes, fields: [error, along_rows, _], .. } = scratch;
    let (units, offset_m) = (camera.units_per_metre as f32, camera.depth_offset_m as f32);
    // Behind glass and beyond the range there is nothing, and nothing is averaged over.
    let depth = |at: usize| 1.0 / inverse_depth(&planes[at], rays.x[at], rays.y[at]);
    let window = |at: usize, n: usize| at.saturating_sub(BLUR_PX)..(at + BLUR_PX + 1).min(n);
    for row in 0..height {
        for column in 0..width {
            let seen = window(column, width).map(|other| depth(row * width + other));
            along_rows[row * width + column] = mean(seen);
        }
    }
    for row in 0..height {
        for column in 0..width {
            let depth_m = mean(window(row, height).map(|other| along_rows[other * width + column]));
            let error = error[row / ERROR_PX * width + column / ERROR_PX];
            let measured_m = depth_m * (1.0 + SIGMA_SHARE * error);
            let at = row * width + column;
            depth_raw[at] =
                if RANGE_M.contains(&measured_m) { to_raw(measured_m - offset_m, units) } else { 0 };
        }
    }
}

/// The mean of those within the range; not a number where there is none.
fn mean(depths_m: impl Iterator<Item = f32>) -> f32 {
    let (mut sum, mut n) = (0.0, 0.0);
    for depth_m in depths_m.filter(|depth_m| RANGE_M.contains(depth_m)) {
        (sum, n) = (sum + depth_m, n + 1.0);
    }
    sum / n
}
