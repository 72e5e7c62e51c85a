//! The scenes, solid by solid. World axes: z up, the floor at z = 0.

use crate::building::{self, BuildingCell, CellBounds, Proportions};
use crate::furniture::Builder;
use crate::material::{Grain, Material, TexturePattern};
use crate::path::HOUSE_HALF;
use crate::solid::{Carrier, Shape, Solid};
use crate::{SceneName, person, random};

/// Everything that can be seen.
#[derive(Clone, Debug)]
pub(super) struct Scene {
    pub(super) solids: Vec<Solid>,
    pub(super) grain: Grain,
    /// Whether a person walks about.
    pub(super) has_person: bool,
    /// What may be seen from where; none: all of it from everywhere.
    cells: Vec<BuildingCell>,
    proportions: Proportions,
}

impl Scene {
    pub(super) fn new(name: SceneName, seed: u64, has_person: bool, proportions: Proportions) -> Self {
        let key = random::word(seed, 0x5ce2e);
        let mut builder = Builder::new(key);
        let mut cells = Vec::new();
        match name {
            SceneName::Room => room(&mut builder),
            SceneName::Corridor => corridor(&mut builder),
            SceneName::Wall => wall(&mut builder),
            SceneName::House => house(&mut builder),
            SceneName::Building => cells = building::build(&mut builder, key, &proportions),
        }
        let mut solids = builder.solids;
        if has_person {
            let first = solids.len();
            solids.extend(person::solids(key, Carrier::Companion));
            if !cells.is_empty() {
                cells.push(BuildingCell::everywhere(first..solids.len()));
            }
        }
        Self { solids, grain: Grain::new(key), has_person, cells, proportions }
    }

    /// Lets all of it be seen from everywhere.
    #[cfg(test)]
    pub(super) fn forget_cells(&mut self) {
        self.cells.clear();
    }

    /// Numbers of the solids that may be seen from a place, in order; `is_in_view` tells what is in the image.
    pub(super) fn fill_visible(
        &self,
        place: &[f32; 3],
        is_in_view: impl Fn(&CellBounds) -> bool,
        visible: &mut Vec<u32>,
    ) {
        visible.clear();
        if self.cells.is_empty() {
            visible.extend(0..self.solids.len() as u32);
        }
        visible.extend(building::visible((&self.cells, &self.proportions), place, is_in_view).flatten());
    }
}

fn wallpaper(base: [f32; 3]) -> Material {
    Material::patterned(base, TexturePattern::Joints(0.4), 0.12)
}

/// A closed space: four walls, floor and ceiling, with boards on the floor.
fn space(builder: &mut Builder, centre: [f32; 2], size: [f32; 3], base: [f32; 3]) {
    builder.at(centre[0], centre[1], 0.0);
    builder.add(Shape::Shell, [0.0, 0.0, 0.5 * size[2]], size, wallpaper(base));
    let boards = Material::patterned([0.6, 0.45, 0.32], TexturePattern::Joints(0.16), 0.35);
    builder.add(Shape::Box, [0.0, 0.0, -0.05], [size[0], size[1], 0.102], boards);
}

