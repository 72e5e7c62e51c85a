//! An occupancy grid as `nav_msgs/msg/OccupancyGrid`, and its changes as
//! `map_msgs/msg/OccupancyGridUpdate`.

use serde::Serialize;
use tessera_recording::ros::{Header, RosPose, Time};

/// What a cell can be: numbers of 8 bits with a sign.
pub(crate) const FREE: u8 = 0;
pub(crate) const OCCUPIED: u8 = 100;
pub(crate) const UNKNOWN: u8 = -1i8 as u8;

/// Cells row by row, the first with the least x and y.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Grid {
    /// The first cell, in cells from the origin of the frame.
    pub(crate) begin: [i32; 2],
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) cells: Vec<u8>,
}

/// A rectangle of a grid, its first cell in cells from that of the grid.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Part {
    x: u32,
    y: u32,
    width: u32,
    height: u32,
    cells: Vec<u8>,
}

impl Grid {
    /// Whether it has the place and the size of another one, so that parts of it say what changed.
    pub(crate) fn fits(&self, other: &Self) -> bool {
        (self.begin, self.width, self.height) == (other.begin, other.width, other.height)
    }

    /// The rectangle of all cells that differ from those of a grid that fits; `None` where none does.
    pub(crate) fn change(&self, before: &Self) -> Option<Part> {
        let width = self.width as usize;
        let pairs = self.cells.iter().zip(&before.cells).enumerate();
        let changed = || pairs.clone().filter(|(_, (new, old))| new != old).map(|(at, _)| at);
        let (top, bottom) = (changed().next()? / width, changed().next_back()? / width);
        let (left, right) = (changed().map(|at| at % width).min()?, changed().map(|at| at % width).max()?);
        let rows = self.cells.chunks(width).take(bottom + 1).skip(top);
        let cells = rows.flat_map(|row| &row[left..=right]).copied().collect();
        let (x, y) = (left as u32, top as u32);
        Some(Part { x, y, width: (right - left + 1) as u32, height: (bottom - top + 1) as u32, cells })
    }

    /// The message; cells have that edge, metres.
    pub(crate) fn message<'a>(&'a self, header: Header<'a>, cell_m: f64) -> OccupancyGrid<'a> {
        let [x, y] = self.begin.map(|cells| f64::from(cells) * cell_m);
        let info = MapMetaData {
            map_load_time: header.stamp,
            resolution: cell_m as f32,
            width: self.width,
            height: self.height,
            origin: RosPose { position: [x, y, 0.0], orientation_xyzw: [0.0, 0.0, 0.0, 1.0] },
        };
        OccupancyGrid { header, info, data: &self.cells }
    }
}

impl Part {
    /// The message.
    pub(crate) fn message<'a>(&'a self, header: Header<'a>) -> OccupancyGridUpdate<'a> {
        let Self { x, y, width, height, .. } = *self;
        OccupancyGridUpdate { header, x: x as i32, y: y as i32, width, height, data: &self.cells }
    }
}

/// `nav_msgs/msg/MapMetaData`.
#[derive(Clone, Copy, Debug, Serialize)]
struct MapMetaData {
    map_load_time: Time,
    resolution: f32,
    width: u32,
    height: u32,
    origin: RosPose,
}

/// `nav_msgs/msg/OccupancyGrid`.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct OccupancyGrid<'a> {
    header: Header<'a>,
    info: MapMetaData,
    #[serde(with = "serde_bytes")]
    data: &'a [u8],
}

/// `map_msgs/msg/OccupancyGridUpdate`.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct OccupancyGridUpdate<'a> {
    header: Header<'a>,
    x: i32,
    y: i32,
    width: u32,
    height: u32,
    #[serde(with = "serde_bytes")]
    data: &'a [u8],
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_change_is_the_least_rectangle() {
        let grid = |changes: &[usize]| {
            let mut cells = vec![UNKNOWN; 20];
            changes.iter().for_each(|at| cells[*at] = FREE);
            Grid { begin: [-3, 2], width: 5, height: 4, cells }
        };
        assert_eq!(grid(&[]).change(&grid(&[])), None);
        let part = grid(&[6, 13]).change(&grid(&[])).unwrap();
        let cells = vec![FREE, UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, FREE];
        assert_eq!(part, Part { x: 1, y: 1, width: 3, height: 2, cells });
        let whole = Part { x: 0, y: 0, width: 5, height: 4, cells: grid(&[0, 19]).cells };
        assert_eq!(grid(&[0, 19]).change(&grid(&[])), Some(whole));
        assert!(grid(&[3]).fits(&grid(&[])) && !grid(&[]).fits(&Grid { begin: [0, 2], ..grid(&[]) }));
    }
}
