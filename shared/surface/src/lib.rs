//! From one depth image to a quad mesh with filtered points, normals and covariances.
#![forbid(unsafe_code)]

mod vertex;

pub use vertex::{Grid, SurfaceView, Vertex};
