//! Frames for the benchmarks: real ones where they lie beside the project, else simulated ones.
#![allow(dead_code, unreachable_pub, reason = "each benchmark uses a part of it")]

use rayon::prelude::*;
use std::path::PathBuf;
use std::sync::OnceLock;
use tessera_geometry::Camera;
use tessera_offline::{Method, RawFrame};
use tessera_sources::{Source, SourceOptions, SourceSpec, open};
use tessera_surface::{Reconstructor, Vertex};

/// Frames decoded for a benchmark.
const N_FRAMES: u64 = 60;

pub struct Frames {
    pub camera: Camera,
    pub frames: Vec<RawFrame>,
}

/// The first frames of kitchen_450, or of the simulated room where the data are not there.
pub fn frames() -> &'static Frames {
    static FRAMES: OnceLock<Frames> = OnceLock::new();
    FRAMES.get_or_init(|| {
        let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data/kitchen_450");
        let name = if folder.is_dir() {
            folder.display().to_string()
        } else {
            eprintln!("skipped: real frames, {} is not there; simulated ones instead", folder.display());
            "room".to_owned()
        };
        let options = SourceOptions { frames: Some(N_FRAMES), ..SourceOptions::default() };
        let source = open(&SourceSpec::parse(&name), &options).expect("the source opens");
        let frames = (0..N_FRAMES).into_par_iter().map(|index| read(source.as_ref(), index)).collect();
        Frames { camera: source.camera().clone(), frames }
    })
}

/// One decoded frame of a source.
pub fn read(source: &dyn Source, index: u64) -> RawFrame {
    RawFrame::read(source, index).expect("the frame can be read")
}

/// A frame's surface by the default settings.
pub fn surface(camera: &Camera, method: &Method, frame: &RawFrame) -> Vec<Vertex> {
    let mut reconstructor = Reconstructor::new(camera, &method.surface).expect("good settings");
    let mut vertices = vec![Vertex::default(); reconstructor.grid().len()];
    reconstructor.reconstruct(&frame.depth, frame.colour.as_deref(), &mut vertices);
    vertices
}
