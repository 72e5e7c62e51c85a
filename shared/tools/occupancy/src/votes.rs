//! The words of all keyframes: sums of votes, and thus the same in whatever order they came.

use crate::grid::{FREE, OCCUPIED, OccupancyCells, UNKNOWN};
use crate::lattice::{CellLattice, N_FLOOR};
use crate::scan::{CellEvidence, RayScan};
use std::collections::BTreeMap;

/// Cells of a tile's edge. Grids begin and end with a tile, so that their size changes seldom.
const TILE: i32 = 32;

#[derive(Clone, Copy, Default)]
struct Count {
    hits: u16,
    passes: u16,
}

impl Count {
    /// One who saw something counts as much as two who saw through: about the log odds of OctoMap,
    /// 0.85 and -0.41 (Hornung et al., Autonomous Robots 2013).
    fn is_occupied(self) -> bool {
        self.hits > 0 && u32::from(self.passes) <= 2 * u32::from(self.hits)
    }
}

/// CellVotes by tile, where there are any: each a count for each cell, row by row, and each of its layers.
pub struct CellVotes {
    n_layers: usize,
    tiles: BTreeMap<[i32; 2], Vec<Count>>,
}

impl CellVotes {
    /// None yet.
    pub fn new(lattice: &CellLattice) -> Self {
        Self { n_layers: lattice.n_layers, tiles: BTreeMap::new() }
    }

    /// Takes in what a keyframe says.
    pub fn add(&mut self, scan: &RayScan) {
        let n_layers = self.n_layers;
        for (cell, words) in scan.cells() {
            let tile = self.tiles.entry(cell.map(|c| c.div_euclid(TILE)));
            let tile = tile.or_insert_with(|| vec![Count::default(); (TILE * TILE) as usize * n_layers]);
            let [x, y] = cell.map(|c| c.rem_euclid(TILE));
            let begin = (y * TILE + x) as usize * n_layers;
            for (count, word) in tile[begin..begin + n_layers].iter_mut().zip(words) {
                match word {
                    CellEvidence::None => {}
                    CellEvidence::Free => count.passes = count.passes.saturating_add(1),
                    CellEvidence::Hit => count.hits = count.hits.saturating_add(1),
                }
            }
        }
    }

    /// The grid: occupied where any layer of the band is, else free where any layer was seen through;
    /// `None` while there is no vote.
    pub fn grid(&self) -> Option<OccupancyCells> {
        let ends = |axis: usize| {
            let tiles = || self.tiles.keys().map(|tile| tile[axis]);
            Some((tiles().min()?, tiles().max()?))
        };
        let ((left, right), (near, far)) = (ends(0)?, ends(1)?);
        let width = ((right - left + 1) * TILE) as usize;
        let height = ((far - near + 1) * TILE) as usize;
        let mut cells = vec![UNKNOWN; width * height];
        for ([tile_x, tile_y], counts) in &self.tiles {
            let corner = ((tile_y - near) * TILE) as usize * width + ((tile_x - left) * TILE) as usize;
            for (at, layers) in counts.chunks(self.n_layers).enumerate() {
                let (row, column) = (at / TILE as usize, at % TILE as usize);
                cells[corner + row * width + column] = state(layers);
            }
        }
        let (width, height) = (width as u32, height as u32);
        Some(OccupancyCells { begin: [left * TILE, near * TILE], width, height, cells })
    }
}

fn state(layers: &[Count]) -> u8 {
    if layers[N_FLOOR..].iter().any(|count| count.is_occupied()) {
        return OCCUPIED;
    }
    if layers.iter().any(|count| count.passes > 0) { FREE } else { UNKNOWN }
}
