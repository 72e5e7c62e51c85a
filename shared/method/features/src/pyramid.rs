//! The image pyramid: grey levels at scales 1, 1.5, 2, 3, 4, 6, ...
//!
//! Factors of 3/2 and 2 let every output pixel of a row use the same few input pixels with the
//! same weights, which vectorises; a factor of 1.4 needs a table look-up per pixel. Level 1 comes
//! from level 0 by bilinear interpolation at scale 3/2, every other level from the second before it
//! by the mean of 2x2 pixels.

use crate::picture::{Picture, Pixels};

/// A grey image, row by row.
#[derive(Clone, Debug, Default)]
pub(crate) struct Plane {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) pixels: Vec<u8>,
}

impl Plane {
    fn resize(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.pixels.resize(width * height, 0);
    }

    #[inline(always)]
    pub(crate) fn row(&self, row: usize) -> &[u8] {
        &self.pixels[row * self.width..(row + 1) * self.width]
    }

    #[inline(always)]
    fn row_mut(&mut self, row: usize) -> &mut [u8] {
        &mut self.pixels[row * self.width..(row + 1) * self.width]
    }
}

/// Pixels of the full image that a pixel of the level is wide.
pub(crate) fn scale(level: usize) -> f32 {
    let octave = (1u32 << (level / 2)) as f32;
    if level.is_multiple_of(2) { octave } else { 1.5 * octave }
}

/// Position in the full image of a position on a level: the corners of both images agree.
#[inline(always)]
pub(crate) fn to_full(position: f32, scale: f32) -> f32 {
    (position + 0.5) * scale - 0.5
}

/// Fills all levels from the picture.
#[inline(always)]
pub(crate) fn build(picture: &Picture<'_>, levels: &mut [Plane], line: &mut Vec<u8>) {
    levels[0].resize(picture.width(), picture.height());
    match picture.pixels() {
        // Row by row: one copy of a whole image is slower on some machines, several times.
        Pixels::Grey(bytes) => {
            let rows = bytes.chunks_exact(picture.width().max(1));
            rows.enumerate().for_each(|(row, bytes)| levels[0].row_mut(row).copy_from_slice(bytes));
        }
        Pixels::Rgb(bytes) => grey(bytes, &mut levels[0].pixels),
    }
    for level in 1..levels.len() {
        let (finer, coarser) = levels.split_at_mut(level);
        match level {
            1 => two_thirds(&finer[0], &mut coarser[0], line),
            _ => half(&finer[level - 2], &mut coarser[0]),
        }
    }
}

/// Luma of ITU-R BT.601 in 8-bit fractions.
#[inline(always)]
fn grey(rgb: &[u8], out: &mut [u8]) {
    for (rgb, out) in rgb.chunks_exact(3).zip(out) {
        let sum = 77 * u16::from(rgb[0]) + 150 * u16::from(rgb[1]) + 29 * u16::from(rgb[2]);
        *out = (sum >> 8) as u8;
    }
}

/// Rounded mean, one instruction for 16 to 64 bytes.
#[inline(always)]
pub(crate) fn mean(a: u8, b: u8) -> u8 {
    ((u16::from(a) + u16::from(b) + 1) >> 1) as u8
}

/// Three quarters of `a` and one of `b`.
#[inline(always)]
fn near(a: u8, b: u8) -> u8 {
    mean(a, mean(a, b))
}

/// Scale 3/2: outputs at inputs 0.25, 1.75, 3.25, ... of rows and columns.
#[inline(always)]
fn two_thirds(from: &Plane, to: &mut Plane, line: &mut Vec<u8>) {
    to.resize(from.width / 3 * 2, from.height / 3 * 2);
    line.resize(from.width, 0);
    for row in 0..to.height {
        let (at, other) = (row / 2 * 3 + row % 2 * 2, row / 2 * 3 + 1);
        for ((out, &a), &b) in line.iter_mut().zip(from.row(at)).zip(from.row(other)) {
            *out = near(a, b);
        }
        for (out, p) in to.row_mut(row).chunks_exact_mut(2).zip(line.chunks_exact(3)) {
            out[0] = near(p[0], p[1]);
            out[1] = near(p[2], p[1]);
        }
    }
}

/// Scale 2: the mean of 2x2 pixels.
#[inline(always)]
fn half(from: &Plane, to: &mut Plane) {
    to.resize(from.width / 2, from.height / 2);
    for row in 0..to.height {
        let (above, below) = (from.row(2 * row), from.row(2 * row + 1));
        let pairs = above.chunks_exact(2).zip(below.chunks_exact(2));
        for (out, (a, b)) in to.row_mut(row).iter_mut().zip(pairs) {
            *out = mean(mean(a[0], b[0]), mean(a[1], b[1]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn planes(width: usize, height: usize, value: impl Fn(usize, usize) -> u8) -> Vec<Plane> {
        let bytes: Vec<u8> = (0..width * height).map(|i| value(i / width, i % width)).collect();
        let mut levels = vec![Plane::default(); 6];
        build(&Picture::grey(width, height, &bytes).unwrap(), &mut levels, &mut Vec::new());
        levels
    }

    #[test]
    fn a_ramp_is_where_the_scale_says() {
        for (level, plane) in planes(220, 180, |r, c| (r / 4 + c / 2) as u8).iter().enumerate() {
            for row in 2..plane.height - 2 {
                for column in 2..plane.width - 2 {
                    let r = to_full(row as f32, scale(level));
                    let c = to_full(column as f32, scale(level));
                    let expected = (r - 1.5) / 4.0 + (c - 0.5) / 2.0;
                    let found = f32::from(plane.row(row)[column]);
                    assert!(
                        (found - expected).abs() < 2.0,
                        "level {level} {row} {column}: {found} {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn white_and_black_stay_and_small_images_shrink_to_nothing() {
        for value in [0, 255] {
            assert!(planes(64, 48, |_, _| value).iter().all(|p| p.pixels.iter().all(|&v| v == value)));
        }
        for (width, height) in [(0, 0), (1, 1), (2, 3), (1, 40)] {
            planes(width, height, |_, _| 9);
        }
        let rgb = [255, 255, 255, 0, 0, 0, 255, 0, 0];
        let mut out = [0; 3];
        grey(&rgb, &mut out);
        assert_eq!(out, [255, 0, 76]);
    }
}
