//! The smoothed neighbourhood of a corner, and its orientation.

use crate::detect::MARGIN;
use crate::pyramid::{Plane, mean};

/// Side of the smoothed patch.
pub(crate) const SIDE: usize = 32;
/// Row and column of the corner in the patch.
pub(crate) const CENTRE: usize = 16;
/// Radius of the disc that orientation and descriptor read.
pub(crate) const RADIUS: usize = 15;
/// Reach of the smoothing.
const REACH: usize = 2;

/// Smoothed intensity around a corner, row by row.
pub(crate) struct Patch(pub(crate) [u8; SIDE * SIDE]);

impl Patch {
    pub(crate) const EMPTY: Self = Self([0; SIDE * SIDE]);

    /// Smooths with `[1 2 2 2 1] / 8` along rows and columns: sigma 1.2 px, and no image beyond
    /// what descriptors read is smoothed.
    #[inline(always)]
    pub(crate) fn fill(&mut self, plane: &Plane, row: usize, column: usize) {
        let mut lines = [[0u8; SIDE]; SIDE + 2 * REACH];
        let first = (row - MARGIN) * plane.width + column - MARGIN;
        for (r, line) in lines.iter_mut().enumerate() {
            let from = first + r * plane.width;
            let p: &[u8; SIDE + 2 * REACH] =
                plane.pixels[from..].first_chunk().unwrap_or(&[0; SIDE + 2 * REACH]);
            for i in 0..SIDE {
                line[i] = smooth([p[i], p[i + 1], p[i + 2], p[i + 3], p[i + 4]]);
            }
        }
        for (r, out) in self.0.chunks_exact_mut(SIDE).enumerate() {
            for i in 0..SIDE {
                out[i] = smooth(std::array::from_fn(|k| lines[r + k][i]));
            }
        }
    }

    /// Moments of the disc: `sum of column * intensity` and `sum of row * intensity`, from the
    /// corner (Rosin 1999).
    #[inline(always)]
    pub(crate) fn moments(&self) -> [i32; 2] {
        let row = |r: usize| -> &[u8; SIDE] { self.0[r * SIDE..].first_chunk().unwrap_or(&[0; SIDE]) };
        let mut sums = [0i16; SIDE];
        // At most 120 * 255 in size, which 16 bits hold.
        let mut vertical = [0i16; SIDE];
        let mask = &DISC[0];
        for i in 0..SIDE {
            sums[i] = i16::from(row(CENTRE)[i]) & mask[i];
        }
        for v in 1..=RADIUS {
            let (below, above, mask) = (row(CENTRE + v), row(CENTRE - v), &DISC[v]);
            for i in 0..SIDE {
                let (b, a) = (i16::from(below[i]) & mask[i], i16::from(above[i]) & mask[i]);
                sums[i] += b + a;
                vertical[i] += v as i16 * (b - a);
            }
        }
        let mut moments = [0; 2];
        for i in 0..SIDE {
            moments[0] += (i as i32 - CENTRE as i32) * i32::from(sums[i]);
            moments[1] += i32::from(vertical[i]);
        }
        moments
    }
}

#[inline(always)]
fn smooth([a, b, c, d, e]: [u8; 5]) -> u8 {
    mean(mean(mean(a, e), c), mean(b, d))
}

/// All bits set where a pixel of the disc lies, by distance of its row.
const DISC: [[i16; SIDE]; RADIUS + 1] = {
    let mut disc = [[0; SIDE]; RADIUS + 1];
    let mut v = 0;
    while v <= RADIUS {
        let mut i = 0;
        while i < SIDE {
            let u = i as i32 - CENTRE as i32;
            if u * u + (v * v) as i32 <= (RADIUS * RADIUS) as i32 {
                disc[v][i] = -1;
            }
            i += 1;
        }
        v += 1;
    }
    disc
};

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_numerics::SplitMix64;

    #[test]
    fn moments_agree_with_their_definition_at_full_contrast() {
        let mut random = SplitMix64::new(5);
        for kind in 0..4 {
            let mut patch = Patch::EMPTY;
            for (i, value) in patch.0.iter_mut().enumerate() {
                *value = match kind {
                    0 => random.below(256) as u8,
                    1 => 255,
                    2 => 255 * u8::from(i / SIDE > CENTRE),
                    _ => 255 * u8::from(i / SIDE < CENTRE),
                };
            }
            let mut expected = [0; 2];
            for (i, &value) in patch.0.iter().enumerate() {
                let (v, u) = ((i / SIDE) as i32 - CENTRE as i32, (i % SIDE) as i32 - CENTRE as i32);
                if u * u + v * v <= (RADIUS * RADIUS) as i32 {
                    expected[0] += u * i32::from(value);
                    expected[1] += v * i32::from(value);
                }
            }
            assert_eq!(patch.moments(), expected, "{kind}");
        }
    }

    #[test]
    fn smoothing_spreads_one_pixel_evenly_around_it() {
        let mut plane = Plane { width: 40, height: 40, pixels: vec![0; 1600] };
        plane.pixels[20 * 40 + 20] = 255;
        let mut patch = Patch::EMPTY;
        patch.fill(&plane, 20, 20);
        let at = |r: usize, c: usize| i32::from(patch.0[(CENTRE + r - 2) * SIDE + CENTRE + c - 2]);
        for r in 0..5 {
            for c in 0..5 {
                let weight = |k: usize| if k.is_multiple_of(4) { 1.0 } else { 2.0 };
                let expected = 255.0 * weight(r) * weight(c) / 64.0;
                assert!((f64::from(at(r, c)) - expected).abs() < 3.0, "{r} {c}: {}", at(r, c));
            }
        }
        assert_eq!(patch.0.iter().filter(|&&v| v > 0).count(), 25);
    }
}
