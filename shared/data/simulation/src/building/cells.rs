//! Cells of the building: what of it may be seen from where.

use super::{HEIGHT_M, N_STOREYS, Proportions, ROWS_END_M, STOREY_M};
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
    /// The lobbies: open to all.
    Lobby,
    /// The inner part of the lift, from which no room is seen.
    Cabin,
}

/// Where the inner part of the lift begins, metres along x: from there its door hides those of the rooms.
const CABIN_INSIDE_M: f64 = -13.1;

/// A room with its solids.
#[derive(Clone, Debug)]
pub(crate) struct BuildingCell {
    /// In the list of all solids.
    pub(super) solids: Range<usize>,
    /// Storey and zone; `None`: seen from everywhere.
    place: Option<CellPlace>,
    /// Around its solids; `None`: it moves.
    bounds: Option<CellBounds>,
}

/// A part of the building.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct CellPlace {
    pub(super) storey: usize,
    pub(super) zone: Zone,
    /// Which lobby is the nearer one: 1 the eastern, -1 the western.
    pub(super) end: i8,
}

/// Middle and half sides of a box, world, metres.
pub(crate) type CellBounds = [[f32; 3]; 2];

impl BuildingCell {
    /// A cell between two corners, world, metres.
    pub(super) fn new(place: CellPlace, solids: Range<usize>, low: [f64; 3], high: [f64; 3]) -> Self {
        let middle = std::array::from_fn(|k| (0.5 * (low[k] + high[k])) as f32);
        let half = std::array::from_fn(|k| (0.5 * (high[k] - low[k])) as f32);
        Self { solids, place: Some(place), bounds: Some([middle, half]) }
    }

    /// A cell that may be seen from every place: it moves.
    pub(crate) fn everywhere(solids: Range<usize>) -> Self {
        Self { solids, place: None, bounds: None }
    }

    /// Whether it may be seen from a place where `is_in_view` tells what a camera has in its image.
    pub(super) fn may_be_seen(
        &self,
        here: &CellPlace,
        proportions: &Proportions,
        is_in_view: impl Fn(&CellBounds) -> bool,
    ) -> bool {
        self.is_open_to(here)
            && self.opening(here, proportions).is_none_or(|opening| is_in_view(&opening))
            && self.bounds.is_none_or(|bounds| is_in_view(&bounds))
    }

    /// The opening through which it is seen from a place; `None`: more than one.
    fn opening(&self, here: &CellPlace, proportions: &Proportions) -> Option<CellBounds> {
        let place = self.place.filter(|place| here.zone == Zone::Lobby && place.zone != Zone::Lobby)?;
        let (y, half_y) = match place.zone {
            Zone::North => (proportions.row_m(), 0.6),
            Zone::South => (-proportions.row_m(), 0.6),
            Zone::Corridor | Zone::Lobby | Zone::Cabin => (0.0, proportions.corridor_half_m),
        };
        let half_z = 0.5 * HEIGHT_M;
        let middle_z = (place.storey as f64 * STOREY_M) as f32 + half_z;
        let middle = [f32::from(here.end) * ROWS_END_M as f32, y as f32, middle_z];
        Some([middle, [0.1, half_y as f32, half_z]])
    }

    /// Whether any light comes from it to a place: none from the other row and from other storeys.
    fn is_open_to(&self, here: &CellPlace) -> bool {
        self.place.is_none_or(|place| {
            let is_open = |zone: Zone| zone == Zone::Lobby || zone == here.zone;
            let is_open = match here.zone {
                Zone::Lobby => true,
                Zone::Cabin => is_open(place.zone) || place.zone == Zone::Corridor,
                Zone::North | Zone::South | Zone::Corridor => is_open(place.zone),
            };
            place.storey == here.storey && is_open
        })
    }
}

impl CellPlace {
    /// Where a point is, world, metres.
    pub(super) fn of(proportions: &Proportions, point: &[f32; 3]) -> Self {
        let [x, y, z] = point.map(f64::from);
        let storey = ((z / STOREY_M).max(0.0) as usize).min(N_STOREYS - 1);
        let zone = if x < CABIN_INSIDE_M {
            Zone::Cabin
        } else if x.abs() > ROWS_END_M {
            Zone::Lobby
        } else if y > proportions.corridor_half_m {
            Zone::North
        } else if y < -proportions.corridor_half_m {
            Zone::South
        } else {
            Zone::Corridor
        };
        Self { storey, zone, end: if x > 0.0 { 1 } else { -1 } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_hidden_from_each_other_and_storeys_too() {
        let own = Proportions::drawn(0);
        let at = |x: f32, y: f32, z: f32| CellPlace::of(&own, &[x, y, z]);
        let north = at(2.0, 3.0, 4.4);
        assert_eq!(north, CellPlace { storey: 1, zone: Zone::North, end: 1 });
        let cell = BuildingCell::new(north, 0..5, [0.0; 3], [1.0; 3]);
        for (place, is_open) in [
            (at(-7.0, 4.0, 4.4), true),
            (at(-7.0, -4.0, 4.4), false),
            (at(-7.0, 0.0, 4.4), false),
            (at(-11.0, 0.0, 4.4), true),
            (at(-13.5, 0.0, 4.4), false),
            (at(-7.0, 4.0, 1.4), false),
        ] {
            assert_eq!(cell.is_open_to(&place), is_open, "{place:?}");
        }
        assert!(BuildingCell::everywhere(0..5).is_open_to(&north));
        // From a lobby a row is seen through its door alone.
        let sees_nothing_there = |bounds: &CellBounds| bounds[0][0] > -9.0;
        assert!(!cell.may_be_seen(&at(-11.0, 0.0, 4.4), &own, sees_nothing_there));
        assert!(cell.may_be_seen(&at(11.0, 0.0, 4.4), &own, sees_nothing_there));
    }
}
