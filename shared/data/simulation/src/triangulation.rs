//! Depth by triangulation, as of a Kinect or of a stereo camera: in disparity, blurred, rounded, and with
//! holes.
//!
//! Errors are drawn in fields that are smooth over a few pixels, as those of block matching are,
//! so that averaging neighbours does not make them go away; rounding comes last.

use crate::fields::{draw_fields, smooth_again};
use crate::random;
use crate::render::Scratch;
use crate::sensor::{inverse_depth, to_raw};
use tessera_geometry::{Camera, RayTable};

/// A sensor that triangulates.
pub(super) struct Triangulation {
    /// Distance between its two centres, metres.
    baseline_m: f64,
    /// Steps of disparity in a pixel.
    steps_per_pixel: f32,
    /// Standard deviation of the disparity before it is rounded, pixels.
    disparity_sigma_px: f32,
    /// Standard deviation of the lateral pixel noise, pixels along each axis.
    lateral_sigma_px: f32,
    /// Whether errors are shared by more than a few pixels.
    is_smooth: bool,
    /// Share of blocks without a measurement, of a frame.
    missing: f64,
    /// Depths that are measured at all, metres.
    range_m: std::ops::RangeInclusive<f32>,
}

/// A Kinect: a deviation of half a step, as Khoshelham and Elberink measured (Sensors 2012). Together with
/// the rounding this gives the axial noise of Nguyen et al. and of eq. 5 (method 1.4): 7 mm at 2 m, 16 mm at
/// 3 m.
pub(super) const STRUCTURED_LIGHT: Triangulation = Triangulation {
    baseline_m: 0.075,
    steps_per_pixel: 8.0,
    disparity_sigma_px: 0.0625,
    lateral_sigma_px: 0.5,
    is_smooth: false,
    missing: 0.0,
    range_m: 0.45..=9.5,
};
/// A RealSense D435: 6 mm at 2 m, where 5 mm were measured about planes (lab/notes.md).
pub(super) const ACTIVE_STEREO: Triangulation = Triangulation {
    baseline_m: 0.05,
    steps_per_pixel: 32.0,
    disparity_sigma_px: 0.04,
    lateral_sigma_px: 1.5,
    is_smooth: true,
    missing: 0.12,
    range_m: 0.28..=10.0,
};
/// Stream of the blocks without a measurement.
const MISSING: u64 = 0x0b10_c4ed;
/// Blocks that have no measurement together, pixels.
const BLOCK_PX: usize = 20;
/// A jump of more pixels of disparity than this is a depth edge.
const EDGE_PX: f32 = 1.25;
/// Below the first cosine of the angle between ray and normal nothing is measured, above the
/// second everything is.
const GRAZING: (f32, f32) = (0.09, 0.24);

/// Depth as the sensor would measure it; `key` names the frame's random draws.
pub(super) fn measure(
    sensor: &Triangulation,
    camera: &Camera,
    rays: &RayTable,
    key: u64,
    scratch: &mut Scratch,
    depth_raw: &mut [u16],
) {
    let (width, height) = (rays.width, rays.height);
    draw_fields(key, width, height, scratch);
    if sensor.is_smooth {
        smooth_again(width, height, scratch);
    }
    let Scratch { planes, fields: [beside_x, beside_y, error], work, .. } = scratch;
    let focal_baseline = (camera.fx.abs() * sensor.baseline_m) as f32;
    let (inverse_fx, inverse_fy) = ((1.0 / camera.fx) as f32, (1.0 / camera.fy) as f32);
    let (lateral, sigma, per_pixel) =
        (sensor.lateral_sigma_px, sensor.disparity_sigma_px, sensor.steps_per_pixel);
    let is_missing = |row: usize, column: usize| {
        let block = ((row / BLOCK_PX) as u64) << 32 | (column / BLOCK_PX) as u64;
        sensor.missing > 0.0 && random::unit(key ^ MISSING, block) < sensor.missing
    };
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
            if is_shadowed || is_missing(row, column) {
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
            let steps = (per_pixel * (disparity + sigma * error[at]) + 0.5) as i32;
            if steps > 0 {
                let depth_m = focal_baseline * per_pixel / steps as f32;
                if sensor.range_m.contains(&depth_m) {
                    depth_raw[at] = to_raw(depth_m - offset_m, units);
                }
            }
        }
    }
}

fn is_grazing(plane: &[f32; 3], inverse_m: f32, x: f32, y: f32, luck: f32) -> bool {
    let normal_sq = plane[0] * plane[0] + plane[1] * plane[1] + plane[2] * plane[2];
    let ray_sq = x * x + y * y + 1.0;
    let (none, all) = GRAZING;
    let cosine_sq = inverse_m * inverse_m / (normal_sq * ray_sq);
    // Almost every pixel is far from grazing: no root for those.
    cosine_sq < all * all && cosine_sq.sqrt() < none + (all - none) * luck
}
