//! Cells of the building: what of it may be seen from where.

use super::{CORRIDOR_HALF_M, N_STOREYS, ROWS_END_M, STOREY_M};
use std::ops::Range;

/// Parts of a storey that see each other through doors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Zone {
    /// The northern row of rooms.
    North,
    /// The southern row of rooms.
    South,
    /// The corridor.
    Corridor,
    /// The lobbies and the lift: open to all.
    Lobby,
}

/// A room with its solids.
#[derive(Clone, Debug)]
pub(crate) struct Cell {
    /// In the list of all solids.
    pub(super) solids: Range<usize>,
    /// Storey and zone; `None`: seen from everywhere.
    place: Option<Place>,
    /// Middle and half sides of a box around its solids, world, metres; `None`: it moves.
    pub(crate) bounds: Option<[[f32; 3]; 2]>,
}

/// A part of the building.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) storey: usize,
    pub(super) zone: Zone,
}

impl Cell {
    /// A cell between two corners, world, metres.
    pub(super) fn new(place: Place, solids: Range<usize>, low: [f64; 3], high: [f64; 3]) -> Self {
        let middle = std::array::from_fn(|k| (0.5 * (low[k] + high[k])) as f32);
        let half = std::array::from_fn(|k| (0.5 * (high[k] - low[k])) as f32);
        Self { solids, place: Some(place), bounds: Some([middle, half]) }
    }

    /// A cell that may be seen from every place: it moves.
    pub(crate) fn everywhere(solids: Range<usize>) -> Self {
        Self { solids, place: None, bounds: None }
    }

    /// Whether it may be seen from a place: the other row of rooms and the other storeys may not.
    pub(super) fn is_open_to(&self, here: &Place) -> bool {
        self.place.is_none_or(|place| {
            let is_open = |zone: Zone| zone == Zone::Lobby || zone == here.zone;
            place.storey == here.storey && (here.zone == Zone::Lobby || is_open(place.zone))
        })
    }
}

impl Place {
    /// Where a point is, world, metres.
    pub(super) fn of(point: &[f32; 3]) -> Self {
        let [x, y, z] = point.map(f64::from);
        let storey = ((z / STOREY_M).max(0.0) as usize).min(N_STOREYS - 1);
        let zone = if x.abs() > ROWS_END_M {
            Zone::Lobby
        } else if y > CORRIDOR_HALF_M {
            Zone::North
        } else if y < -CORRIDOR_HALF_M {
            Zone::South
        } else {
            Zone::Corridor
        };
        Self { storey, zone }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_hidden_from_each_other_and_storeys_too() {
        let at = |x: f32, y: f32, z: f32| Place::of(&[x, y, z]);
        let north = at(2.0, 3.0, 4.4);
        assert_eq!(north, Place { storey: 1, zone: Zone::North });
        let cell = Cell::new(north, 0..5, [0.0; 3], [1.0; 3]);
        for (place, is_open) in [
            (at(-7.0, 4.0, 4.4), true),
            (at(-7.0, -4.0, 4.4), false),
            (at(-7.0, 0.0, 4.4), false),
            (at(-11.0, 0.0, 4.4), true),
            (at(-7.0, 4.0, 1.4), false),
        ] {
            assert_eq!(cell.is_open_to(&place), is_open, "{place:?}");
        }
        assert!(Cell::everywhere(0..5).is_open_to(&north));
    }
}
