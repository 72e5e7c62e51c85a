//! A recording of a few small frames, for messages about its parts.

use std::path::PathBuf;
use tessera_sources::{FrameBuffers, SourceOptions, SourceSpec};

pub(super) const CAMERA: &str = "width = 160\nheight = 120\nfx = 131.25\nfy = 131.25\ncx = 79.5\ncy = 59.5\n\
                      units_per_metre = 5000.0\n";
pub(super) const N_PIXELS: usize = 160 * 120;
pub(super) const N_FRAMES: u64 = 6;

/// A recording in the TUM layout, made from the simulated room.
pub(super) struct Recording {
    pub(super) dir: tempfile::TempDir,
}

impl Recording {
    pub(super) fn new() -> Self {
        let recording = Self { dir: tempfile::tempdir().unwrap() };
        recording.write("camera.toml", CAMERA);
        std::fs::create_dir(recording.path("depth")).unwrap();
        let camera = Some(recording.path("camera.toml").to_str().unwrap().to_owned());
        let options = SourceOptions { camera, frames: Some(N_FRAMES), ..SourceOptions::default() };
        let source = tessera_sources::open(&SourceSpec::parse("room"), &options).unwrap();
        let (mut depth, mut colour) = (vec![0; N_PIXELS], vec![0; 3 * N_PIXELS]);
        let mut list = String::new();
        for index in 0..N_FRAMES {
            source.read(index, &mut FrameBuffers { depth: &mut depth, colour: &mut colour }).unwrap();
            recording.write_depth(index, &depth);
            list.push_str(&format!("{:.6} depth/{index}.png\n", index as f64 / 30.0));
        }
        recording.write("depth.txt", &list);
        // No colour image is near any depth image.
        recording.write("rgb.txt", "1000 rgb/none.png\n");
        recording
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    pub(super) fn write(&self, name: &str, words: &str) {
        std::fs::write(self.path(name), words).unwrap();
    }

    pub(super) fn write_depth(&self, index: u64, depth: &[u16]) {
        let image = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(160, 120, depth.to_vec()).unwrap();
        image.save(self.path(&format!("depth/{index}.png"))).unwrap();
    }
}
