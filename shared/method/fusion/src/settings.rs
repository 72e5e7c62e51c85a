//! Settings of fusion.

use tessera_numerics::Isa;

/// How a map is fused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FusionSettings {
    /// Edge of a voxel, metres.
    pub voxel_m: f64,
    /// Distances beyond so many voxels from a surface are not told apart.
    pub truncation_voxels: f64,
    /// Points farther from their camera are left out, metres.
    pub max_depth_m: f64,
    /// Memory for voxels at most, bytes.
    pub max_bytes: usize,
    /// Pieces of fewer triangles are left out.
    pub min_triangles: usize,
    /// Vector instructions; the mesh has the same bits with each.
    pub isa: Isa,
}

impl Default for FusionSettings {
    fn default() -> Self {
        Self {
            voxel_m: 0.01,
            truncation_voxels: 4.0,
            max_depth_m: 4.0,
            max_bytes: 1_000_000_000,
            min_triangles: 100,
            isa: Isa::Auto,
        }
    }
}
