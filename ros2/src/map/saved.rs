//! The grid as files that Nav2's map_server reads: `map.yaml` beside `map.pgm`.

use super::grid::{FREE, Grid, OCCUPIED};
use super::mapper::GridUpdate;
use super::worker::{MapOptions, Update, Wanted, Worker};
use crate::base::Base;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::sync_channel;
use std::thread::JoinHandle;
use tessera_journal::{Durability, write_atomically};
use tessera_transport::RunEntry;

/// The files.
const IMAGE: &str = "map.pgm";
const DESCRIPTION: &str = "map.yaml";
/// Greys of map_server's mode `trinary`. A cell is occupied with the probability (255 - grey) / 255.
const GREY_FREE: u8 = 254;
const GREY_OCCUPIED: u8 = 0;
const GREY_UNKNOWN: u8 = 205;
/// Between these probabilities a cell is unknown, as map_server's own files have it: 205 is 0.1961.
const OCCUPIED_FROM: f64 = 0.65;
const FREE_BELOW: f64 = 0.196;

/// Writes the grid of the run so far into its folder, on a thread of its own; answers how many cells it
/// has, or why there is none.
pub(crate) fn save_grid(
    entry: &RunEntry,
    options: MapOptions,
    base: &Base,
) -> JoinHandle<Result<usize, String>> {
    let (to, updates) = sync_channel(1);
    // Over: what the journal has now is all.
    let wanted = Arc::<Wanted>::default();
    wanted.grid.store(true, Ordering::Relaxed);
    wanted.is_over.store(true, Ordering::Release);
    let worker = Worker { entry: entry.clone(), options, base: base.clone(), wanted, to };
    let dir = entry.run_dir.clone();
    std::thread::spawn(move || {
        let made = std::thread::spawn(move || worker.work());
        let (mut grid, mut trouble) = (None, "there is no keyframe yet".to_owned());
        for update in updates {
            match update {
                Update::Grid(_, GridUpdate::Whole(whole)) => grid = Some(whole),
                Update::Trouble(why) => trouble = why,
                _ => {}
            }
        }
        made.join().map_err(|_| "the grid could not be made".to_owned())?;
        let grid = grid.ok_or(trouble)?;
        write(&grid, options.cell_m, &dir).map_err(|error| error.to_string())?;
        Ok(grid.cells.len())
    })
}

/// Both files, the image first: what describes it is there once it is.
fn write(grid: &Grid, cell_m: f64, dir: &Path) -> std::io::Result<()> {
    write_atomically(&dir.join(IMAGE), Durability::Output, |file| {
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
    write_atomically(&dir.join(DESCRIPTION), Durability::Output, |file| {
        writeln!(file, "image: {IMAGE}\nmode: trinary\nresolution: {cell_m}\norigin: [{x:.4}, {y:.4}, 0]")?;
        writeln!(file, "negate: 0\noccupied_thresh: {OCCUPIED_FROM}\nfree_thresh: {FREE_BELOW}")
    })
}

#[cfg(test)]
mod tests {
    use super::super::grid::UNKNOWN;
    use super::*;

    #[test]
    fn a_map_server_reads_back_what_was_written() {
        let dir = tempfile::tempdir().unwrap();
        let cells = vec![FREE, OCCUPIED, UNKNOWN, FREE, FREE, OCCUPIED];
        write(&Grid { begin: [-4, 2], width: 3, height: 2, cells: cells.clone() }, 0.05, dir.path()).unwrap();
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