fn room(builder: &mut Builder) {
    space(builder, [0.0, 0.0], [5.4, 4.8, 2.6], [0.82, 0.80, 0.74]);
    // Along the wall at +x, where the way begins, then counter-clockwise.
    builder.at(2.35, 0.2, -90.0).desk();
    builder.at(1.72, 0.25, 80.0).chair([0.35, 0.4, 0.6]);
    builder.at(2.5, 1.5, -90.0).shelf(0.9, 5);
    builder.at(2.1, 2.0, 0.0).plant();
    builder.at(1.1, 2.12, 0.0).cupboard(0.9, 0.95);
    builder.at(-0.25, 1.65, 8.0).table(1.1, 0.75);
    builder.at(-0.35, 1.05, 190.0).chair([0.6, 0.4, 0.3]);
    builder.at(-1.4, 2.2, 0.0).shelf(1.0, 4);
    builder.at(-2.25, 1.7, 40.0).boxes();
    builder.at(-2.25, 0.2, 90.0).sofa([0.45, 0.5, 0.42]);
    builder.at(-2.3, -1.35, 0.0).lamp();
    builder.at(-1.75, -2.0, 205.0).boxes();
    builder.at(-0.6, -2.1, 180.0).cupboard(1.0, 1.5);
    builder.at(0.5, -1.75, 170.0).table(0.9, 0.7);
    builder.at(1.25, -1.5, 250.0).chair([0.3, 0.5, 0.4]);
    builder.at(2.0, -2.2, 180.0).shelf(0.8, 3);
    builder.at(2.4, -1.3, -70.0).boxes();
    builder.at(2.68, 0.2, -90.0).picture(1.45, 0.9, 0.6);
    builder.at(-0.3, 2.38, 0.0).picture(1.3, 0.8, 0.8);
    builder.at(-2.68, 0.2, 90.0).picture(1.25, 1.2, 0.7);
    builder.at(0.6, -2.38, 180.0).picture(1.2, 0.7, 0.9);
    builder.at(-2.68, -1.7, 90.0).picture(1.4, 0.5, 0.6);
}

fn corridor(builder: &mut Builder) {
    space(builder, [0.0, 0.0], [60.0, 1.9, 2.5], [0.75, 0.78, 0.72]);
}

fn wall(builder: &mut Builder) {
    space(builder, [-18.4, 0.0], [40.0, 60.0, 60.0], [0.78, 0.74, 0.70]);
    // Far above the floor: nothing but the wall at x = 1.6 is near enough to be measured.
    for solid in &mut builder.solids {
        solid.centre[2] -= 30.0;
    }
}

/// Inside of the house: six rooms of 5 m x 4.5 m, two by three, doors on the way.
fn house(builder: &mut Builder) {
    let [half_x, half_y] = HOUSE_HALF.map(|side| side as f32);
    let (wide, long, high) = (4.0 * half_x, 3.0 * half_y, 2.6);
    space(builder, [0.0, 0.0], [wide, long, high], [0.80, 0.78, 0.73]);
    let tints = [[0.72, 0.76, 0.80], [0.80, 0.74, 0.66], [0.70, 0.78, 0.70], [0.78, 0.70, 0.74]];
    // Walls across, with a door where the way passes at x = +-half_x.
    for (row, y) in [-0.5 * half_y, 0.5 * half_y].into_iter().enumerate() {
        for (column, x) in [-half_x, half_x].into_iter().enumerate() {
            let tint = tints[(2 * row + column) % 4];
            builder.at(x, y, 0.0);
            wall_with_door(builder, 2.0 * half_x, high, tint);
        }
    }
    // The wall along the middle: a door at either end, none between the middle rooms.
    for (at, y) in [-half_y, half_y].into_iter().enumerate() {
        builder.at(0.0, y, 90.0);
        wall_with_door(builder, half_y, high, tints[at + 1]);
    }
    builder.at(0.0, 0.0, 90.0);
    builder.add(Shape::Box, [0.0, 0.0, 0.5 * high], [half_y, 0.14, high], wallpaper(tints[3]));
    for (row, y) in [-half_y, 0.0, half_y].into_iter().enumerate() {
        for (column, x) in [-half_x, half_x].into_iter().enumerate() {
            furnish(builder, x, y, 3 * column + row);
        }
    }
}

