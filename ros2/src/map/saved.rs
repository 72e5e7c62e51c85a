//! The grid as files that Nav2's map_server reads: `map.yaml` beside `map.pgm`.

use super::mapper::GridUpdate;
use super::worker::{MapOptions, MapUpdate, Wanted, Worker};
use crate::poses::base::Base;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::sync_channel;
use std::thread::JoinHandle;
use tessera_occupancy::write_map;
use tessera_transport::RunEntry;

/// The description of the grid in the folder of a run.
const DESCRIPTION: &str = "map.yaml";

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
                MapUpdate::Grid(_, GridUpdate::Whole(whole)) => grid = Some(whole),
                MapUpdate::Trouble(why) => trouble = why,
                _ => {}
            }
        }
        made.join().map_err(|_| "the grid could not be made".to_owned())?;
        let grid = grid.ok_or(trouble)?;
        write_map(&grid, options.cell_m, &dir.join(DESCRIPTION)).map_err(|error| error.to_string())?;
        Ok(grid.cells.len())
    })
}
