//! A vertex in whole numbers.

use super::Thinning;
use crate::octahedron::{from_normal_by, round, to_normal_by};
use crate::vertex::Vertex;

/// Rounding of colours, of 256 levels.
const COLOUR_STEP: i32 = 32;
/// Bits of [`Vertex::flags_rgb`] that are no colour.
const FLAGS: u32 = 0xff;
/// Numbers of a vertex: inverse depth, normal on the octahedron, green, and red and blue less green. Only valid
/// vertices have any.
pub(super) const NUMBERS: usize = 6;

pub(super) fn is_valid(flags: u32) -> bool {
    flags & Vertex::VALID != 0
}

/// A vertex by its numbers, see [`NUMBERS`].
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RoundedVertex {
    pub(super) flags: u32,
    pub(super) numbers: [i32; NUMBERS],
}

impl RoundedVertex {
    /// A vertex that stands at this depth; `None` where it is none.
    pub(super) fn of(thinning: Thinning, vertex: &Vertex, depth_m: f32) -> Option<Self> {
        let inverse = round(1.0 / depth_m / thinning.depth_step());
        if !(vertex.is_valid() && depth_m > 0.0 && inverse > 0) {
            return None;
        }
        let [u, v] = from_normal_by(thinning.normal_steps.into(), vertex.normal);
        let [red, green, blue] = vertex.rgb().map(|value| i32::from(value) / COLOUR_STEP);
        let numbers = [inverse, u, v, green, red - green, blue - green];
        Some(Self { flags: vertex.flags_rgb & FLAGS, numbers })
    }

    pub(super) fn is_valid(&self) -> bool {
        is_valid(self.flags)
    }

    pub(super) fn some_valid(self) -> Option<Self> {
        self.is_valid().then_some(self)
    }

    /// The vertex on a ray; `None` where there is none of that depth.
    pub(super) fn vertex(&self, thinning: Thinning, ray: [f32; 3]) -> Option<Vertex> {
        if !self.is_valid() {
            return Some(Vertex::default());
        }
        let [inverse, u, v, green, red, blue] = self.numbers;
        let depth_m = 1.0 / (inverse as f32 * thinning.depth_step());
        let middle = |value: i32| (value.clamp(0, 255 / COLOUR_STEP) * COLOUR_STEP + COLOUR_STEP / 2) as u8;
        let rgb = [red.wrapping_add(green), green, blue.wrapping_add(green)];
        (inverse > 0).then(|| Vertex {
            position: ray.map(|v| v * depth_m),
            flags_rgb: Vertex::pack(0, 0, rgb.map(middle)) | (self.flags & FLAGS),
            normal: to_normal_by(thinning.normal_steps.into(), [u, v]),
            reserved: 0,
        })
    }
}
