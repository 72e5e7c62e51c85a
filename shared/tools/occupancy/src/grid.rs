//! An occupancy grid, and the rectangle of it that changed.

/// A cell that was seen through, or is floor; numbers as in `nav_msgs/msg/OccupancyGrid`.
pub const FREE: u8 = 0;
/// A cell with something in it.
pub const OCCUPIED: u8 = 100;
/// A cell that was not seen.
pub const UNKNOWN: u8 = -1i8 as u8;

/// Cells row by row, the first with the least x and y.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OccupancyCells {
    /// The first cell, in cells from the origin of the frame.
    pub begin: [i32; 2],
    /// Cells of a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// [`FREE`], [`OCCUPIED`] or [`UNKNOWN`] each.
    pub cells: Vec<u8>,
}

/// A rectangle of a grid, its first cell in cells from that of the grid.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GridPart {
    /// Column of the first cell.
    pub x: u32,
    /// Row of the first cell.
    pub y: u32,
    /// Cells of a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The new cells.
    pub cells: Vec<u8>,
}

impl OccupancyCells {
    /// Whether it has the place and the size of another one, so that parts of it say what changed.
    pub fn fits(&self, other: &Self) -> bool {
        (self.begin, self.width, self.height) == (other.begin, other.width, other.height)
    }

    /// The rectangle of all cells that differ from those of a grid that fits; `None` where none does.
    pub fn change(&self, before: &Self) -> Option<GridPart> {
        let width = self.width as usize;
        let pairs = self.cells.iter().zip(&before.cells).enumerate();
        let changed = || pairs.clone().filter(|(_, (new, old))| new != old).map(|(at, _)| at);
        let (top, bottom) = (changed().next()? / width, changed().next_back()? / width);
        let (left, right) = (changed().map(|at| at % width).min()?, changed().map(|at| at % width).max()?);
        let rows = self.cells.chunks(width).take(bottom + 1).skip(top);
        let cells = rows.flat_map(|row| &row[left..=right]).copied().collect();
        let (x, y) = (left as u32, top as u32);
        Some(GridPart { x, y, width: (right - left + 1) as u32, height: (bottom - top + 1) as u32, cells })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_change_is_the_least_rectangle() {
        let grid = |changes: &[usize]| {
            let mut cells = vec![UNKNOWN; 20];
            changes.iter().for_each(|at| cells[*at] = FREE);
            OccupancyCells { begin: [-3, 2], width: 5, height: 4, cells }
        };
        assert_eq!(grid(&[]).change(&grid(&[])), None);
        let part = grid(&[6, 13]).change(&grid(&[])).unwrap();
        let cells = vec![FREE, UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, FREE];
        assert_eq!(part, GridPart { x: 1, y: 1, width: 3, height: 2, cells });
        let whole = GridPart { x: 0, y: 0, width: 5, height: 4, cells: grid(&[0, 19]).cells };
        assert_eq!(grid(&[0, 19]).change(&grid(&[])), Some(whole));
        assert!(
            grid(&[3]).fits(&grid(&[])) && !grid(&[]).fits(&OccupancyCells { begin: [0, 2], ..grid(&[]) })
        );
    }
}
