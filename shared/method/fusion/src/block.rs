//! Voxels in cubes of eight to a side.

use tessera_numerics::lanes::LANES;

/// Voxels along a side.
pub(crate) const SIDE: i32 = LANES as i32;
/// Voxels of a block.
pub(crate) const N: usize = (SIDE * SIDE * SIDE) as usize;

/// One voxel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Voxel {
    /// Signed distance of its centre to the surface, truncations; positive in front.
    pub(crate) distance: f32,
    /// Sum of the weights of what it was made of; 0: never seen.
    pub(crate) weight: f32,
    /// Weight of the colour, which is taken near the surface alone.
    pub(crate) colour_weight: f32,
    /// Red, green, blue, 0 to 255.
    pub(crate) rgb: [f32; 3],
}

/// A cube of voxels, x fastest; each value of all voxels together, so that a line of eight goes at once.
#[derive(Debug)]
pub(crate) struct Block {
    pub(crate) distance: [f32; N],
    pub(crate) weight: [f32; N],
    pub(crate) colour_weight: [f32; N],
    pub(crate) rgb: [[f32; N]; 3],
}

impl Block {
    /// Voxels that were never seen.
    pub(crate) fn new() -> Self {
        Self { distance: [0.0; N], weight: [0.0; N], colour_weight: [0.0; N], rgb: [[0.0; N]; 3] }
    }

    pub(crate) fn voxel(&self, at: usize) -> Voxel {
        Voxel {
            distance: self.distance[at],
            weight: self.weight[at],
            colour_weight: self.colour_weight[at],
            rgb: [self.rgb[0][at], self.rgb[1][at], self.rgb[2][at]],
        }
    }
}

/// Position of a voxel in its block.
pub(crate) fn place(x: i32, y: i32, z: i32) -> usize {
    (x + SIDE * (y + SIDE * z)) as usize
}
