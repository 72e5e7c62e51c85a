//! Frames spread over a source side by side, depth below colour, as one PNG file to look at.
//!
//! `cargo run --release -p tessera-sources --example contact_sheet -- house /tmp/house.png`

use tessera_sources::{FrameBuffers, SourceOptions, SourceSpec, open};

const COLUMNS: usize = 6;
const ROWS: usize = 3;
/// Every fourth pixel.
const STEP: usize = 3;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [name, file, rest @ ..] = words.as_slice() else {
        return Err("expected: SOURCE FILE [OPTIONS_AS_TOML]".into());
    };
    let mut options = SourceOptions::default();
    if let [text, ..] = rest {
        options = toml::from_str(text)?;
    }
    let source = open(&SourceSpec::parse(name), &options)?;
    let (width, height) = (source.camera().width as usize, source.camera().height as usize);
    let (mut depth, mut colour) = (vec![0u16; width * height], vec![0u8; 3 * width * height]);
    let (small_width, small_height) = (width / STEP, height / STEP);
    let (sheet_width, sheet_height) = (COLUMNS * small_width, 2 * ROWS * small_height);
    let mut sheet = vec![0u8; 3 * sheet_width * sheet_height];
    let n_frames = source.n_frames().unwrap_or(1000);
    for tile in 0..COLUMNS * ROWS {
        let index = tile as u64 * n_frames / (COLUMNS * ROWS) as u64;
        source.read(index, &mut FrameBuffers { depth: &mut depth, colour: &mut colour })?;
        let (left, top) = (tile % COLUMNS * small_width, 2 * (tile / COLUMNS) * small_height);
        for row in 0..small_height {
            for column in 0..small_width {
                let from = row * STEP * width + column * STEP;
                let to = 3 * ((top + row) * sheet_width + left + column);
                sheet[to..to + 3].copy_from_slice(&colour[3 * from..3 * from + 3]);
                let below = to + 3 * small_height * sheet_width;
                let metres = f64::from(depth[from]) / source.camera().units_per_metre;
                let grey = if depth[from] == 0 { 0.0 } else { 255.0 - 45.0 * metres };
                sheet[below..below + 3].fill(grey.clamp(0.0, 255.0) as u8);
            }
        }
    }
    image::save_buffer(file, &sheet, sheet_width as u32, sheet_height as u32, image::ColorType::Rgb8)?;
    Ok(())
}
