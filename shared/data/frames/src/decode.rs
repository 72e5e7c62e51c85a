//! Images into the caller's memory: PNG for depth, PNG or JPEG for colour.

use crate::ImageError;
use std::fmt::Display;
use std::io::Cursor;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Memory that a PNG's own chunks may take, bytes.
const MOST_BYTES: usize = 512 << 20;

/// Decodes a 16-bit greyscale PNG of the given columns and rows.
pub fn depth(bytes: &[u8], size: (u32, u32), depth_raw: &mut [u16]) -> Result<(), ImageError> {
    if !is_png(bytes) {
        return Err(ImageError::Format { found: first_bytes(bytes), or_jpeg: "" });
    }
    let mut png = Png::open(bytes)?;
    check_size("depth", png.reader.info().size(), size)?;
    if (png.n_channels, png.n_bits) != (1, 16) {
        let found = pixels(png.n_channels, png.n_bits);
        return Err(ImageError::Pixels { what: "depth", found, expected: "1 channel of 16 bits" });
    }
    png.read(bytemuck::cast_slice_mut(depth_raw))?;
    for raw in depth_raw {
        *raw = u16::from_be(*raw);
    }
    Ok(())
}

/// Decodes a colour or grey PNG or JPEG of 8 bits as red, green, blue.
pub fn colour(bytes: &[u8], size: (u32, u32), rgb: &mut [u8]) -> Result<(), ImageError> {
    if is_png(bytes) {
        let mut png = Png::open(bytes)?;
        check_size("colour", png.reader.info().size(), size)?;
        if png.n_bits != 8 {
            let found = pixels(png.n_channels, png.n_bits);
            return Err(ImageError::Pixels { what: "colour", found, expected: "1 to 4 channels of 8 bits" });
        }
        return read_rgb(png.n_channels, rgb, |to| png.read(to));
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
    jpeg(bytes, size, rgb)
}

fn jpeg(bytes: &[u8], size: (u32, u32), rgb: &mut [u8]) -> Result<(), ImageError> {
    let damaged = |error: &dyn Display| damaged("JPEG", error);
    let options = DecoderOptions::default().set_strict_mode(false);
    let options = options.set_max_width(usize::MAX).set_max_height(usize::MAX);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|error| damaged(&error))?;
    let (Some((columns, rows)), Some(from)) = (decoder.dimensions(), decoder.input_colorspace()) else {
        return Err(damaged(&"no size"));
    };
    check_size("colour", (columns as u32, rows as u32), size)?;
    let (to, n_channels) =
        if from == ColorSpace::Luma { (ColorSpace::Luma, 1) } else { (ColorSpace::RGB, 3) };
    decoder.set_options(decoder.options().jpeg_set_out_colorspace(to));
    read_rgb(n_channels, rgb, |to| decoder.decode_into(to).map_err(|error| damaged(&error)))
}

/// Pixels of 8 bits a channel as red, green, blue.
fn read_rgb(
    n_channels: usize,
    rgb: &mut [u8],
    read: impl FnOnce(&mut [u8]) -> Result<(), ImageError>,
) -> Result<(), ImageError> {
    if n_channels == 3 {
        return read(rgb);
    }
    let mut scratch = vec![0; rgb.len() / 3 * n_channels];
    read(&mut scratch)?;
    for (pixel, from) in rgb.chunks_exact_mut(3).zip(scratch.chunks_exact(n_channels)) {
        match *from {
            [grey] | [grey, _] => pixel.fill(grey),
            [r, g, b, ..] => pixel.copy_from_slice(&[r, g, b]),
            [] => {}
        }
    }
    Ok(())
}

/// A PNG whose head has been read; palettes and fewer bits come as 8 bits a channel.
struct Png<'a> {
    reader: png::Reader<Cursor<&'a [u8]>>,
    n_channels: usize,
    n_bits: usize,
}

impl<'a> Png<'a> {
    fn open(bytes: &'a [u8]) -> Result<Self, ImageError> {
        let limits = png::Limits { bytes: MOST_BYTES };
        let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
        decoder.set_transformations(png::Transformations::EXPAND);
        let reader = decoder.read_info().map_err(|error| damaged("PNG", &error))?;
        let (color, depth) = reader.output_color_type();
        Ok(Self { reader, n_channels: color.samples(), n_bits: depth as usize })
    }

    /// Bytes of 16-bit pixels come highest first.
    fn read(&mut self, to: &mut [u8]) -> Result<(), ImageError> {
        self.reader.next_frame(to).map(|_| ()).map_err(|error| damaged("PNG", &error))
    }
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

fn pixels(n_channels: usize, n_bits: usize) -> String {
    let plural = if n_channels == 1 { "" } else { "s" };
    format!("{n_channels} channel{plural} of {n_bits} bits")
}

fn check_size(what: &'static str, found: (u32, u32), expected: (u32, u32)) -> Result<(), ImageError> {
    if found == expected { Ok(()) } else { Err(ImageError::Size { what, found, expected }) }
}

fn damaged(format: &'static str, error: &dyn Display) -> ImageError {
    ImageError::Damaged { format, message: error.to_string() }
}
