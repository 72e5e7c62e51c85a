//! Pictures inside the page: colour, depth and mesh as data URIs.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use jpeg_encoder::{ColorType, Encoder};

/// Quality of JPEG, of 100.
const QUALITY: u8 = 80;
/// Widest picture: larger ones are made smaller by whole factors.
const MOST_COLUMNS: usize = 400;

/// Why a picture could not be made.
#[derive(Debug, thiserror::Error)]
pub enum ThumbnailError {
    /// Pixels and size do not fit.
    #[error("{found} values for {width}x{height} pixels, expected {expected}")]
    Size {
        /// Values given.
        found: usize,
        /// Values needed.
        expected: usize,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// The encoder of JPEG refused.
    #[error("cannot encode a picture: {0}")]
    Jpeg(#[from] jpeg_encoder::EncodingError),
    /// The encoder of PNG refused.
    #[error("cannot encode a picture: {0}")]
    Png(#[from] png::EncodingError),
}

/// An encoded picture.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ReportPicture {
    kind: &'static str,
    bytes: Vec<u8>,
    width: usize,
    height: usize,
}

impl ReportPicture {
    /// The picture as an element of a page.
    pub(crate) fn html(&self, what: &str) -> String {
        let Self { kind, width, height, .. } = self;
        let what = tessera_outputs::html::escaped(what);
        let data = STANDARD.encode(&self.bytes);
        format!(
            "<img width=\"{width}\" height=\"{height}\" alt=\"{what}\" src=\"data:image/{kind};base64,{data}\">"
        )
    }
}

/// A colour image: red, green, blue bytes, row by row.
///
/// # Errors
/// Where the bytes are not `3 * width * height`, or the encoder refuses.
pub fn photograph(width: usize, height: usize, rgb: &[u8]) -> Result<ReportPicture, ThumbnailError> {
    let (pixels, _) = rgb.as_chunks::<3>();
    check(rgb.len(), 3, width, height)?;
    let (columns, rows, small) = smaller(width, height, pixels, |rgb| *rgb);
    // The encoder refuses a size that is not that of its pixels.
    let size = [columns, rows].map(|n| u16::try_from(n).unwrap_or(u16::MAX));
    let mut bytes = Vec::new();
    Encoder::new(&mut bytes, QUALITY).encode(&small, size[0], size[1], ColorType::Rgb)?;
    Ok(ReportPicture { kind: "jpeg", bytes, width: columns, height: rows })
}

/// A depth image: near is light, far is dark, nothing is white.
///
/// `depth` holds raw units, row by row; 0 and 65535 mean no measurement.
///
/// # Errors
/// As [`photograph`].
pub fn depth_picture(width: usize, height: usize, depth: &[u16]) -> Result<ReportPicture, ThumbnailError> {
    check(depth.len(), 1, width, height)?;
    let is_measured = |d: u16| d != 0 && d != u16::MAX;
    let mut sorted: Vec<u16> = depth.iter().copied().filter(|&d| is_measured(d)).collect();
    sorted.sort_unstable();
    #[expect(clippy::cast_possible_truncation, reason = "a share of the length")]
    let at = |share: f64| {
        sorted.get((share * sorted.len().saturating_sub(1) as f64) as usize).map_or(0.0, |d| f64::from(*d))
    };
    // Single outliers do not take the colours of all others.
    let (near, far) = (at(0.02), at(0.98));
    let colour = |&d: &u16| {
        if !is_measured(d) {
            return [255; 3];
        }
        let share = ((f64::from(d) - near) / (far - near).max(1.0)).clamp(0.0, 1.0);
        ramp(share)
    };
    let (columns, rows, small) = smaller(width, height, depth, colour);
    let size = [columns, rows].map(|n| u32::try_from(n).unwrap_or(u32::MAX));
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, size[0], size[1]);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header()?.write_image_data(&small)?;
    Ok(ReportPicture { kind: "png", bytes, width: columns, height: rows })
}

/// From light yellow over green and blue to dark violet: brightness falls all the way, so that it
/// can be read without colours too.
#[expect(
    clippy::arithmetic_side_effects,
    clippy::cast_possible_truncation,
    clippy::indexing_slicing,
    reason = "between two neighbours of five colours"
)]
fn ramp(share: f64) -> [u8; 3] {
    const STOPS: [[f64; 3]; 5] = [
        [253.0, 231.0, 37.0],
        [94.0, 201.0, 98.0],
        [33.0, 145.0, 140.0],
        [59.0, 82.0, 139.0],
        [68.0, 1.0, 84.0],
    ];
    let place = share * (STOPS.len() - 1) as f64;
    let first = (place as usize).min(STOPS.len() - 2);
    let t = place - first as f64;
    std::array::from_fn(|k| (STOPS[first][k] * (1.0 - t) + STOPS[first + 1][k] * t) as u8)
}

fn check(found: usize, per_pixel: usize, width: usize, height: usize) -> Result<(), ThumbnailError> {
    let expected = width.saturating_mul(height).saturating_mul(per_pixel);
    let is_right = found == expected && width > 0 && height > 0;
    is_right.then_some(()).ok_or(ThumbnailError::Size { found, expected, width, height })
}

/// Every k-th pixel of every k-th row, so that the picture is not wider than needed.
fn smaller<P>(
    width: usize,
    height: usize,
    pixels: &[P],
    colour: impl Fn(&P) -> [u8; 3],
) -> (usize, usize, Vec<u8>) {
    let k = width.div_ceil(MOST_COLUMNS).max(1);
    let columns = width.checked_div(k).unwrap_or(0);
    let rows = height.checked_div(k).unwrap_or(0).max(1);
    let lines = pixels.chunks_exact(width).step_by(k).take(rows);
    let bytes = lines.flat_map(|line| line.iter().step_by(k).take(columns)).flat_map(colour).collect();
    (columns, rows, bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_is_lighter_than_far_and_nothing_is_white() {
        let mut depth = vec![0u16; 64 * 32];
        for (k, d) in depth.iter_mut().enumerate().skip(64) {
            *d = 1000 + k as u16;
        }
        let image = depth_picture(64, 32, &depth).unwrap();
        let back = image::load_from_memory(&image.bytes).unwrap().to_rgb8();
        let brightness =
            |column, row| back.get_pixel(column, row).0.iter().map(|&v| u32::from(v)).sum::<u32>();
        assert_eq!(back.get_pixel(5, 0).0, [255; 3]);
        assert!(brightness(5, 2) > brightness(5, 30));
    }

    #[test]
    fn large_pictures_become_smaller_and_wrong_sizes_are_named() {
        let image = photograph(640, 480, &vec![90; 3 * 640 * 480]).unwrap();
        assert_eq!((image.width, image.height), (320, 240));
        assert!(
            image.html("a \"b\"").starts_with("<img width=\"320\" height=\"240\" alt=\"a &quot;b&quot;\"")
        );
        let wide = photograph(1600, 2, &vec![90; 3 * 1600 * 2]).unwrap();
        assert_eq!((wide.width, wide.height), (400, 1));
        let error = photograph(640, 480, &[0; 3]).unwrap_err().to_string();
        assert_eq!(error, "3 values for 640x480 pixels, expected 921600");
    }
}
