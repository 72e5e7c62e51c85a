//! The steps of a reconstruction by name.

/// One step of a reconstruction; each works on what the steps before it left in the buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Depth and colour to an organised cloud (SPEC 1.1).
    Cloud,
    /// Edges and quads (eq. 1-5).
    Mesh,
    /// Normals from the quads (eq. 8).
    Normals,
    /// The multilateral filter with all its passes (eq. 6-7).
    Filter,
    /// Vertices as they travel.
    Vertices,
}

impl Step {
    /// All steps in their order.
    pub const ALL: [Step; 5] = [Step::Cloud, Step::Mesh, Step::Normals, Step::Filter, Step::Vertices];
}
