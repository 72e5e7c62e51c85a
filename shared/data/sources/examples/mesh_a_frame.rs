//! One depth image becomes a mesh with filtered points and normals.
//!
//! `cargo run --release -p tessera-sources --example mesh_a_frame`
#![forbid(unsafe_code)]

use std::error::Error;
use tessera_sources::{FrameBuffers, SceneName, SimulatedSource, SimulationOptions, Source};
use tessera_surface::{Reconstructor, SurfaceSettings, Vertex};

fn main() -> Result<(), Box<dyn Error>> {
    // Any 16-bit depth image with its camera will do; here it is one of the simulated room.
    let source = SimulatedSource::open(SceneName::Room, None, Some(1), &SimulationOptions::default())?;
    let camera = source.camera();
    let n_pixels = camera.width as usize * camera.height as usize;
    let (mut depth, mut colour) = (vec![0; n_pixels], vec![0; 3 * n_pixels]);
    source.read(0, &mut FrameBuffers { depth: &mut depth, colour: &mut colour })?;

    // A reconstructor holds its buffers: make it once, use it for every frame.
    let mut reconstructor = Reconstructor::new(camera, &SurfaceSettings::default())?;
    let grid = reconstructor.grid();
    let mut vertices = vec![Vertex::default(); grid.len()];
    let statistics = reconstructor.reconstruct(&depth, Some(&colour), &mut vertices);

    println!("{} x {} vertices, one for {} pixels along each axis", grid.width, grid.height, grid.step);
    println!("{statistics:?}");
    let middle = &vertices[grid.width * (grid.height / 2) + grid.width / 2];
    println!("in the middle: point {:.3?} m, normal {:.3?}", middle.position, middle.normal);
    Ok(())
}
