//! Walls, floors and doors of the building.

use super::HEIGHT_M;
use crate::furniture::Builder;
use crate::material::{Material, TexturePattern};
use crate::solid::Shape;

/// Thickness of a wall, metres; two rooms side by side have one each.
const WALL_M: f32 = 0.07;
const DOOR_HEIGHT_M: f32 = 2.1;

pub(super) fn wallpaper(base: [f32; 3]) -> Material {
    Material::patterned(base, TexturePattern::Joints(0.4), 0.12)
}

/// Floor and ceiling of a space about the builder's place.
pub(super) fn floor(builder: &mut Builder, size: [f32; 2], base: [f32; 3]) {
    let boards = Material::patterned([0.6, 0.45, 0.32], TexturePattern::Joints(0.16), 0.35);
    builder.add(Shape::Box, [0.0, 0.0, -0.05], [size[0], size[1], 0.1], boards);
    builder.add(Shape::Box, [0.0, 0.0, HEIGHT_M + 0.05], [size[0], size[1], 0.1], Material::plain(base));
}

/// A wall along x whose inner face, which looks to -y, lies at y = 0.
pub(super) fn wall(builder: &mut Builder, length: f32, base: [f32; 3]) {
    let middle = [0.0, 0.5 * WALL_M, 0.5 * HEIGHT_M];
    builder.add(Shape::Box, middle, [length, WALL_M, HEIGHT_M], wallpaper(base));
}

/// The same with an opening of this width in its middle.
pub(super) fn wall_with_opening(builder: &mut Builder, length: f32, opening: f32, base: [f32; 3]) {
    let side = 0.5 * (length - opening);
    for sign in [-1.0, 1.0] {
        let middle = [sign * 0.5 * (opening + side), 0.5 * WALL_M, 0.5 * HEIGHT_M];
        builder.add(Shape::Box, middle, [side, WALL_M, HEIGHT_M], wallpaper(base));
        let frame = Material::plain([0.6, 0.5, 0.4]);
        let middle = [sign * 0.5 * opening, 0.5 * WALL_M - 0.005, 0.5 * DOOR_HEIGHT_M];
        builder.add(Shape::Box, middle, [0.05, WALL_M + 0.01, DOOR_HEIGHT_M], frame);
    }
    let lintel = HEIGHT_M - DOOR_HEIGHT_M;
    let middle = [0.0, 0.5 * WALL_M, DOOR_HEIGHT_M + 0.5 * lintel];
    builder.add(Shape::Box, middle, [opening, WALL_M, lintel], wallpaper(base));
}

/// A door's leaf that stands open into the room, at the left end of an opening.
pub(super) fn open_door(builder: &mut Builder, opening: f32) {
    let leaf = Material::patterned([0.8, 0.76, 0.68], TexturePattern::Joints(0.5), 0.3);
    let middle = [-0.5 * opening - 0.05, -0.45, 0.5 * DOOR_HEIGHT_M];
    builder.add(Shape::Box, middle, [0.04, 0.88, DOOR_HEIGHT_M], leaf);
}

/// A window in the wall at the builder's back: a pane before a bright panel.
pub(super) fn window(builder: &mut Builder, width: f32) {
    let sky = Material::patterned([0.75, 0.85, 0.97], TexturePattern::Stripes(0.5), 0.1);
    builder.add(Shape::Box, [0.0, -0.01, 1.55], [width, 0.02, 1.0], sky);
    let frame = Material::plain([0.9, 0.9, 0.88]);
    for side in [-0.5, 0.0, 0.5] {
        builder.add(Shape::Box, [side * width, -0.03, 1.55], [0.06, 0.07, 1.06], frame);
    }
    pane(builder, [0.0, -0.035, 1.55], [width, 0.01, 1.0]);
}

/// A sheet of glass.
pub(super) fn pane(builder: &mut Builder, middle: [f32; 3], size: [f32; 3]) {
    builder.add(Shape::Box, middle, size, Material::glass([0.62, 0.72, 0.70]));
}
