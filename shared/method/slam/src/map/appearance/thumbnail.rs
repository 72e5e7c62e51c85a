//! A surface shrunk to a small image, in which noise and small motions vanish.

use tessera_surface::SurfaceView;

/// Columns.
pub(crate) const WIDTH: usize = 40;
/// Rows.
pub(crate) const HEIGHT: usize = 30;

/// Means over the measured vertices of a tile.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Tile {
    /// Metres; 0 where nothing is measured.
    pub(crate) depth_m: f32,
    /// Red, green, blue, 0 to 255.
    pub(crate) rgb: [f32; 3],
    /// Share of the tile that is measured.
    pub(crate) measured: f32,
}

/// Shrinks a surface to [`WIDTH`] times [`HEIGHT`] tiles, row by row.
pub(crate) fn shrink(surface: &SurfaceView<'_>) -> Vec<Tile> {
    let mut tiles = vec![Tile::default(); WIDTH * HEIGHT];
    let (width, height) = (surface.grid.width, surface.grid.height);
    if surface.grid.is_empty() || surface.vertices.len() != surface.grid.len() {
        return tiles;
    }
    for (row, line) in surface.vertices.chunks_exact(width).enumerate() {
        let tile_row = row * HEIGHT / height * WIDTH;
        for (column, vertex) in line.iter().enumerate() {
            if !vertex.is_valid() {
                continue;
            }
            let tile = &mut tiles[tile_row + column * WIDTH / width];
            tile.depth_m += vertex.position[2];
            tile.measured += 1.0;
            for (sum, value) in tile.rgb.iter_mut().zip(vertex.rgb()) {
                *sum += f32::from(value);
            }
        }
    }
    let whole = (width * height) as f32 / tiles.len() as f32;
    for tile in tiles.iter_mut().filter(|t| t.measured > 0.0) {
        let scale = 1.0 / tile.measured;
        tile.depth_m *= scale;
        tile.rgb = tile.rgb.map(|v| v * scale);
        tile.measured /= whole;
    }
    tiles
}
