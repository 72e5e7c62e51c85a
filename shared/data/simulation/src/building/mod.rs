//! The building: three storeys joined by a lift, with rooms that look alike.
//!
//! Each storey is 24.8 m x 12 m: two rows of four rooms, a bare corridor of 20 m between them, and a lobby
//! at either end, but where other proportions are drawn. The lift stands before the western lobby. Rooms of one kind are the same to the camera,
//! wherever they are; one room of each row, the lobbies and the corridor are of one storey alone.

mod cells;
mod furnish;
mod lift;
mod proportions;
mod rooms;
mod storey;
mod way;

pub(super) use cells::{BuildingCell, CellBounds};
pub(super) use proportions::Proportions;
pub(super) use way::Way;

use crate::furniture::Builder;
use crate::random;
use crate::solid::Carried;
use std::ops::Range;

/// Storeys.
pub(super) const N_STOREYS: usize = 3;
/// From floor to floor, metres.
pub(super) const STOREY_M: f64 = 3.0;
/// From floor to ceiling, metres.
const HEIGHT_M: f32 = 2.6;
/// Side of a room, metres.
const ROOM_M: f64 = 5.0;
/// Middles of the rooms of a row, metres along x.
const COLUMNS_M: [f64; 4] = [-7.5, -2.5, 2.5, 7.5];
/// Where rooms end and lobbies begin, metres along x to either side.
const ROWS_END_M: f64 = 10.0;
/// Where lobbies end.
const LOBBY_END_M: f64 = 12.4;
/// Middle of the lift's cabin, metres along x.
const CABIN_M: f64 = -13.6;
/// Half side of the cabin.
const CABIN_HALF_M: f64 = 0.95;

/// All solids, in cells.
pub(super) fn build(builder: &mut Builder, key: u64, proportions: &Proportions) -> Vec<BuildingCell> {
    let mut cells = Vec::new();
    for number in 0..N_STOREYS {
        storey::build(builder, proportions, (key, number), &mut cells);
    }
    let first = builder.solids.len();
    lift::build(builder, random::word(key, 0x11f7));
    cells.push(BuildingCell::everywhere(first..builder.solids.len()));
    cells
}

/// Where what moves is at a time: the cabin and its door by the way, people by the clock.
pub(super) fn carried(way: &Way, way_s: f64, time_s: f64) -> Carried {
    let height_m = way.height_m(way_s) as f32;
    let leaf_m = lift::DOOR_M * (1.0 - way.door(way_s)) as f32;
    Carried {
        cabin: [0.0, 0.0, height_m],
        leaf: [0.0, leaf_m, height_m],
        passers: std::array::from_fn(|who| storey::passer_at(way.proportions(), who, time_s)),
        ..Carried::default()
    }
}

/// Numbers of the solids that may be seen from a place where `is_in_view` tells what a camera has in its
/// image, cell by cell.
pub(super) fn visible(
    (cells, proportions): (&[BuildingCell], &Proportions),
    place: &[f32; 3],
    is_in_view: impl Fn(&CellBounds) -> bool,
) -> impl Iterator<Item = Range<u32>> {
    let here = cells::CellPlace::of(proportions, place);
    let seen = cells.iter().filter(move |cell| cell.may_be_seen(&here, proportions, &is_in_view));
    seen.map(|cell| cell.solids.start as u32..cell.solids.end as u32)
}
