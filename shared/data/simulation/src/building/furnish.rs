//! Furniture of the building's rooms, by their kind. The way and the doors stay free: 1.6 m about the middle
//! of a room but for the table, and 0.6 m on either side of y = 0.

use super::rooms;
use crate::furniture::Builder;
use crate::material::{Material, TexturePattern};
use crate::solid::Shape;

/// What a room is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RoomKind {
    /// An office, always the same.
    Office,
    /// A lounge, always the same.
    Lounge,
    /// A workshop, another one for each number.
    Workshop(usize),
}

impl RoomKind {
    /// Rooms of one number are the same to the camera.
    pub(super) fn number(self) -> u64 {
        match self {
            Self::Office => 0,
            Self::Lounge => 1,
            Self::Workshop(which) => 2 + which as u64,
        }
    }

    /// Colour of the walls.
    pub(super) fn tint(self) -> [f32; 3] {
        match self {
            Self::Office => [0.76, 0.78, 0.82],
            Self::Lounge => [0.82, 0.76, 0.66],
            Self::Workshop(which) => [[0.70, 0.78, 0.70], [0.80, 0.72, 0.74], [0.72, 0.72, 0.80]][which % 3],
        }
    }

    /// Puts the furniture about the builder's base.
    pub(super) fn furnish(self, builder: &mut Builder) {
        match self {
            Self::Office => office(builder),
            Self::Lounge => lounge(builder),
            Self::Workshop(which) => workshop(builder, which),
        }
    }
}

fn office(builder: &mut Builder) {
    builder.at(0.0, 0.0, 0.0).table(1.0, 0.7);
    builder.at(-1.3, 2.05, 0.0).desk();
    builder.at(-1.2, 1.6, 170.0).chair([0.35, 0.4, 0.6]);
    builder.at(1.75, 2.25, 0.0).shelf(1.0, 5);
    builder.at(2.15, -2.1, 0.0).plant();
    rooms::window(builder.at(0.3, 2.43, 0.0), 1.2);
    builder.at(-1.3, -2.15, 180.0).cupboard(1.1, 1.0);
    builder.at(0.2, -2.25, 180.0).shelf(0.8, 4);
    builder.at(1.2, -2.1, 190.0).boxes();
    builder.at(-2.43, 1.4, 90.0).picture(1.2, 0.8, 0.6);
    builder.at(-2.3, -1.5, 90.0).shelf(0.8, 3);
    builder.at(2.43, -1.5, -90.0).picture(1.3, 0.9, 0.7);
}

fn lounge(builder: &mut Builder) {
    builder.at(0.0, 0.0, 90.0).table(0.8, 0.8);
    builder.at(0.9, 2.0, 0.0).sofa([0.45, 0.5, 0.42]);
    builder.at(-0.4, 2.15, 0.0).lamp();
    builder.at(-1.6, 2.15, 0.0).cupboard(1.0, 1.4);
    rooms::window(builder.at(0.9, 2.43, 0.0), 1.6);
    builder.at(-1.4, -2.25, 180.0).shelf(1.0, 4);
    builder.at(-0.1, -2.15, 180.0).cupboard(0.9, 0.7);
    builder.at(1.1, -2.05, 175.0).boxes();
    builder.at(2.1, -2.0, 20.0).plant();
    builder.at(-2.43, -1.5, 90.0).picture(1.25, 1.0, 0.7);
    builder.at(-2.43, 1.2, 90.0).picture(1.4, 0.5, 0.7);
    builder.at(2.3, -1.3, -90.0).shelf(0.7, 2);
    // A sheet of glass that stands between the sofa and the wall, seen through from the table.
    builder.at(2.1, 1.25, 90.0);
    rooms::pane(builder, [0.0, 0.0, 1.0], [1.0, 0.012, 2.0]);
    let foot = Material::plain([0.45, 0.47, 0.50]);
    builder.add(Shape::Box, [0.0, 0.0, 0.02], [1.04, 0.08, 0.04], foot);
}

fn workshop(builder: &mut Builder, which: usize) {
    let more = which as f32;
    let sign = if which.is_multiple_of(2) { 1.0 } else { -1.0 };
    builder.at(0.0, 0.0, 30.0 * f64::from(more)).table(0.9, 0.6);
    builder.at(sign * (0.5 + 0.2 * more), 2.1, 0.0).table(1.2 + 0.1 * more, 0.6);
    builder.at(-sign * 1.5, 2.2, 0.0).shelf(0.7 + 0.1 * more, 3 + which as u32 % 3);
    builder.at(sign * 2.05, 2.1, 40.0 * f64::from(more)).boxes();
    builder.at(-sign * (0.6 + 0.1 * more), -2.15, 180.0).cupboard(0.8 + 0.1 * more, 0.8 + 0.15 * more);
    builder.at(sign * 1.4, -2.25, 180.0).shelf(0.9, 2 + which as u32 % 3);
    builder.at(sign * 0.4, -2.1, 180.0 + 25.0 * f64::from(more)).plant();
    builder.at(-sign * 2.0, -2.05, 30.0 * f64::from(more)).boxes();
    builder.at(2.43, 1.5, -90.0).picture(1.2, 0.6 + 0.1 * more, 0.6);
    builder.at(-2.3, -1.2 - 0.05 * more, 90.0).shelf(0.6 + 0.05 * more, 3);
    builder.at(2.43, -1.4, -90.0).picture(1.1, 1.1 - 0.1 * more, 0.8);
    builder.at(-2.43, 1.3, 90.0).picture(1.35, 0.9, 0.5 + 0.05 * more);
}

/// A lobby about its middle, looking along +y from its southern end; another one for each number.
pub(super) fn lobby(builder: &mut Builder, half_m: f32, which: usize) {
    // How much farther its ends are than those of the building's own lobbies.
    let more_m = half_m - 6.0;
    let more = which as f32;
    let tint = [[0.35, 0.45, 0.6], [0.6, 0.4, 0.35], [0.4, 0.55, 0.4]][which % 3];
    builder.at(-0.1, 5.5 + more_m, 0.0).sofa(tint);
    builder.at(0.85, 4.9 + more_m, 10.0 * f64::from(more)).plant();
    builder.at(-0.2, -5.65 - more_m, 180.0).cupboard(0.9 + 0.1 * more, 0.7 + 0.15 * more);
    builder.at(0.7, -5.6 - more_m, 200.0 + 12.0 * f64::from(more)).boxes();
    builder.at(0.0, 6.0 + more_m, 0.0).picture(1.4, 1.2, 0.6 + 0.05 * more);
    builder.at(0.1 * more, -6.0 - more_m, 180.0).picture(1.6, 0.9, 0.5);
    let signs = Material::patterned([0.9, 0.85, 0.7], TexturePattern::Patches(0.08), 0.7);
    builder.at(0.0, 0.0, 0.0);
    for y in [-1.9 - 0.1 * more, 1.9 + 0.1 * more] {
        builder.add(Shape::Box, [1.17, y, 1.4], [0.05, 0.5, 0.5 + 0.1 * more], signs);
    }
}
