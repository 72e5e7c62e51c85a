//! The grid as files that Nav2's map_server reads: `map.yaml` beside `map.pgm`.

use crate::grid::{FREE, OCCUPIED, OccupancyCells};
use std::path::Path;
use tessera_journal::{Durability, write_atomically};

/// Greys of map_server's mode `trinary`. A cell is occupied with the probability (255 - grey) / 255.
const GREY_FREE: u8 = 254;
const GREY_OCCUPIED: u8 = 0;
const GREY_UNKNOWN: u8 = 205;
/// Between these probabilities a cell is unknown, as map_server's own files have it: 205 is 0.1961.
const OCCUPIED_FROM: f64 = 0.65;
const FREE_BELOW: f64 = 0.196;

/// Writes the description to `path` and the image beside it, the image first: what describes it is there
/// once it is. Cells have that edge, metres.
///
/// # Errors
/// Where a file cannot be written.
pub fn write_map(grid: &OccupancyCells, cell_m: f64, path: &Path) -> std::io::Result<()> {
    let image = path.with_extension("pgm");
    write_atomically(&image, Durability::Output, |file| {
        write!(file, "P5\n{} {}\n255\n", grid.width, grid.height)?;
        // The first row of the image is that with the greatest y.
        for row in grid.cells.chunks(grid.width as usize).rev() {
            let grey = |cell: &u8| match *cell {
                FREE => GREY_FREE,
                OCCUPIED => GREY_OCCUPIED,
                _ => GREY_UNKNOWN,
            };
            file.write_all(&row.iter().map(grey).collect::<Vec<u8>>())?;
        }
        Ok(())
    })?;
    let [x, y] = grid.begin.map(|cells| f64::from(cells) * cell_m);
    let name = image.file_name().unwrap_or_default().to_string_lossy();
    write_atomically(path, Durability::Output, |file| {
        writeln!(file, "image: {name}\nmode: trinary\nresolution: {cell_m}\norigin: [{x:.4}, {y:.4}, 0]")?;
        writeln!(file, "negate: 0\noccupied_thresh: {OCCUPIED_FROM}\nfree_thresh: {FREE_BELOW}")
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::UNKNOWN;

    #[test]
    fn a_map_server_reads_back_what_was_written() {
        let dir = tempfile::tempdir().unwrap();
        let cells = vec![FREE, OCCUPIED, UNKNOWN, FREE, FREE, OCCUPIED];
        let grid = OccupancyCells { begin: [-4, 2], width: 3, height: 2, cells: cells.clone() };
        write_map(&grid, 0.05, &dir.path().join("map.yaml")).unwrap();
        let words = std::fs::read_to_string(dir.path().join("map.yaml")).unwrap();
        assert_eq!(
            words,
            "image: map.pgm\nmode: trinary\nresolution: 0.05\norigin: [-0.2000, 0.1000, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
        );
        let image = std::fs::read(dir.path().join("map.pgm")).unwrap();
        let pixels = image.strip_prefix(b"P5\n3 2\n255\n").unwrap();
        // As map_server reads them: the last row first.
        let read: Vec<u8> = pixels
            .chunks(3)
            .rev()
            .flatten()
            .map(|grey| match f64::from(255 - grey) / 255.0 {
                p if p > OCCUPIED_FROM => OCCUPIED,
                p if p < FREE_BELOW => FREE,
                _ => UNKNOWN,
            })
            .collect();
        assert_eq!(read, cells);
    }
}
