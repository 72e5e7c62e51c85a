//! One storey: rooms, lobbies, corridor, and the people who walk there.

use super::cells::{BuildingCell, CellPlace, Zone};
use super::furnish::{RoomKind, lobby};
use super::{COLUMNS_M, HEIGHT_M, LOBBY_END_M, N_STOREYS, Proportions, ROOM_M, ROWS_END_M, STOREY_M, rooms};
use crate::furniture::Builder;
use crate::material::{Material, TexturePattern};
use crate::solid::{Carrier, N_PASSERS, Shape};
use crate::{person, random};
use std::f64::consts::TAU;

/// Doors of rooms, the opening before the lift, and the window of the eastern lobby, metres.
const DOOR_M: f32 = 1.0;
const LIFT_M: f32 = 1.0;
const GLASS_M: f32 = 1.6;
/// People of a storey.
const N_WHO: usize = N_PASSERS / N_STOREYS;

/// Where people of a storey turn round, metres from the middle of the storey, and how long that takes, seconds.
fn passers(proportions: &Proportions) -> [([f64; 2], [f64; 2], f64); N_WHO] {
    let y = proportions.row_m() - 1.6;
    [([11.95, 1.1], [11.95, 3.3], 5.0), ([1.4, y], [3.6, y], 4.0)]
}

/// A storey's solids in the builder, and its cells.
pub(super) fn build(
    builder: &mut Builder,
    proportions: &Proportions,
    (key, number): (u64, usize),
    cells: &mut Vec<BuildingCell>,
) {
    let row_m = proportions.row_m();
    let kinds = [
        [RoomKind::Office, RoomKind::Office, RoomKind::Lounge, RoomKind::Workshop(2 * number)],
        [RoomKind::Lounge, RoomKind::Office, RoomKind::Lounge, RoomKind::Workshop(2 * number + 1)],
    ];
    for ((row, zone), y) in kinds.into_iter().zip([Zone::North, Zone::South]).zip([row_m, -row_m]) {
        for (kind, x) in row.into_iter().zip(COLUMNS_M) {
            cell(builder, cells, (number, zone), ([x, y], [0.5 * ROOM_M; 2]), |builder, base| {
                builder.begin(random::word(key, 0xa0 + kind.number()), base, Carrier::World);
                room(builder, kind);
            });
        }
    }
    let own = |part: u64| random::word(key, 0xb00 + 16 * number as u64 + part);
    let half = [ROWS_END_M, proportions.corridor_half_m];
    cell(builder, cells, (number, Zone::Corridor), ([0.0; 2], half), |builder, base| {
        builder.begin(own(0), base, Carrier::World);
        corridor(builder, proportions, number);
    });
    // The eastern lobby has a recess behind glass.
    for (part, sign, deeper) in [(1, -1.0, 0.3), (2, 1.0, 1.0)] {
        let middle = sign * 0.5 * (ROWS_END_M + LOBBY_END_M);
        let half = [0.5 * (LOBBY_END_M - ROWS_END_M) + deeper, proportions.lobby_half_m()];
        cell(builder, cells, (number, Zone::Lobby), ([middle, 0.0], half), |builder, base| {
            builder.begin(own(part), base, Carrier::World);
            let build = if sign < 0.0 { western_lobby } else { eastern_lobby };
            build(builder, proportions, number);
        });
    }
    for who in 0..N_WHO {
        passer(builder, proportions, (own(3), number, who), cells);
    }
}

/// Adds a cell about a middle on a storey: `fill` builds it about its base.
fn cell(
    builder: &mut Builder,
    cells: &mut Vec<BuildingCell>,
    (storey, zone): (usize, Zone),
    (middle, half): ([f64; 2], [f64; 2]),
    fill: impl FnOnce(&mut Builder, [f32; 3]),
) {
    let first = builder.solids.len();
    let floor_m = storey as f64 * STOREY_M;
    fill(builder, [middle[0] as f32, middle[1] as f32, floor_m as f32]);
    let low = [middle[0] - half[0] - 0.1, middle[1] - half[1] - 0.1, floor_m - 0.1];
    let high = [middle[0] + half[0] + 0.1, middle[1] + half[1] + 0.1, floor_m + f64::from(HEIGHT_M) + 0.1];
    cells.push(BuildingCell::new(CellPlace { storey, zone, end: 0 }, first..builder.solids.len(), low, high));
}

/// A room with a door at either end, the same for each of its kind.
fn room(builder: &mut Builder, kind: RoomKind) {
    let (side, inner, tint) = (ROOM_M as f32, 0.5 * ROOM_M as f32 - 0.07, kind.tint());
    rooms::floor(builder.at(0.0, 0.0, 0.0), [side; 2], [0.85; 3]);
    rooms::wall(builder.at(0.0, inner, 0.0), side, tint);
    rooms::wall(builder.at(0.0, -inner, 180.0), side, tint);
    rooms::wall_with_opening(builder.at(-inner, 0.0, 90.0), side, DOOR_M, tint);
    rooms::wall_with_opening(builder.at(inner, 0.0, -90.0), side, DOOR_M, tint);
    rooms::open_door(builder, DOOR_M);
    kind.furnish(builder);
}

