//! Depth measurement of a Kinect: in disparity, blurred, rounded, and with holes.
//!
//! Errors are drawn in fields that are smooth over a few pixels, as those of block matching are,
//! so that averaging neighbours does not make them go away; rounding to 1/8 px comes last.

use crate::options::SimulationOptions;
use crate::random;
use crate::render::Scratch;
use tessera_geometry::{Camera, RayTable};

/// Distance from the infrared camera to the projector, metres.
const BASELINE_M: f64 = 0.075;
/// Steps of disparity in a pixel.
const STEPS_PER_PIXEL: f32 = 8.0;
/// Depths that are measured at all, metres.
const RANGE_M: std::ops::RangeInclusive<f32> = 0.45..=9.5;
/// A jump of more pixels of disparity than this is a depth edge.
const EDGE_PX: f32 = 1.25;
/// Below the first cosine of the angle between ray and normal nothing is measured, above the
/// second everything is.
const GRAZING: (f32, f32) = (0.09, 0.24);

/// Depth without noise.
pub(super) fn exact_depth(camera: &Camera, rays: &RayTable, scratch: &Scratch, depth_raw: &mut [u16]) {
    let (units, offset_m) = (camera.units_per_metre as f32, camera.depth_offset_m as f32);
    for (at, (raw, plane)) in depth_raw.iter_mut().zip(&scratch.planes).enumerate() {
        *raw = to_raw(1.0 / inverse_depth(plane, rays.x[at], rays.y[at]) - offset_m, units);
    }
}

/// Depth as the sensor would measure it; `key` names the frame's random draws.
pub(super) fn measure(
    camera: &Camera,
    rays: &RayTable,
    options: &SimulationOptions,
    key: u64,
    scratch: &mut Scratch,
    depth_raw: &mut [u16],
) {
    let (width, height) = (rays.width, rays.height);
    draw_fields(key, width, height, scratch);
    let Scratch { planes, fields: [beside_x, beside_y, error], work, .. } = scratch;
    let focal_baseline = (camera.fx.abs() * BASELINE_M) as f32;
    let (inverse_fx, inverse_fy) = ((1.0 / camera.fx) as f32, (1.0 / camera.fy) as f32);
    let lateral = options.lateral_sigma_px as f32;
    let sigma = options.disparity_sigma_px as f32;
    let (units, offset_m) = (camera.units_per_metre as f32, camera.depth_offset_m as f32);
    for row in 0..height {
        let line = row * width..(row + 1) * width;
        let true_disparity = &mut work[..width];
        for (column, at) in line.clone().enumerate() {
            true_disparity[column] = focal_baseline * inverse_depth(&planes[at], rays.x[at], rays.y[at]);
        }
        // The projector stands to the right: seen from there, what lies further left along the
        // row must come out further left, or something nearer has stepped into its light.
        let mut leftmost = f32::MAX;
        for column in (0..width).rev() {
            let from_projector = column as f32 - true_disparity[column];
            let is_shadowed = from_projector > leftmost + 0.5;
            leftmost = leftmost.min(from_projector);
            let at = line.start + column;
            depth_raw[at] = 0;
            if is_shadowed {
                continue;
            }
            let (dx, dy) =
                ((lateral * beside_x[at]).clamp(-3.0, 3.0), (lateral * beside_y[at]).clamp(-3.0, 3.0));
            let other_column = (column as f32 + dx + 0.5).clamp(0.0, (width - 1) as f32) as usize;
            let other_row = (row as f32 + dy + 0.5).clamp(0.0, (height - 1) as f32) as usize;
            let plane = &planes[other_row * width + other_column];
            let (x, y) = (rays.x[at] + dx * inverse_fx, rays.y[at] + dy * inverse_fy);
            let inverse_m = inverse_depth(plane, x, y);
            let disparity = focal_baseline * inverse_m;
            let is_edge = (disparity - true_disparity[column]).abs() > EDGE_PX;
            let luck = 0.5 + 0.29 * error[at];
            if is_edge && luck < 0.6 || is_grazing(plane, inverse_m, x, y, luck) {
                continue;
            }
            let steps = (STEPS_PER_PIXEL * (disparity + sigma * error[at]) + 0.5) as i32;
            if steps > 0 {
                let depth_m = focal_baseline * STEPS_PER_PIXEL / steps as f32;
                if RANGE_M.contains(&depth_m) {
                    depth_raw[at] = to_raw(depth_m - offset_m, units);
                }
            }
        }
    }
}