/// A wall along x with a doorway of 1 m x 2.1 m in its middle.
fn wall_with_door(builder: &mut Builder, length: f32, height: f32, tint: [f32; 3]) {
    let side = 0.5 * (length - 1.0);
    for sign in [-1.0, 1.0] {
        let x = sign * (0.5 + 0.5 * side);
        builder.add(Shape::Box, [x, 0.0, 0.5 * height], [side, 0.14, height], wallpaper(tint));
        let frame = Material::plain([0.6, 0.5, 0.4]);
        builder.add(Shape::Box, [sign * 0.52, 0.0, 1.05], [0.06, 0.2, 2.1], frame);
    }
    builder.add(Shape::Box, [0.0, 0.0, 0.5 * (height + 2.1)], [1.0, 0.14, height - 2.1], wallpaper(tint));
    // Something to hold on to on the way to a door, on both faces: a bare wall leaves a pose free.
    for face in [-1.0, 1.0] {
        let (x, y) = (face * (0.95 + 0.12 * length), face * 0.22);
        let chest = Material::patterned([0.7, 0.62, 0.5], TexturePattern::Joints(0.26), 0.5);
        builder.add(Shape::Box, [x, y, 0.4], [0.6, 0.3, 0.8], chest);
        let vase = Material::patterned([0.35, 0.5, 0.7], TexturePattern::Stripes(0.05), 0.5);
        builder.add(Shape::Cylinder, [x + 0.1, y, 0.95], [0.15, 0.15, 0.3], vase);
        let frame = Material::patterned([0.9, 0.85, 0.8], TexturePattern::Patches(0.1), 0.7);
        builder.add(Shape::Box, [-x, face * 0.09, 1.4], [0.5, 0.08, 0.4], frame);
        let heater = Material::patterned([0.85; 3], TexturePattern::Books(0.06), 0.3);
        builder.add(Shape::Box, [-x, face * 0.13, 0.4], [0.7, 0.12, 0.5], heater);
    }
}

/// Furniture of one room about its middle, another choice for each room. The way and the doors
/// stay free: 0.6 m on either side of x = 0, and of y = 0 on the side of the middle wall.
fn furnish(builder: &mut Builder, x: f32, y: f32, which: usize) {
    // Away from the middle wall.
    let out = if x > 0.0 { 1.0 } else { -1.0 };
    let toward_wall = if x > 0.0 { -90.0 } else { 90.0 };
    let is_middle = which % 3 == 1;
    match which % 3 {
        0 => {
            builder.at(x + out * 2.1, y + 0.4, toward_wall).desk();
            builder.at(x + out * 1.4, y + 0.5, -toward_wall + 10.0).chair([0.4, 0.35, 0.55]);
            builder.at(x + out * 1.6, y - 1.7, 170.0).boxes();
        }
        1 => {
            builder.at(x + out * 2.0, y - 0.2, toward_wall).sofa([0.5, 0.42, 0.4]);
            builder.at(x + out * 1.9, y + 1.6, 0.0).lamp();
            builder.at(x + out * 1.5, y - 1.8, 200.0).cupboard(0.8, 0.8);
        }
        _ => {
            builder.at(x + out * 1.6, y - 0.3, 100.0).table(1.1, 0.8);
            builder.at(x + out * 1.0, y - 0.9, 160.0).chair([0.3, 0.5, 0.45]);
            builder.at(x + out * 2.3, y + 1.2, toward_wall).shelf(0.9, 5);
        }
    }
    let end = if y > 0.0 { 1.0 } else { -1.0 };
    if is_middle {
        builder.at(x - out * 2.2, y + 0.9, -toward_wall).shelf(1.0, 4);
        builder.at(x - out * 2.15, y - 0.7, -toward_wall).cupboard(0.9, 1.1);
        builder.at(x - out * 1.5, y + 1.75, 20.0).plant();
    } else {
        let back = if y > 0.0 { 0.0 } else { 180.0 };
        builder.at(x - out * 0.2, y + end * 1.95, back).cupboard(1.1, 1.0);
        builder.at(x + out * 1.1, y + end * 2.05, back).shelf(0.8, 4);
        builder.at(x - out * 1.6, y + end * 1.9, 10.0).plant();
        builder.at(x - out * 1.7, y - end * 1.7, 30.0 + 40.0 * which as f64).boxes();
        builder.at(x - out * 0.2, y + end * 2.23, back).picture(1.4, 0.9, 0.6);
    }
    builder.at(x + out * 2.48, y + 0.3, toward_wall).picture(1.35, 1.0, 0.7);
}
