//! Furniture: a few solids each, placed by position on the floor and a turn.

use crate::material::{Material, TexturePattern};
use crate::solid::{Carrier, Shape, Solid};

const OAK: [f32; 3] = [0.72, 0.52, 0.33];
const PINE: [f32; 3] = [0.85, 0.70, 0.48];
const WHITE: [f32; 3] = [0.85, 0.85, 0.82];
const STEEL: [f32; 3] = [0.45, 0.47, 0.50];

/// A growing list of solids with a place where the next piece goes.
pub(super) struct Builder {
    pub(super) solids: Vec<Solid>,
    /// What moves the solids that follow.
    pub(super) carrier: Carrier,
    seed: u64,
    /// Number of the first solid that takes its looks from `seed`.
    first: usize,
    /// Where the coordinates of places begin, world, metres.
    base: [f32; 3],
    origin: [f32; 3],
    turn: [f32; 2],
}

impl Builder {
    pub(super) fn new(seed: u64) -> Self {
        Self {
            solids: Vec::new(),
            carrier: Carrier::World,
            seed,
            first: 0,
            base: [0.0; 3],
            origin: [0.0; 3],
            turn: [1.0, 0.0],
        }
    }

    /// Begins a part with a place and a seed of its own: parts that are built alike from the same seed
    /// look the same.
    pub(super) fn begin(&mut self, seed: u64, base: [f32; 3], carrier: Carrier) {
        let solids = std::mem::take(&mut self.solids);
        let first = solids.len();
        *self = Self { solids, carrier, first, base, origin: base, ..Self::new(seed) };
    }

    /// Puts what follows at `x`, `y` on the floor, turned by degrees about the vertical.
    /// A piece's front looks along its own -y.
    pub(super) fn at(&mut self, x: f32, y: f32, turn_deg: f64) -> &mut Self {
        let turn = turn_deg.to_radians();
        self.origin = [self.base[0] + x, self.base[1] + y, self.base[2]];
        self.turn = [libm::cos(turn) as f32, libm::sin(turn) as f32];
        self
    }

    pub(super) fn add(&mut self, shape: Shape, centre: [f32; 3], size: [f32; 3], material: Material) {
        let [c, s] = self.turn;
        let centre = [
            self.origin[0] + c * centre[0] - s * centre[1],
            self.origin[1] + s * centre[0] + c * centre[1],
            self.origin[2] + centre[2],
        ];
        let key = self.seed.wrapping_mul(1000).wrapping_add((self.solids.len() - self.first) as u64);
        self.solids.push(Solid {
            shape,
            centre,
            half: size.map(|side| 0.5 * side),
            turn: self.turn,
            material: material.keyed(key),
            carrier: self.carrier,
        });
    }

    /// A box that stands on the height `z`.
    fn block(&mut self, x: f32, y: f32, z: f32, size: [f32; 3], material: Material) {
        self.add(Shape::Box, [x, y, z + 0.5 * size[2]], size, material);
    }

    fn column(&mut self, x: f32, y: f32, z: f32, diameter: f32, height: f32, material: Material) {
        self.add(Shape::Cylinder, [x, y, z + 0.5 * height], [diameter, diameter, height], material);
    }

    fn ball(&mut self, x: f32, y: f32, z: f32, diameter: f32, material: Material) {
        self.add(Shape::Sphere, [x, y, z + 0.5 * diameter], [diameter; 3], material);
    }

