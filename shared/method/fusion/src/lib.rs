//! Surfaces of keyframes fused into one mesh.
//!
//! A truncated signed distance field (Curless and Levoy 1996) in blocks of voxels that exist only
//! near surfaces, found through a hash (Niessner et al. 2013). Distances are measured to the
//! tangent planes of a surface's vertices, not along rays, and are weighed by their certainty.
//! The mesh is its zero, by naive surface nets made manifold. The result depends on the views and their order
//! alone, not on threads.
#![forbid(unsafe_code)]

mod block;
mod extract;
mod integrate;
mod manifold;
mod mesh;
mod settings;
mod view;
mod volume;

pub use mesh::Mesh;
pub use settings::FusionSettings;
pub use view::View;
pub use volume::{FusionError, VIEWS_AT_ONCE, Volume};
