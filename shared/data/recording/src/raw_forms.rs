//! Colour as cameras give it: YUV with shared chroma, Bayer patterns, 16 bits a channel.
//!
//! Encodings are those of ROS's `image_encodings.hpp`.
#![expect(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation,
    reason = "places within pixels of rows whose length was checked (pixels::rows), sums of at most nine bytes"
)]

/// A form of pixels that is not plain 8-bit colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CameraForm {
    /// Two pixels in four bytes; places of the first luma, of U and of V.
    Yuv422 { y: usize, u: usize, v: usize },
    /// One colour a pixel, by the place of red in a block of two times two, bytes a pixel.
    Bayer { red: (usize, usize), bytes: usize },
    /// Channels of 16 bits: places of red, green and blue, and how many there are.
    Deep { places: [usize; 3], n: usize },
}

impl CameraForm {
    /// By the name of the encoding.
    pub(super) fn of(encoding: &str) -> Option<Self> {
        let bayer = |red, bytes| Some(Self::Bayer { red, bytes });
        match encoding {
            "yuv422" | "uyvy" => Some(Self::Yuv422 { y: 1, u: 0, v: 2 }),
            "yuv422_yuy2" | "yuyv" => Some(Self::Yuv422 { y: 0, u: 1, v: 3 }),
            "bayer_rggb8" => bayer((0, 0), 1),
            "bayer_grbg8" => bayer((0, 1), 1),
            "bayer_gbrg8" => bayer((1, 0), 1),
            "bayer_bggr8" => bayer((1, 1), 1),
            "bayer_rggb16" => bayer((0, 0), 2),
            "bayer_grbg16" => bayer((0, 1), 2),
            "bayer_gbrg16" => bayer((1, 0), 2),
            "bayer_bggr16" => bayer((1, 1), 2),
            "mono16" | "16UC1" => Some(Self::Deep { places: [0, 0, 0], n: 1 }),
            "rgb16" | "16UC3" => Some(Self::Deep { places: [0, 1, 2], n: 3 }),
            "bgr16" => Some(Self::Deep { places: [2, 1, 0], n: 3 }),
            "rgba16" => Some(Self::Deep { places: [0, 1, 2], n: 4 }),
            "bgra16" => Some(Self::Deep { places: [2, 1, 0], n: 4 }),
            _ => None,
        }
    }

    pub(super) fn bytes_per_pixel(self) -> usize {
        match self {
            Self::Yuv422 { .. } => 2,
            Self::Bayer { bytes, .. } => bytes,
            Self::Deep { n, .. } => 2 * n,
        }
    }

    /// Red, green, blue of whole rows.
    pub(super) fn to_rgb(self, rows: &[&[u8]], is_big_endian: bool, rgb: &mut [u8]) {
        // The higher byte of two.
        let high = usize::from(!is_big_endian);
        let width = rows.first().map_or(0, |row| row.len() / self.bytes_per_pixel());
        if width == 0 {
            return;
        }
        for (at, (to, row)) in rgb.chunks_exact_mut(3 * width).zip(rows).enumerate() {
            match self {
                Self::Yuv422 { y, u, v } => yuv422(row, [y, u, v], to),
                Self::Bayer { red, bytes } => {
                    let pick = if bytes == 2 { high } else { 0 };
                    bayer(rows, at, red, |row, column| row[bytes * column + pick], to);
                }
                Self::Deep { places, n } => {
                    for (pixel, from) in to.chunks_exact_mut(3).zip(row.chunks_exact(2 * n)) {
                        pixel.copy_from_slice(&places.map(|place| from[2 * place + high]));
                    }
                }
            }
        }
    }
}

/// A row of luma with chroma shared by two pixels, as of BT.601 with the range of video.
fn yuv422(row: &[u8], [y, u, v]: [usize; 3], to: &mut [u8]) {
    for (pixels, from) in to.chunks_mut(6).zip(row.chunks_exact(4)) {
        let (u, v) = (f32::from(from[u]) - 128.0, f32::from(from[v]) - 128.0);
        for (at, pixel) in pixels.chunks_exact_mut(3).enumerate() {
            let luma = 1.164 * (f32::from(from[y + 2 * at]) - 16.0);
            let channels = [luma + 1.596 * v, luma - 0.813 * v - 0.391 * u, luma + 2.018 * u];
            pixel.copy_from_slice(&channels.map(|value| value.round().clamp(0.0, 255.0) as u8));
        }
    }
}

