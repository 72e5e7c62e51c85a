//! Depth by the phase of light.

use crate::random;
use crate::render::Scratch;
use crate::sensor::{inverse_depth, to_raw};
use tessera_geometry::{Camera, RayTable};

/// Standard deviation of a pixel at depth z: `a + b z^2`, metres; 4 mm at 1 m and 17 mm at 3 m, as of the
/// SwissRanger SR4000 in lab/notes.md.
const SIGMA_M: [f32; 2] = [0.003, 0.0016];
/// The error that all pixels of a depth share: its size and its period over depth, metres.
const COMMON_M: f32 = 0.004;
const COMMON_PERIOD_M: f32 = 1.5;
/// Depths that are measured at all, metres: beyond, the phase begins anew.
const RANGE_M: std::ops::RangeInclusive<f32> = 0.3..=7.0;
/// Neighbours whose depths differ by a larger share are at an edge.
const EDGE_SHARE: f32 = 0.05;
/// Standard deviation of the sum of four random bytes.
const BYTES_SIGMA: f32 = 147.8;

/// Depth as the sensor would measure it; `key` names the frame's random draws.
pub(super) fn measure(
    camera: &Camera,
    rays: &RayTable,
    key: u64,
    scratch: &mut Scratch,
    depth_raw: &mut [u16],
) {
    let (units, offset_m) = (camera.units_per_metre as f32, camera.depth_offset_m as f32);
    let true_depth = |at: usize| 1.0 / inverse_depth(&scratch.planes[at], rays.x[at], rays.y[at]);
    for (at, raw) in depth_raw.iter_mut().enumerate() {
        let word = random::word(key, at as u64);
        let mut depth_m = true_depth(at);
        if at % rays.width > 0 {
            let beside_m = true_depth(at - 1);
            if (depth_m - beside_m).abs() > EDGE_SHARE * depth_m {
                // A pixel that sees both takes the light of both.
                let share = (word >> 32 & 0xffff) as f32 / 65_535.0;
                depth_m += share * (beside_m - depth_m);
            }
        }
        let bytes: u32 = [0, 8, 16, 24].map(|shift| (word >> shift & 255) as u32).iter().sum();
        let error = (bytes as f32 - 510.0) / BYTES_SIGMA;
        let common_m = COMMON_M * libm::sinf(depth_m * std::f32::consts::TAU / COMMON_PERIOD_M);
        let measured_m = depth_m + common_m + error * (SIGMA_M[0] + SIGMA_M[1] * depth_m * depth_m);
        *raw = if RANGE_M.contains(&measured_m) { to_raw(measured_m - offset_m, units) } else { 0 };
    }
}