/// Bare walls: depth does not see motion along them.
fn corridor(builder: &mut Builder, proportions: &Proportions, number: usize) {
    let length = 2.0 * ROWS_END_M as f32;
    let half = proportions.corridor_half_m as f32;
    let inner = half - 0.07;
    let tint = [[0.75, 0.78, 0.72], [0.78, 0.73, 0.70], [0.70, 0.74, 0.80]][number];
    rooms::floor(builder.at(0.0, 0.0, 0.0), [length, 2.0 * half], [0.8; 3]);
    rooms::wall(builder.at(0.0, inner, 0.0), length, tint);
    rooms::wall(builder.at(0.0, -inner, 180.0), length, tint);
}

/// Floor, ceiling and both ends of a lobby; its long walls are those of the rooms and of what is beyond.
fn lobby_shell(builder: &mut Builder, proportions: &Proportions, tint: [f32; 3]) {
    let (width, length) = ((LOBBY_END_M - ROWS_END_M) as f32, 2.0 * proportions.lobby_half_m() as f32);
    rooms::floor(builder.at(0.0, 0.0, 0.0), [width, length], [0.82; 3]);
    rooms::wall(builder.at(0.0, 0.5 * length, 0.0), width, tint);
    rooms::wall(builder.at(0.0, -0.5 * length, 180.0), width, tint);
}

fn western_lobby(builder: &mut Builder, proportions: &Proportions, number: usize) {
    let (half, length) = (0.5 * (LOBBY_END_M - ROWS_END_M) as f32, 2.0 * proportions.lobby_half_m() as f32);
    let tint = [[0.8, 0.78, 0.7], [0.72, 0.78, 0.78], [0.78, 0.72, 0.70]][number];
    lobby_shell(builder, proportions, tint);
    rooms::wall_with_opening(builder.at(-half, 0.0, 90.0), length, LIFT_M, tint);
    lobby(builder, 0.5 * length, number);
    builder.at(-half + 0.28, 2.6 + 0.3 * number as f32, 90.0).cupboard(0.8, 0.5 + 0.2 * number as f32);
    builder.at(-half + 0.17, -2.8, 90.0).shelf(0.9, 2 + number as u32);
    builder.at(-half, 1.4, 90.0).picture(1.3, 0.6, 0.4 + 0.1 * number as f32);
}

fn eastern_lobby(builder: &mut Builder, proportions: &Proportions, number: usize) {
    let (half, length) = (0.5 * (LOBBY_END_M - ROWS_END_M) as f32, 2.0 * proportions.lobby_half_m() as f32);
    let tint = [[0.72, 0.75, 0.82], [0.82, 0.78, 0.68], [0.70, 0.80, 0.74]][number];
    lobby_shell(builder, proportions, tint);
    rooms::wall_with_opening(builder.at(half, 0.0, -90.0), length, GLASS_M, tint);
    rooms::pane(builder, [0.0, 0.03, 1.05], [GLASS_M, 0.012, 2.1]);
    // Behind the glass: a recess with a patterned wall.
    let far = Material::patterned([0.7, 0.75, 0.65], TexturePattern::Patches(0.2), 0.5);
    builder.add(Shape::Box, [0.0, 0.85, 1.3], [GLASS_M + 0.2, 0.05, 2.6], far);
    for sign in [-0.5, 0.5] {
        builder.add(Shape::Box, [sign * (GLASS_M + 0.1), 0.45, 1.3], [0.05, 0.8, 2.6], far);
    }
    for z in [-0.05, HEIGHT_M + 0.05] {
        builder.add(Shape::Box, [0.0, 0.5, z], [GLASS_M + 0.2, 0.9, 0.1], far);
    }
    lobby(builder, 0.5 * length, number + N_STOREYS);
    builder.at(half - 0.17, -3.0 - 0.2 * number as f32, -90.0).shelf(0.9, 4);
    builder.at(half - 0.28, 4.5, -90.0).cupboard(0.9, 0.6 + 0.2 * number as f32);
}

/// A person of a storey, in a cell as long as the way from turn to turn.
fn passer(
    builder: &mut Builder,
    proportions: &Proportions,
    (key, storey, who): (u64, usize, usize),
    cells: &mut Vec<BuildingCell>,
) {
    let first = builder.solids.len();
    let number = storey * N_WHO + who;
    builder.solids.extend(person::solids(key.wrapping_add(who as u64), Carrier::Passer(number)));
    let (from, to, _) = passers(proportions)[who];
    let floor_m = storey as f64 * STOREY_M;
    let low = [from[0].min(to[0]) - 0.5, from[1].min(to[1]) - 0.5, floor_m];
    let high = [from[0].max(to[0]) + 0.5, from[1].max(to[1]) + 0.5, floor_m + 2.0];
    let place = CellPlace::of(proportions, &[from[0] as f32, from[1] as f32, floor_m as f32]);
    cells.push(BuildingCell::new(place, first..builder.solids.len(), low, high));
}

/// Where the feet of a person are at a time, by number over all storeys.
pub(super) fn passer_at(proportions: &Proportions, number: usize, time_s: f64) -> [f32; 3] {
    let (storey, who) = (number / N_WHO, number % N_WHO);
    let (from, to, there_s) = passers(proportions)[who];
    let share = 0.5 - 0.5 * libm::cos(0.5 * TAU * time_s / there_s + number as f64);
    [
        (from[0] + share * (to[0] - from[0])) as f32,
        (from[1] + share * (to[1] - from[1])) as f32,
        (storey as f64 * STOREY_M + 0.02 * libm::sin(9.0 * time_s).abs()) as f32,
    ]
}