/// A little grey noise on each pixel, independent of the depth's.
pub(super) fn add_colour_noise(key: u64, rgb: &mut [u8]) {
    let key = random::mix(key ^ 0x00c0_100e);
    for (at, pixel) in rgb.chunks_exact_mut(3).enumerate() {
        let word = random::word(key, at as u64);
        // The sum of four bytes is nearly normal; 148 is its standard deviation.
        let sum: i32 = [0, 8, 16, 24].map(|shift| (word >> shift & 255) as i32).iter().sum::<i32>() - 510;
        let common = sum / 74;
        for (k, byte) in pixel.iter_mut().enumerate() {
            let own = (word >> (32 + 8 * k) & 3) as i32 - 1;
            *byte = (i32::from(*byte) + common + own).clamp(0, 255) as u8;
        }
    }
}

#[inline]
fn inverse_depth(plane: &[f32; 3], x: f32, y: f32) -> f32 {
    plane[0] * x + plane[1] * y + plane[2]
}

#[inline]
fn to_raw(depth_m: f32, units_per_metre: f32) -> u16 {
    let raw = depth_m * units_per_metre + 0.5;
    if (1.0..65_535.0).contains(&raw) { raw as u16 } else { 0 }
}

fn is_grazing(plane: &[f32; 3], inverse_m: f32, x: f32, y: f32, luck: f32) -> bool {
    let normal_sq = plane[0] * plane[0] + plane[1] * plane[1] + plane[2] * plane[2];
    let ray_sq = x * x + y * y + 1.0;
    let (none, all) = GRAZING;
    let cosine_sq = inverse_m * inverse_m / (normal_sq * ray_sq);
    // Almost every pixel is far from grazing: no root for those.
    cosine_sq < all * all && cosine_sq.sqrt() < none + (all - none) * luck
}

/// Three fields of unit variance, smooth over four pixels, into `scratch.fields`.
fn draw_fields(key: u64, width: usize, height: usize, scratch: &mut Scratch) {
    let n = width * height;
    for field in &mut scratch.fields {
        field.resize(n, 0.0);
    }
    scratch.work.resize(n.max(width), 0.0);
    let Scratch { fields: [a, b, c], work, .. } = scratch;
    let uniform = |bits: u64| (bits & 0xffff) as f32 * (2.0 / 65_535.0) - 1.0;
    for at in 0..n {
        let word = random::word(key, at as u64);
        a[at] = uniform(word);
        b[at] = uniform(word >> 16);
        c[at] = uniform(word >> 32);
    }
    for field in [a, b, c] {
        smooth(field, work, width, height);
    }
}

/// Weights 1 2 3 2 1 along rows, then along columns, scaled so that the variance of a uniform
/// draw on `[-1, 1]` becomes 1: the sum of squared weights is 19 each way, the draw's own is 1/3.
fn smooth(field: &mut [f32], work: &mut [f32], width: usize, height: usize) {
    const SCALE: f32 = 1.732_050_8 / 19.0;
    for row in 0..height {
        let from = &field[row * width..(row + 1) * width];
        let to = &mut work[row * width..(row + 1) * width];
        let at = |column: isize| from[column.clamp(0, width as isize - 1) as usize];
        let weighted = |k: isize| 3.0 * at(k) + 2.0 * (at(k - 1) + at(k + 1)) + (at(k - 2) + at(k + 2));
        for column in [0, 1, width - 2, width - 1] {
            to[column] = weighted(column as isize);
        }
        for (value, five) in to[2..width - 2].iter_mut().zip(from.windows(5)) {
            *value = 3.0 * five[2] + 2.0 * (five[1] + five[3]) + (five[0] + five[4]);
        }
    }
    let line = |row: isize| {
        let row = row.clamp(0, height as isize - 1) as usize;
        &work[row * width..(row + 1) * width]
    };
    for row in 0..height {
        let k = row as isize;
        let to = &mut field[row * width..(row + 1) * width];
        let (n2, n1, here, p1, p2) = (line(k - 2), line(k - 1), line(k), line(k + 1), line(k + 2));
        for column in 0..width {
            to[column] =
                SCALE * (3.0 * here[column] + 2.0 * (n1[column] + p1[column]) + (n2[column] + p2[column]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_have_unit_variance_and_are_smooth_over_a_few_pixels() {
        let (width, height) = (320, 240);
        let mut scratch = Scratch::default();
        draw_fields(99, width, height, &mut scratch);
        for field in &scratch.fields {
            let correlation = |lag: usize| {
                let (mut sum, mut n) = (0.0f64, 0.0);
                for row in 5..height - 5 {
                    for column in 5..width - 15 {
                        let at = row * width + column;
                        sum += f64::from(field[at]) * f64::from(field[at + lag]);
                        n += 1.0;
                    }
                }
                sum / n
            };
            assert!((correlation(0) - 1.0).abs() < 0.05, "{}", correlation(0));
            assert!(correlation(1) > 0.75 && correlation(2) > 0.4, "{} {}", correlation(1), correlation(2));
            assert!(correlation(8).abs() < 0.1, "{}", correlation(8));
        }
    }
}
