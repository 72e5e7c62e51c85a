//! Colour, depth and mesh of single frames, read once more from the recording.

use crate::{ThumbnailError, WorstFrame, depth_picture, photograph};
use tessera_geometry::Camera;
use tessera_outputs::Replay;
use tessera_settings::Settings;
use tessera_sources::{FrameBuffers, Source};
use tessera_surface::{Grid, Reconstructor, Vertex};

/// Where the light comes from that shows the mesh: over the camera's left shoulder.
const TO_LIGHT: [f32; 3] = [-0.35, -0.55, -0.76];
/// Colour of a surface in full light.
const LIT: [f32; 3] = [225.0, 230.0, 240.0];
/// Columns that a picture of the mesh has at least.
const LEAST_COLUMNS: usize = 320;

/// Adds the pictures; an error says in words why there are none.
pub(super) fn add(worst: &mut [WorstFrame], replay: &Replay, settings: &Settings) -> Result<(), String> {
    if worst.is_empty() {
        return Ok(());
    }
    let (spec, options) = settings.source();
    let source = tessera_sources::open(&spec, &options)
        .map_err(|error| format!("the recording cannot be opened: {error}"))?;
    let mut reconstructor =
        Reconstructor::new(source.camera(), &settings.surface).map_err(|error| error.to_string())?;
    for frame in worst {
        let place = replay.frames.binary_search_by_key(&frame.index, |record| record.index);
        let record = place.ok().and_then(|place| replay.frames.get(place));
        if source.stamp_nanos(frame.index) != record.map(|record| record.stamp_nanos) {
            return Err(format!("the recording has changed: frame {} has another time", frame.index));
        }
        add_to(frame, &*source, &mut reconstructor)?;
    }
    Ok(())
}

#[expect(clippy::arithmetic_side_effects, reason = "an image of the camera's size, which is checked")]
fn add_to(frame: &mut WorstFrame, source: &dyn Source, surface: &mut Reconstructor) -> Result<(), String> {
    let Camera { width, height, .. } = *source.camera();
    let (width, height) = (width as usize, height as usize);
    let mut depth = vec![0u16; width * height];
    let mut colour = vec![0u8; 3 * width * height];
    let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut colour };
    let info = source
        .read(frame.index, &mut buffers)
        .map_err(|error| format!("the recording cannot be read: {error}"))?;
    let words = |error: ThumbnailError| error.to_string();
    if info.has_colour {
        frame.pictures.push(("colour".into(), photograph(width, height, &colour).map_err(words)?));
    }
    frame.pictures.push(("depth".into(), depth_picture(width, height, &depth).map_err(words)?));
    let grid = surface.grid();
    let mut vertices = vec![Vertex::default(); grid.len()];
    surface.reconstruct(&depth, info.has_colour.then_some(&colour), &mut vertices);
    let (columns, rows, rgb) = shaded(grid, &vertices);
    frame.pictures.push(("mesh".into(), photograph(columns, rows, &rgb).map_err(words)?));
    Ok(())
}

/// The mesh as the camera sees it, lit from one side: each quad in the light of its corners.
#[expect(
    clippy::arithmetic_side_effects,
    clippy::cast_possible_truncation,
    clippy::indexing_slicing,
    reason = "places in a grid and in its picture"
)]
fn shaded(grid: Grid, vertices: &[Vertex]) -> (usize, usize, Vec<u8>) {
    let scale = LEAST_COLUMNS.div_ceil(grid.width).max(1);
    let (columns, rows) = (grid.width * scale, grid.height * scale);
    let mut rgb = vec![255u8; 3 * columns * rows];
    for row in 0..grid.height.saturating_sub(1) {
        for column in 0..grid.width.saturating_sub(1) {
            let at = row * grid.width + column;
            let corners = [at, at + 1, at + grid.width, at + grid.width + 1].map(|at| &vertices[at]);
            if !corners.iter().all(|vertex| vertex.is_valid()) {
                continue;
            }
            let light = corners.map(|vertex| {
                let n = &vertex.normal;
                (n[0] * TO_LIGHT[0] + n[1] * TO_LIGHT[1] + n[2] * TO_LIGHT[2]).max(0.0)
            });
            for y in 0..scale {
                for x in 0..scale {
                    let (u, v) = (x as f32 / scale as f32, y as f32 / scale as f32);
                    let top = light[0] * (1.0 - u) + light[1] * u;
                    let bottom = light[2] * (1.0 - u) + light[3] * u;
                    let shade = 0.15 + 0.85 * (top * (1.0 - v) + bottom * v);
                    let place = 3 * ((row * scale + y) * columns + column * scale + x);
                    for (k, lit) in LIT.into_iter().enumerate() {
                        rgb[place + k] = (lit * shade) as u8;
                    }
                }
            }
        }
    }
    (columns, rows, rgb)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quads_are_grey_and_holes_are_white() {
        let grid = Grid { width: 160, height: 3, step: 4 };
        let mut vertices =
            vec![
                Vertex { flags_rgb: Vertex::VALID, normal: [0.0, 0.0, -1.0], ..Vertex::default() };
                grid.len()
            ];
        vertices[0].flags_rgb = 0;
        let (columns, rows, rgb) = shaded(grid, &vertices);
        assert_eq!((columns, rows), (320, 6));
        assert_eq!(rgb[0], 255);
        assert_eq!(rgb[3 * 10], (225.0 * (0.15 + 0.85 * 0.76f32)) as u8);
    }

    #[test]
    fn a_recording_that_is_gone_is_told() {
        let mut settings = Settings::default();
        settings.run.source = "/no/where".into();
        let mut worst = [WorstFrame::default()];
        let reason = add(&mut worst, &Replay::default(), &settings).unwrap_err();
        assert!(reason.contains("cannot be opened") && reason.contains("/no/where"), "{reason}");
    }
}
