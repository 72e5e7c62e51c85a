//! Writes the frames of any source as a folder in the TUM layout, with camera and ground truth.
//!
//! `cargo run --release -p tessera-sources --example write_folder -- SOURCE FOLDER [FRAMES [CAMERA]]`
#![forbid(unsafe_code)]

use std::error::Error;
use std::fmt::Write;
use std::path::Path;
use tessera_sources::{FrameBuffers, Source, SourceOptions, SourceSpec};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [source, folder, rest @ ..] = arguments.as_slice() else {
        return Err("expected: SOURCE FOLDER [FRAMES [CAMERA]]".into());
    };
    let frames = rest.first().map(|n| n.parse()).transpose()?;
    let options = SourceOptions { frames, camera: rest.get(1).cloned(), ..SourceOptions::default() };
    let source = tessera_sources::open(&SourceSpec::parse(source), &options)?;
    write(&*source, Path::new(folder))
}

fn write(source: &dyn Source, folder: &Path) -> Result<(), Box<dyn Error>> {
    let camera = source.camera();
    let (width, height) = (camera.width, camera.height);
    let n = (width * height) as usize;
    let (mut depth, mut colour) = (vec![0_u16; n], vec![0_u8; 3 * n]);
    let mut lists = [String::new(), String::new()];
    for sub in ["depth", "rgb"] {
        std::fs::create_dir_all(folder.join(sub))?;
    }
    let mut index = 0;
    while let Some(stamp_nanos) = source.stamp_nanos(index) {
        source.read(index, &mut FrameBuffers { depth: &mut depth, colour: &mut colour })?;
        let names = ["depth", "rgb"].map(|sub| format!("{sub}/{index:06}.png"));
        // Samples of 16 bits are taken in the machine's own order.
        let bytes: &[u8] = bytemuck::cast_slice(&depth);
        image::save_buffer(folder.join(&names[0]), bytes, width, height, image::ExtendedColorType::L16)?;
        image::save_buffer(folder.join(&names[1]), &colour, width, height, image::ExtendedColorType::Rgb8)?;
        for (list, name) in lists.iter_mut().zip(&names) {
            writeln!(list, "{}.{:09} {name}", stamp_nanos / 1_000_000_000, stamp_nanos % 1_000_000_000)?;
        }
        index += 1;
    }
    std::fs::write(folder.join("depth.txt"), &lists[0])?;
    std::fs::write(folder.join("rgb.txt"), &lists[1])?;
    std::fs::write(folder.join("camera.toml"), toml::to_string(camera)?)?;
    if let Some(truth) = source.ground_truth() {
        let mut text = String::new();
        for (stamp_nanos, pose) in truth.stamps_nanos.iter().zip(&truth.poses) {
            let (t, q) = (pose.translation, pose.rotation.quaternion());
            let (seconds, nanos) = (stamp_nanos / 1_000_000_000, stamp_nanos % 1_000_000_000);
            let [x, y, z] = [t.x, t.y, t.z];
            writeln!(text, "{seconds}.{nanos:09} {x} {y} {z} {} {} {} {}", q.i, q.j, q.k, q.w)?;
        }
        std::fs::write(folder.join("groundtruth.txt"), text)?;
    }
    Ok(())
}
