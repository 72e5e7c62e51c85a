//! How a simulated camera measures depth.

use crate::render::Scratch;
use crate::triangulation::{ACTIVE_STEREO, STRUCTURED_LIGHT};
use crate::{random, time_of_flight, triangulation, upsampled};
use serde::{Deserialize, Serialize};
use tessera_geometry::{Camera, RayTable};

/// The principle by which depth is measured; each has errors of its own kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DepthSensor {
    /// A projected pattern, as a Kinect's: disparity in steps, shadows, no measurement at edges.
    #[default]
    StructuredLight,
    /// Two infrared cameras, as a RealSense D435's: finer steps, errors shared by more pixels, edges
    /// farther off, holes.
    ActiveStereo,
    /// The phase of light, as a SwissRanger's or an Azure Kinect's: each pixel errs by itself, all of them
    /// by a common error that depends on depth, and pixels at edges lie between both depths.
    TimeOfFlight,
    /// A few points made into an image, as a phone's: edges bleed, there are no holes, and errors are
    /// shared by many pixels.
    Upsampled,
    /// No sensor: depth and colour without noise.
    Exact,
}

/// Depth as the sensor measures it; `key` names the frame's random draws.
pub(super) fn measure(
    sensor: DepthSensor,
    (camera, rays): (&Camera, &RayTable),
    key: u64,
    scratch: &mut Scratch,
    depth_raw: &mut [u16],
) {
    match sensor {
        DepthSensor::StructuredLight => {
            triangulation::measure(&STRUCTURED_LIGHT, camera, rays, key, scratch, depth_raw);
        }
        DepthSensor::ActiveStereo => {
            triangulation::measure(&ACTIVE_STEREO, camera, rays, key, scratch, depth_raw);
        }
        DepthSensor::TimeOfFlight => time_of_flight::measure(camera, rays, key, scratch, depth_raw),
        DepthSensor::Upsampled => upsampled::measure(camera, rays, key, scratch, depth_raw),
        DepthSensor::Exact => exact_depth(camera, rays, scratch, depth_raw),
    }
}

/// Depth without noise.
pub(super) fn exact_depth(camera: &Camera, rays: &RayTable, scratch: &Scratch, depth_raw: &mut [u16]) {
    let (units, offset_m) = (camera.units_per_metre as f32, camera.depth_offset_m as f32);
    for (at, (raw, plane)) in depth_raw.iter_mut().zip(&scratch.planes).enumerate() {
        *raw = to_raw(1.0 / inverse_depth(plane, rays.x[at], rays.y[at]) - offset_m, units);
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
pub(super) fn inverse_depth(plane: &[f32; 3], x: f32, y: f32) -> f32 {
    plane[0] * x + plane[1] * y + plane[2]
}

#[inline]
pub(super) fn to_raw(depth_m: f32, units_per_metre: f32) -> u16 {
    let raw = depth_m * units_per_metre + 0.5;
    if (1.0..65_535.0).contains(&raw) { raw as u16 } else { 0 }
}
