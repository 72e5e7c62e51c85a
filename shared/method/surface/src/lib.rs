//! From one depth image to a quad mesh with filtered points, normals and covariances.
//!
//! The method is Holz and Behnke, "Approximate Surface Reconstruction and Registration for
//! RGB-D SLAM", ECMR 2015: an organised cloud ([`cloud`](self)), quads between neighbours whose
//! connecting edges are valid (eq. 1-5), normals from the quads (eq. 8) and a multilateral
//! filter over mesh rings (eq. 6-7). Covariances (eq. 9) are functions of the normals.
#![forbid(unsafe_code)]

#[cfg(test)]
mod acceptance;
mod cell;
mod cloud;
mod colour;
mod columns;
mod filter;
mod floor;
mod mesh;
mod normals;
mod octahedron;
pub mod packed;
mod planes;
mod reconstruct;
mod rings;
mod settings;
mod vertex;
mod workload_level;

pub use floor::floor_up;
pub use reconstruct::{Reconstructor, SurfaceStats};
pub use settings::SurfaceSettings;
pub use vertex::{Grid, SurfaceView, Vertex};
pub use workload_level::WorkloadLevel;
