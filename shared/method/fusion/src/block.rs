//! Voxels in cubes of eight to a side.

/// Voxels along a side.
pub(crate) const SIDE: i32 = 8;
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

impl Voxel {
    /// Takes one more measurement in.
    pub(crate) fn add_distance(&mut self, distance: f32, weight: f32) {
        let sum = self.weight + weight;
        self.distance += (distance - self.distance) * (weight / sum);
        self.weight = sum;
    }

    /// Takes the colour of one more measurement in.
    pub(crate) fn add_colour(&mut self, rgb: [f32; 3], weight: f32) {
        let sum = self.colour_weight + weight;
        for (own, new) in self.rgb.iter_mut().zip(rgb) {
            *own += (new - *own) * (weight / sum);
        }
        self.colour_weight = sum;
    }
}

/// A cube of voxels, x fastest.
pub(crate) type Block = [Voxel; N];

/// Position of a voxel in its block.
pub(crate) fn place(x: i32, y: i32, z: i32) -> usize {
    (x + SIDE * (y + SIDE * z)) as usize
}
