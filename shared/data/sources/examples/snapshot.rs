//! Writes one frame of a source as two PNG files to look at, and says how long frames take.
//!
//! `cargo run --release -p tessera-sources --example snapshot -- room 30 /tmp/room`

use std::time::Instant;
use tessera_sources::{FrameBuffers, SourceOptions, SourceSpec, check, open};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [source, index, prefix, rest @ ..] = words.as_slice() else {
        return Err("expected: SOURCE INDEX PREFIX [SIMULATION_OPTIONS_AS_TOML]".into());
    };
    let mut options = SourceOptions::default();
    if let [text, ..] = rest {
        options.simulation = toml::from_str(text)?;
    }
    let source = open(&SourceSpec::parse(source), &options)?;
    let (width, height) = (source.camera().width, source.camera().height);
    let n_pixels = (width * height) as usize;
    let (mut depth, mut colour) = (vec![0u16; n_pixels], vec![0u8; 3 * n_pixels]);
    let index: u64 = index.parse()?;
    let n_timed = 20;
    let start = Instant::now();
    for k in (0..n_timed).rev() {
        let at = (index + 7 * k) % source.n_frames().unwrap_or(u64::MAX);
        source.read(at, &mut FrameBuffers { depth: &mut depth, colour: &mut colour })?;
    }
    println!("{:.1} ms a frame", start.elapsed().as_secs_f64() * 1e3 / n_timed as f64);
    println!("{:#?}", check(source.as_ref(), 8)?);
    image::save_buffer(format!("{prefix}_colour.png"), &colour, width, height, image::ColorType::Rgb8)?;
    let grey: Vec<u8> = depth.iter().map(|&raw| (u32::from(raw) / 100).min(255) as u8).collect();
    image::save_buffer(format!("{prefix}_depth.png"), &grey, width, height, image::ColorType::L8)?;
    Ok(())
}
