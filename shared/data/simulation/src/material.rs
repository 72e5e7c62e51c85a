//! Appearance of surfaces: a colour, a pattern, and a grain that does not repeat.

use crate::random;

/// Texels of the grain's side; one texel is a centimetre.
const SIDE: usize = 512;
const TEXELS_PER_METRE: f32 = 100.0;

/// A pattern over a surface; sizes in metres.
#[derive(Clone, Copy, Debug)]
pub(super) enum TexturePattern {
    /// One colour.
    Plain,
    /// Light and dark squares.
    Checks(f32),
    /// Light and dark bands along the second coordinate.
    Stripes(f32),
    /// Squares with thin dark joints.
    Joints(f32),
    /// Upright bands of random colours, like the backs of books.
    Books(f32),
    /// Squares of random colours, like a picture.
    Patches(f32),
}

/// A surface's looks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Material {
    /// Red, green, blue, 0 to 1.
    base: [f32; 3],
    pattern: TexturePattern,
    /// How far the pattern goes from the base colour, 0 to 1.
    strength: f32,
    /// How far the grain goes from the base colour, 0 to 1.
    grain: f32,
    /// Where in the grain this surface begins, and the key of its random colours.
    key: u32,
    /// Whether it is glass: depth is not measured, and colour is that of what lies behind, tinted.
    pub(super) is_glass: bool,
}

impl Material {
    pub(super) fn plain(base: [f32; 3]) -> Self {
        Self { base, pattern: TexturePattern::Plain, strength: 0.0, grain: 0.5, key: 0, is_glass: false }
    }

    pub(super) fn patterned(base: [f32; 3], pattern: TexturePattern, strength: f32) -> Self {
        Self { base, pattern, strength, grain: 0.4, key: 0, is_glass: false }
    }

    /// Glass that lets a share of each colour through.
    pub(super) fn glass(tint: [f32; 3]) -> Self {
        Self { is_glass: true, ..Self::plain(tint) }
    }

    /// What is seen of a colour through glass.
    pub(super) fn seen_through(&self, rgb: [u8; 3]) -> [u8; 3] {
        // A little of the sky is reflected.
        std::array::from_fn(|k| (f32::from(rgb[k]) * self.base[k] + 24.5) as u8)
    }

    /// The same looks with another grain and other random colours.
    pub(super) fn keyed(self, key: u64) -> Self {
        Self { key: (random::mix(key) >> 32) as u32, ..self }
    }

    /// Colour at a point with its normal, both in the solid's axes, before shading.
    #[inline]
    pub(super) fn colour(&self, grain: &Grain, point: &[f32; 3], normal: &[f32; 3]) -> [f32; 3] {
        let (nx, ny, nz) = (normal[0].abs(), normal[1].abs(), normal[2].abs());
        // The face that the normal points to most; its two other coordinates are the picture's.
        let (u, v) = if nz >= nx && nz >= ny {
            (point[0], point[1])
        } else if nx >= ny {
            (point[1], point[2])
        } else {
            (point[0], point[2])
        };
        let key = self.key;
        let shift = |bits: u32| (bits & 511) as f32;
        let speckle =
            grain.at(u * TEXELS_PER_METRE + shift(key), v * TEXELS_PER_METRE + shift(key >> 9)) - 0.5;
        let common = 1.0 + self.grain * speckle;
        let cell = |value: f32, size: f32| floor(value / size);
        let factor = |value: f32| [common * value; 3];
        let by = match self.pattern {
            TexturePattern::Plain => factor(1.0),
            TexturePattern::Checks(size) => {
                let dark = (cell(u, size) + cell(v, size)) & 1;
                factor(1.0 - self.strength * dark as f32)
            }
            TexturePattern::Stripes(size) => factor(1.0 - self.strength * (cell(v, size) & 1) as f32),
            TexturePattern::Joints(size) => {
                let inside = |value: f32| value / size - cell(value, size) as f32;
                let is_joint = inside(u) < 0.04 || inside(v) < 0.04;
                let shade = random_shade(key, cell(u, size), cell(v, size));
                factor(if is_joint { 1.0 - self.strength } else { 0.9 + 0.2 * shade })
            }
            TexturePattern::Books(size) => self.random_colour(common, cell(u, size), 0),
            TexturePattern::Patches(size) => self.random_colour(common, cell(u, size), cell(v, size)),
        };
        [self.base[0] * by[0], self.base[1] * by[1], self.base[2] * by[2]]
    }

