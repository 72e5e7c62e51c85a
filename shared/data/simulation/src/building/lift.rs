//! The lift: a closed cabin that carries the camera, and what is in it.

use super::{CABIN_HALF_M, CABIN_M, LOBBY_END_M};
use crate::furniture::Builder;
use crate::material::{Material, TexturePattern};
use crate::solid::{Carrier, Shape};

/// Width of the door, metres.
pub(super) const DOOR_M: f32 = 1.0;
const HEIGHT_M: f32 = 2.3;
const DOOR_HEIGHT_M: f32 = 2.1;
const WALL_M: f32 = 0.06;

/// The cabin on the ground storey, its door closed; both are carried from there.
pub(super) fn build(builder: &mut Builder, key: u64) {
    builder.begin(key, [CABIN_M as f32, 0.0, 0.0], Carrier::Cabin);
    let half = CABIN_HALF_M as f32;
    let panels = Material::patterned([0.62, 0.64, 0.66], TexturePattern::Joints(0.32), 0.4);
    let side = 2.0 * half;
    builder.at(0.0, 0.0, 0.0);
    builder.add(Shape::Box, [0.0, 0.0, -0.05], [side, side, 0.1], tiles());
    builder.add(Shape::Box, [0.0, 0.0, HEIGHT_M + 0.05], [side, side, 0.1], Material::plain([0.8; 3]));
    let wall = |middle: f32| middle + middle.signum() * 0.5 * WALL_M;
    builder.add(Shape::Box, [wall(-half), 0.0, 0.5 * HEIGHT_M], [WALL_M, side, HEIGHT_M], panels);
    for y in [-half, half] {
        builder.add(Shape::Box, [0.0, wall(y), 0.5 * HEIGHT_M], [side, WALL_M, HEIGHT_M], panels);
    }
    // The front, with an opening in its middle.
    let jamb = half - 0.5 * DOOR_M;
    for sign in [-1.0, 1.0] {
        let y = sign * 0.5 * (half + 0.5 * DOOR_M);
        builder.add(Shape::Box, [wall(half), y, 0.5 * HEIGHT_M], [WALL_M, jamb, HEIGHT_M], panels);
    }
    let lintel = HEIGHT_M - DOOR_HEIGHT_M;
    let z = DOOR_HEIGHT_M + 0.5 * lintel;
    builder.add(Shape::Box, [wall(half), 0.0, z], [WALL_M, DOOR_M, lintel], panels);
    fittings(builder, half);
    sill(builder, half);
    leaf(builder, half);
}

/// What the camera holds on to: rails, the panel with its buttons, notices.
fn fittings(builder: &mut Builder, half: f32) {
    let steel = Material::plain([0.5, 0.5, 0.48]);
    builder.add(Shape::Box, [-half + 0.05, 0.0, 0.95], [0.06, 1.5, 0.06], steel);
    for y in [-half + 0.05, half - 0.05] {
        builder.add(Shape::Box, [-0.1, y, 0.95], [1.3, 0.06, 0.06], steel);
    }
    let buttons = Material::patterned([0.9, 0.88, 0.8], TexturePattern::Patches(0.05), 0.7);
    builder.add(Shape::Box, [half - 0.02, 0.72, 1.2], [0.05, 0.24, 0.6], buttons);
    let notice = Material::patterned([0.95; 3], TexturePattern::Patches(0.07), 0.7);
    builder.add(Shape::Box, [0.2, half - 0.02, 1.5], [0.5, 0.04, 0.35], notice);
    builder.add(Shape::Box, [-0.25, -half + 0.02, 1.45], [0.4, 0.04, 0.5], notice);
    builder.add(Shape::Box, [-half + 0.02, -0.3, 1.5], [0.04, 0.45, 0.6], notice);
    builder.add(Shape::Box, [half - 0.02, -0.72, 1.5], [0.04, 0.3, 0.4], notice);
}

/// Closes the gap between the cabin and the lobby.
fn sill(builder: &mut Builder, half: f32) {
    let gap = (-CABIN_M - LOBBY_END_M) as f32 - half;
    let steel = Material::patterned([0.45, 0.46, 0.48], TexturePattern::Stripes(0.05), 0.3);
    builder.add(Shape::Box, [half + 0.5 * gap, 0.0, -0.05], [gap, DOOR_M + 0.2, 0.1], steel);
}

fn leaf(builder: &mut Builder, half: f32) {
    builder.carrier = Carrier::Leaf;
    let painted = Material::patterned([0.55, 0.35, 0.3], TexturePattern::Joints(0.25), 0.45);
    builder.add(
        Shape::Box,
        [half + WALL_M + 0.03, 0.0, 0.5 * DOOR_HEIGHT_M + 0.03],
        [0.04, DOOR_M + 0.08, DOOR_HEIGHT_M + 0.06],
        painted,
    );
    let notice = Material::patterned([0.95, 0.9, 0.8], TexturePattern::Patches(0.06), 0.7);
    builder.add(Shape::Box, [half + WALL_M, 0.1, 1.45], [0.05, 0.36, 0.5], notice);
    builder.carrier = Carrier::World;
}

fn tiles() -> Material {
    Material::patterned([0.5, 0.48, 0.45], TexturePattern::Checks(0.15), 0.25)
}
