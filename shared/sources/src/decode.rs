//! Images into the caller's memory: PNG for depth, PNG or JPEG for colour.

use crate::ImageError;
use image::codecs::{jpeg::JpegDecoder, png::PngDecoder};
use image::{ColorType, ImageDecoder, Limits};
use std::io::Cursor;

/// Decodes a 16-bit greyscale PNG of the given columns and rows.
pub(crate) fn depth(bytes: &[u8], size: (u32, u32), depth_raw: &mut [u16]) -> Result<(), ImageError> {
    if !is_png(bytes) {
        return Err(ImageError::Format { found: first_bytes(bytes), or_jpeg: "" });
    }
    let decoder = png(bytes)?;
    check_size("depth", decoder.dimensions(), size)?;
    if decoder.color_type() != ColorType::L16 {
        let found = pixels(decoder.color_type());
        return Err(ImageError::Pixels { what: "depth", found, expected: "1 channel of 16 bits" });
    }
    decoder.read_image(bytemuck::cast_slice_mut(depth_raw)).map_err(|error| damaged("PNG", &error))
}

/// Decodes a colour or grey PNG or JPEG of 8 bits as red, green, blue.
pub(crate) fn colour(bytes: &[u8], size: (u32, u32), rgb: &mut [u8]) -> Result<(), ImageError> {
    if is_png(bytes) {
        return read_rgb("PNG", png(bytes)?, size, rgb);
    }
    if !bytes.starts_with(&[0xff, 0xd8]) {
        return Err(ImageError::Format { found: first_bytes(bytes), or_jpeg: " or JPEG" });
    }
    // The decoder paints what is missing of a cut file grey and calls it a success.
    let tail = &bytes[bytes.len().saturating_sub(1024)..];
    if !tail.windows(2).any(|pair| pair == [0xff, 0xd9]) {
        let message = format!("no end marker in {} bytes", bytes.len());
        return Err(ImageError::Damaged { format: "JPEG", message });
    }
    let decoder = JpegDecoder::new(Cursor::new(bytes)).map_err(|error| damaged("JPEG", &error))?;
    read_rgb("JPEG", decoder, size, rgb)
}

fn read_rgb(
    format: &'static str,
    decoder: impl ImageDecoder,
    size: (u32, u32),
    rgb: &mut [u8],
) -> Result<(), ImageError> {
    check_size("colour", decoder.dimensions(), size)?;
    let color_type = decoder.color_type();
    if color_type == ColorType::Rgb8 {
        return decoder.read_image(rgb).map_err(|error| damaged(format, &error));
    }
    let n_channels = usize::from(color_type.channel_count());
    if color_type.bytes_per_pixel() != color_type.channel_count() {
        let found = pixels(color_type);
        return Err(ImageError::Pixels { what: "colour", found, expected: "1 to 4 channels of 8 bits" });
    }
    let mut scratch = vec![0; rgb.len() / 3 * n_channels];
    decoder.read_image(&mut scratch).map_err(|error| damaged(format, &error))?;
    for (pixel, from) in rgb.chunks_exact_mut(3).zip(scratch.chunks_exact(n_channels)) {
        match *from {
            [grey] | [grey, _] => pixel.fill(grey),
            [r, g, b, ..] => pixel.copy_from_slice(&[r, g, b]),
            [] => {}
        }
    }
    Ok(())
}

fn png(bytes: &[u8]) -> Result<PngDecoder<Cursor<&[u8]>>, ImageError> {
    PngDecoder::with_limits(Cursor::new(bytes), Limits::default()).map_err(|error| damaged("PNG", &error))
}

fn is_png(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x89PNG\r\n\x1a\n")
}

fn first_bytes(bytes: &[u8]) -> String {
    match bytes {
        [] => "nothing (0 bytes)".to_owned(),
        _ => format!("'{}'", bytes[..bytes.len().min(8)].escape_ascii()),
    }
}

fn pixels(color_type: ColorType) -> String {
    let n_channels = color_type.channel_count();
    let plural = if n_channels == 1 { "" } else { "s" };
    format!("{n_channels} channel{plural} of {} bits", color_type.bits_per_pixel() / u16::from(n_channels))
}

fn check_size(what: &'static str, found: (u32, u32), expected: (u32, u32)) -> Result<(), ImageError> {
    if found == expected { Ok(()) } else { Err(ImageError::Size { what, found, expected }) }
}

fn damaged(format: &'static str, error: &image::ImageError) -> ImageError {
    ImageError::Damaged { format, message: error.to_string() }
}