    fn random_colour(&self, common: f32, i: i32, j: i32) -> [f32; 3] {
        let word = hash(self.key, i, j);
        [0, 8, 16].map(|shift| {
            let value = (word >> shift & 255) as f32 / 255.0;
            common * (1.0 - self.strength * value)
        })
    }
}

fn random_shade(key: u32, i: i32, j: i32) -> f32 {
    (hash(key, i, j) & 255) as f32 / 255.0
}

#[inline]
fn hash(key: u32, i: i32, j: i32) -> u32 {
    let mut word = key ^ (i as u32).wrapping_mul(0x9e37_79b1) ^ (j as u32).wrapping_mul(0x85eb_ca77);
    word = (word ^ (word >> 15)).wrapping_mul(0x2c1b_3c6d);
    word = (word ^ (word >> 12)).wrapping_mul(0x297a_2d39);
    word ^ (word >> 15)
}

/// `floor` without a call where the machine has no such instruction.
#[inline]
fn floor(value: f32) -> i32 {
    let whole = value as i32;
    whole - i32::from((whole as f32) > value)
}

/// Fractal noise that repeats after 5.12 m.
#[derive(Clone, Debug)]
pub(super) struct Grain {
    texels: Vec<u8>,
}

impl Grain {
    pub(super) fn new(seed: u64) -> Self {
        let mut sum = vec![0.0f32; SIDE * SIDE];
        // Blotches of 64 cm down to grains of 2 cm; fine ones weaker, as on real surfaces.
        for (octave, (cell, weight)) in
            [(64, 0.30), (16, 0.30), (8, 0.2), (4, 0.2), (2, 0.15)].into_iter().enumerate()
        {
            let n_cells = SIDE / cell;
            let value = |i: usize, j: usize| {
                let at = ((i % n_cells) * n_cells + j % n_cells) as u64;
                random::unit(random::word(seed, 0x6a1 + octave as u64), at) as f32 - 0.5
            };
            for i in 0..SIDE {
                for j in 0..SIDE {
                    let (ci, cj) = (i / cell, j / cell);
                    let (fi, fj) = ((i % cell) as f32 / cell as f32, (j % cell) as f32 / cell as f32);
                    let (fi, fj) = (fi * fi * (3.0 - 2.0 * fi), fj * fj * (3.0 - 2.0 * fj));
                    let top = value(ci, cj) * (1.0 - fj) + value(ci, cj + 1) * fj;
                    let bottom = value(ci + 1, cj) * (1.0 - fj) + value(ci + 1, cj + 1) * fj;
                    sum[i * SIDE + j] += weight * (top * (1.0 - fi) + bottom * fi);
                }
            }
        }
        Self { texels: sum.into_iter().map(|v| ((0.5 + v * 1.2).clamp(0.0, 1.0) * 255.0) as u8).collect() }
    }

    /// Value 0 to 1 at a place in texels, between texels in proportion.
    #[inline]
    fn at(&self, u: f32, v: f32) -> f32 {
        let (iu, iv) = (floor(u), floor(v));
        let (fu, fv) = (u - iu as f32, v - iv as f32);
        let wrap = |value: i32| (value & (SIDE as i32 - 1)) as usize;
        let (u0, u1, v0, v1) = (wrap(iu), wrap(iu + 1), wrap(iv) * SIDE, wrap(iv + 1) * SIDE);
        let texel = |at: usize| f32::from(self.texels[at & (SIDE * SIDE - 1)]);
        let top = texel(v0 + u0) * (1.0 - fu) + texel(v0 + u1) * fu;
        let bottom = texel(v1 + u0) * (1.0 - fu) + texel(v1 + u1) * fu;
        (top * (1.0 - fv) + bottom * fv) * (1.0 / 255.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floor_is_floor() {
        for (value, expected) in [(1.5, 1), (-1.5, -2), (2.0, 2), (-2.0, -2), (0.0, 0), (-0.25, -1)] {
            assert_eq!(floor(value), expected);
        }
    }

    #[test]
    fn the_grain_is_seamless_and_varied() {
        let grain = Grain::new(3);
        for k in 0..100 {
            let v = k as f32 * 3.7;
            assert!((grain.at(511.999, v) - grain.at(512.001, v)).abs() < 0.01);
        }
        let values: Vec<f32> = (0..500).map(|k| grain.at(k as f32 * 1.3, k as f32 * 7.1)).collect();
        let (low, high) = values.iter().fold((1.0f32, 0.0f32), |(a, b), &v| (a.min(v), b.max(v)));
        assert!(low < 0.35 && high > 0.65, "{low} {high}");
    }
}
