//! Vertices as integers.

use crate::octahedron;
use crate::vertex::Vertex;

/// Rounding of the coordinates of a point, metres.
pub(super) const POINT_STEP_M: f32 = 1.0 / 8192.0;
/// Bits of [`Vertex::flags_rgb`] that are no colour.
const FLAGS: u32 = 0xff;
/// Flag of a vertex with a measurement, above the flags of [`Vertex`].
const MEASURED: u32 = 0x100;
/// All flags of a rounded vertex.
pub(super) const ALL_FLAGS: u32 = FLAGS | MEASURED;

/// Numbers of a vertex, in their order in a row, each with the flag of the vertices that have it
/// (0: all). A point's depth, column and row coordinates, the normal on the octahedron, green, and
/// red and blue less green.
pub(super) const NUMBERS: [u32; 8] = [MEASURED, MEASURED, MEASURED, Vertex::VALID, Vertex::VALID, 0, 0, 0];

/// Whether all bits of `flag` are set.
#[inline]
pub(super) fn has(flags: u32, flag: u32) -> bool {
    flags & flag == flag
}

/// Vertices as integers, number by number.
pub(super) struct Rounded {
    pub flags: Vec<u32>,
    pub numbers: [Vec<i32>; NUMBERS.len()],
}

impl Rounded {
    pub(super) fn new(n: usize) -> Self {
        Self { flags: vec![0; n], numbers: std::array::from_fn(|_| vec![0; n]) }
    }

    /// Rounds a vertex.
    pub(super) fn set(&mut self, at: usize, vertex: &Vertex) {
        let is_measured = vertex.position != [0.0; 3];
        self.flags[at] = (vertex.flags_rgb & FLAGS) | if is_measured { MEASURED } else { 0 };
        let [x, y, z] = vertex.position.map(|metres| octahedron::round(metres / POINT_STEP_M));
        let [u, v] = octahedron::from_normal(vertex.normal);
        let [red, green, blue] = vertex.rgb().map(i32::from);
        let numbers = [z, x, y, u, v, green, red - green, blue - green];
        for (row, number) in self.numbers.iter_mut().zip(numbers) {
            row[at] = number;
        }
    }

    /// The vertex of rounded numbers.
    #[inline]
    pub(super) fn vertex(&self, at: usize) -> Vertex {
        let [z, x, y, u, v, green, red, blue] = std::array::from_fn(|number| self.numbers[number][at]);
        let flags = self.flags[at];
        let position = [x, y, z].map(|steps| steps as f32 * POINT_STEP_M);
        let rgb = [red.wrapping_add(green), green, blue.wrapping_add(green)].map(|value| value as u8);
        Vertex {
            position: if has(flags, MEASURED) { position } else { [0.0; 3] },
            flags_rgb: Vertex::pack(0, 0, rgb) | (flags & FLAGS),
            normal: if has(flags, Vertex::VALID) { octahedron::to_normal([u, v]) } else { [0.0; 3] },
            reserved: 0,
        }
    }
}
