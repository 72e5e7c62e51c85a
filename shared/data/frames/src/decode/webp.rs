//! WebP of colour, lossy or lossless; of a moving picture the first one.

use super::{check_size, damaged, read_rgb};
use crate::ImageError;
use image_webp::WebPDecoder;
use std::io::Cursor;

const RIFF: &[u8] = b"RIFF";
const WEBP: &[u8] = b"WEBP";
/// Bytes before those that the head counts.
const UNCOUNTED: u64 = 8;

/// Whether a file is one, by its first bytes.
pub(super) fn is(bytes: &[u8]) -> bool {
    bytes.starts_with(RIFF) && bytes.get(8..).is_some_and(|bytes| bytes.starts_with(WEBP))
}

/// Whether the file is as long as its head states.
pub(super) fn check_length(head: &[u8], n_bytes: u64) -> Result<(), ImageError> {
    let stated = head.get(RIFF.len()..).and_then(<[u8]>::first_chunk).map(|n| u32::from_le_bytes(*n));
    let expected = u64::from(stated.unwrap_or(u32::MAX)).saturating_add(UNCOUNTED);
    match n_bytes >= expected {
        true => Ok(()),
        false => Err(damaged("WebP", &format!("{n_bytes} bytes, expected {expected}"))),
    }
}

pub(super) fn size(bytes: &[u8]) -> Result<(u32, u32), ImageError> {
    Ok(open(bytes)?.dimensions())
}

/// Decodes as red, green, blue.
pub(super) fn read(bytes: &[u8], size: (u32, u32), rgb: &mut [u8]) -> Result<(), ImageError> {
    check_length(bytes, bytes.len() as u64)?;
    let mut decoder = open(bytes)?;
    check_size("colour", decoder.dimensions(), size)?;
    let n_channels = if decoder.has_alpha() { 4 } else { 3 };
    read_rgb(n_channels, rgb, |to| decoder.read_image(to).map_err(|error| damaged("WebP", &error)))
}

fn open(bytes: &[u8]) -> Result<WebPDecoder<Cursor<&[u8]>>, ImageError> {
    WebPDecoder::new(Cursor::new(bytes)).map_err(|error| damaged("WebP", &error))
}

#[cfg(test)]
mod tests {
    use super::super::{colour, inspect_bytes, size};
    use image_webp::{ColorType, WebPEncoder};

    fn webp(pixels: &[u8], kind: ColorType) -> Vec<u8> {
        let mut bytes = Vec::new();
        WebPEncoder::new(&mut bytes).encode(pixels, 3, 2, kind).unwrap();
        bytes
    }

    #[test]
    fn colour_comes_back_with_and_without_transparency() {
        let rgb: Vec<u8> = (0..18).map(|k| k * 14).collect();
        let rgba: Vec<u8> = rgb.chunks(3).flat_map(|pixel| [pixel[0], pixel[1], pixel[2], 200]).collect();
        for bytes in [webp(&rgb, ColorType::Rgb8), webp(&rgba, ColorType::Rgba8)] {
            let mut found = [0; 18];
            colour(&bytes, (3, 2), &mut found).unwrap();
            assert_eq!(found[..], rgb[..]);
            assert_eq!(size(&bytes).unwrap(), (3, 2));
            inspect_bytes(&bytes).unwrap();
            assert!(colour(&bytes, (2, 3), &mut found).unwrap_err().to_string().contains("3x2"));
        }
    }

    #[test]
    fn one_that_is_cut_or_damaged_is_refused_and_never_panics() {
        let rgb: Vec<u8> = (0..18).map(|k| k * 14).collect();
        let whole = webp(&rgb, ColorType::Rgb8);
        let mut found = [0; 18];
        for end in 0..whole.len() {
            assert!(colour(&whole[..end], (3, 2), &mut found).is_err(), "cut at {end}");
            assert!(inspect_bytes(&whole[..end]).is_err(), "cut at {end}");
        }
        for at in 0..whole.len() {
            for bit in 0..8 {
                let mut bytes = whole.clone();
                bytes[at] ^= 1 << bit;
                let _ = (colour(&bytes, (3, 2), &mut found), size(&bytes), inspect_bytes(&bytes));
            }
        }
    }
}