    /// A table with things on it.
    pub(super) fn table(&mut self, width: f32, depth: f32) {
        let wood = Material::patterned(OAK, TexturePattern::Stripes(0.09), 0.15);
        self.block(0.0, 0.0, 0.70, [width, depth, 0.04], wood);
        for (sx, sy) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
            let (x, y) = (sx * (0.5 * width - 0.05), sy * (0.5 * depth - 0.05));
            self.block(x, y, 0.0, [0.06, 0.06, 0.70], Material::plain(OAK));
        }
        self.block(
            -0.28 * width,
            0.1 * depth,
            0.74,
            [0.24, 0.17, 0.13],
            Material::patterned([0.8, 0.3, 0.25], TexturePattern::Patches(0.06), 0.6),
        );
        self.block(
            -0.27 * width,
            0.1 * depth,
            0.87,
            [0.16, 0.12, 0.05],
            Material::patterned([0.3, 0.5, 0.8], TexturePattern::Stripes(0.02), 0.5),
        );
        self.column(0.05 * width, -0.15 * depth, 0.74, 0.09, 0.11, Material::plain([0.25, 0.55, 0.7]));
        self.ball(
            0.3 * width,
            0.12 * depth,
            0.74,
            0.2,
            Material::patterned([0.9, 0.6, 0.2], TexturePattern::Checks(0.05), 0.5),
        );
    }

    /// A desk with a screen.
    pub(super) fn desk(&mut self) {
        self.block(
            0.0,
            0.0,
            0.72,
            [1.4, 0.7, 0.03],
            Material::patterned(PINE, TexturePattern::Stripes(0.12), 0.12),
        );
        self.block(
            -0.5,
            0.0,
            0.0,
            [0.38, 0.6, 0.72],
            Material::patterned(PINE, TexturePattern::Joints(0.24), 0.5),
        );
        self.block(0.66, 0.0, 0.0, [0.05, 0.6, 0.72], Material::plain(PINE));
        self.block(
            0.1,
            0.18,
            0.83,
            [0.56, 0.04, 0.34],
            Material::patterned([0.25, 0.3, 0.38], TexturePattern::Patches(0.11), 0.7),
        );
        self.block(0.1, 0.2, 0.75, [0.06, 0.05, 0.14], Material::plain(STEEL));
        self.block(0.1, 0.18, 0.75, [0.24, 0.18, 0.015], Material::plain(STEEL));
        self.block(
            0.08,
            -0.12,
            0.75,
            [0.44, 0.15, 0.025],
            Material::patterned([0.3; 3], TexturePattern::Joints(0.03), 0.6),
        );
        self.column(
            -0.5,
            0.05,
            0.75,
            0.14,
            0.26,
            Material::patterned([0.6, 0.2, 0.3], TexturePattern::Stripes(0.05), 0.4),
        );
    }

    /// A chair.
    pub(super) fn chair(&mut self, base: [f32; 3]) {
        let cloth = Material::patterned(base, TexturePattern::Checks(0.07), 0.3);
        self.block(0.0, 0.0, 0.43, [0.44, 0.44, 0.05], cloth);
        self.block(0.0, 0.2, 0.50, [0.42, 0.04, 0.44], cloth);
        for (x, y) in [(-0.19, -0.19), (0.19, -0.19), (-0.19, 0.19), (0.19, 0.19)] {
            self.block(x, y, 0.0, [0.04, 0.04, 0.43], Material::plain(STEEL));
        }
    }

    /// A shelf with books, open to the front.
    pub(super) fn shelf(&mut self, width: f32, n_boards: u32) {
        let wood = Material::plain(PINE);
        let height = 0.38 * n_boards as f32 + 0.03;
        self.block(0.0, 0.14, 0.0, [width, 0.02, height], wood);
        for side in [-1.0, 1.0] {
            self.block(side * 0.5 * width, 0.0, 0.0, [0.03, 0.3, height], wood);
        }
        for board in 0..=n_boards {
            let z = 0.38 * board as f32;
            self.block(0.0, 0.0, z, [width, 0.3, 0.025], wood);
            if board < n_boards {
                let odd = board % 2 == 1;
                let (x, wide) = if odd { (-0.14 * width, 0.64 * width) } else { (0.1 * width, 0.72 * width) };
                let tall = if odd { 0.24 } else { 0.28 };
                let books = Material::patterned([0.95; 3], TexturePattern::Books(0.035), 0.75);
                self.block(x, 0.02, z + 0.025, [wide, 0.2, tall], books);
            }
        }
    }

    /// A cupboard with doors.
    pub(super) fn cupboard(&mut self, width: f32, height: f32) {
        self.block(
            0.0,
            0.0,
            0.06,
            [width, 0.5, height],
            Material::patterned(WHITE, TexturePattern::Joints(0.45), 0.4),
        );
        self.block(0.0, 0.0, 0.0, [width - 0.06, 0.44, 0.06], Material::plain(STEEL));
        for x in [-0.06, 0.06] {
            self.block(x, -0.265, 0.55 * height, [0.02, 0.03, 0.16], Material::plain(STEEL));
        }
        self.column(
            0.25 * width,
            0.0,
            height + 0.06,
            0.18,
            0.24,
            Material::patterned([0.3, 0.55, 0.4], TexturePattern::Stripes(0.06), 0.4),
        );
        self.block(
            -0.2 * width,
            0.0,
            height + 0.06,
            [0.34, 0.26, 0.18],
            Material::patterned(OAK, TexturePattern::Patches(0.09), 0.5),
        );
    }

    /// A sofa with cushions.
    pub(super) fn sofa(&mut self, base: [f32; 3]) {
        let cloth = Material::patterned(base, TexturePattern::Stripes(0.11), 0.2);
        self.block(0.0, 0.0, 0.1, [1.7, 0.8, 0.32], cloth);
        self.block(0.0, 0.32, 0.42, [1.7, 0.18, 0.38], cloth);
        for x in [-0.86, 0.86] {
            self.block(x, 0.0, 0.05, [0.16, 0.82, 0.52], cloth);
        }
        self.block(
            -0.45,
            0.15,
            0.42,
            [0.4, 0.14, 0.34],
            Material::patterned([0.9, 0.8, 0.3], TexturePattern::Checks(0.08), 0.5),
        );
        self.ball(
            0.4,
            0.05,
            0.40,
            0.3,
            Material::patterned([0.8, 0.35, 0.3], TexturePattern::Patches(0.08), 0.5),
        );
    }

    /// A lamp on a stand.
    pub(super) fn lamp(&mut self) {
        self.column(0.0, 0.0, 0.0, 0.3, 0.03, Material::plain(STEEL));
        self.column(0.0, 0.0, 0.03, 0.035, 1.35, Material::plain(STEEL));
        self.column(
            0.0,
            0.0,
            1.38,
            0.36,
            0.28,
            Material::patterned([0.95, 0.88, 0.7], TexturePattern::Stripes(0.07), 0.25),
        );
    }

    /// A plant in a pot.
    pub(super) fn plant(&mut self) {
        self.column(
            0.0,
            0.0,
            0.0,
            0.32,
            0.3,
            Material::patterned([0.7, 0.4, 0.3], TexturePattern::Stripes(0.06), 0.3),
        );
        self.column(0.0, 0.0, 0.3, 0.05, 0.5, Material::plain(OAK));
        let leaf = Material::patterned([0.3, 0.6, 0.25], TexturePattern::Patches(0.04), 0.5);
        for (x, y, z, d) in [
            (0.0, 0.0, 0.7, 0.4),
            (0.16, 0.1, 0.95, 0.3),
            (-0.15, -0.06, 0.92, 0.28),
            (0.02, 0.05, 1.15, 0.26),
        ] {
            self.ball(x, y, z, d, leaf);
        }
    }

    /// A bin and a pile of boxes.
    pub(super) fn boxes(&mut self) {
        let card = |size| Material::patterned([0.75, 0.6, 0.42], TexturePattern::Joints(size), 0.35);
        self.block(0.0, 0.0, 0.0, [0.55, 0.4, 0.38], card(0.2));
        self.at_offset(0.0, 0.0, 14.0).block(0.02, 0.0, 0.38, [0.42, 0.34, 0.3], card(0.15));
        self.block(
            0.05,
            0.02,
            0.68,
            [0.24, 0.24, 0.22],
            Material::patterned([0.4, 0.6, 0.75], TexturePattern::Checks(0.06), 0.4),
        );
        self.column(
            0.5,
            -0.05,
            0.0,
            0.28,
            0.42,
            Material::patterned([0.35, 0.4, 0.45], TexturePattern::Stripes(0.07), 0.3),
        );
    }

    /// A picture that hangs at the piece's back.
    pub(super) fn picture(&mut self, z: f32, width: f32, height: f32) {
        self.block(0.0, 0.0, z, [width, 0.05, height], Material::plain(OAK));
        let canvas = Material::patterned([0.95; 3], TexturePattern::Patches(0.5 * height / 3.0), 0.7);
        self.block(0.0, -0.01, z + 0.04, [width - 0.08, 0.05, height - 0.08], canvas);
    }

    /// Turns what follows a little more.
    fn at_offset(&mut self, x: f32, y: f32, turn_deg: f64) -> &mut Self {
        let turn = turn_deg.to_radians();
        let (tc, ts) = (libm::cos(turn) as f32, libm::sin(turn) as f32);
        let [c, s] = self.turn;
        self.origin = [self.origin[0] + c * x - s * y, self.origin[1] + s * x + c * y, self.origin[2]];
        self.turn = [c * tc - s * ts, s * tc + c * ts];
        self
    }
}