/// A row of a Bayer pattern: each channel is the mean of its neighbours among three times three pixels.
fn bayer(rows: &[&[u8]], at: usize, red: (usize, usize), value: impl Fn(&[u8], usize) -> u8, to: &mut [u8]) {
    let width = to.len() / 3;
    // 0 red, 1 green, 2 blue.
    let channel = |row: usize, column: usize| (row % 2 != red.0) as usize + (column % 2 != red.1) as usize;
    for (column, pixel) in to.chunks_exact_mut(3).enumerate() {
        let (mut sums, mut counts) = ([0_u32; 3], [0_u32; 3]);
        for (r, row) in rows.iter().enumerate().take(at + 2).skip(at.saturating_sub(1)) {
            for c in column.saturating_sub(1)..(column + 2).min(width) {
                // Of the pixel's own channel the pixel alone.
                if channel(r, c) != channel(at, column) || (r, c) == (at, column) {
                    sums[channel(r, c)] += u32::from(value(row, c));
                    counts[channel(r, c)] += 1;
                }
            }
        }
        for ((to, sum), n) in pixel.iter_mut().zip(sums).zip(counts) {
            *to = ((sum + n / 2) / n.max(1)) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rgb(encoding: &str, rows: &[&[u8]], is_big_endian: bool) -> Vec<u8> {
        let form = CameraForm::of(encoding).unwrap();
        let n = rows.len() * rows[0].len() / form.bytes_per_pixel();
        let mut rgb = vec![9; 3 * n];
        form.to_rgb(rows, is_big_endian, &mut rgb);
        rgb
    }

    #[test]
    fn yuv_of_known_colours() {
        // Red, green, blue and white by BT.601: (81, 90, 240), (145, 54, 34), (41, 240, 110), (235, 128, 128).
        for ((y, u, v), expected) in [
            ((81, 90, 240), [255, 0, 0]),
            ((145, 54, 34), [0, 255, 0]),
            ((41, 240, 110), [0, 0, 255]),
            ((235, 128, 128), [255, 255, 255]),
            ((16, 128, 128), [0, 0, 0]),
        ] {
            for (encoding, row) in [("yuv422_yuy2", [y, u, y, v]), ("yuv422", [u, y, v, y])] {
                for pixel in rgb(encoding, &[&row], false).chunks(3) {
                    let off = pixel.iter().zip(&expected).map(|(a, b): (&u8, &u8)| a.abs_diff(*b)).max();
                    assert!(off.unwrap() <= 2, "{encoding}: {pixel:?}, expected {expected:?}");
                }
            }
        }
    }

    #[test]
    fn bayer_patterns_give_one_colour_of_an_even_image() {
        let (r, g, b) = (200, 90, 30);
        for (encoding, block) in [
            ("bayer_rggb8", [[r, g], [g, b]]),
            ("bayer_grbg8", [[g, r], [b, g]]),
            ("bayer_gbrg8", [[g, b], [r, g]]),
            ("bayer_bggr8", [[b, g], [g, r]]),
        ] {
            let row = |k: usize| [block[k], block[k], block[k]].concat();
            let rows = [row(0), row(1), row(0), row(1)];
            let rows: Vec<&[u8]> = rows.iter().map(Vec::as_slice).collect();
            assert!(rgb(encoding, &rows, false).chunks(3).all(|pixel| pixel == [r, g, b]), "{encoding}");
            let deep: Vec<Vec<u8>> =
                rows.iter().map(|row| row.iter().flat_map(|v| [7, *v]).collect()).collect();
            let deep: Vec<&[u8]> = deep.iter().map(Vec::as_slice).collect();
            let encoding = encoding.replace('8', "16");
            assert!(rgb(&encoding, &deep, false).chunks(3).all(|pixel| pixel == [r, g, b]), "{encoding}");
        }
    }

    #[test]
    fn of_two_bytes_the_higher_is_taken() {
        assert_eq!(rgb("mono16", &[&[1, 200, 2, 100]], false), [200, 200, 200, 100, 100, 100]);
        assert_eq!(rgb("mono16", &[&[200, 1]], true), [200, 200, 200]);
        assert_eq!(rgb("bgr16", &[&[0, 1, 0, 2, 0, 3]], false), [3, 2, 1]);
        assert_eq!(rgb("rgba16", &[&[0, 1, 0, 2, 0, 3, 0, 4]], false), [1, 2, 3]);
        assert_eq!(CameraForm::of("nv12"), None);
    }
}
