//! Images into the caller's memory: PNG, TIFF, PGM, NPY or OpenEXR for depth, PNG, JPEG, WebP, BMP, TIFF
//! or PPM for colour.

mod arrays;
mod bmp;
mod exr;
mod metres;
mod netpbm;
mod tif;
mod webp;

use crate::ImageError;
pub use metres::MetresDepth;
use std::fmt::Display;
use std::fs::File;
use std::io::{Cursor, Read, Seek, SeekFrom};
use std::path::Path;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Memory that a PNG's own chunks may take, bytes.
const MOST_BYTES: usize = 512 << 20;
/// The forms that are read, for people.
const DEPTH_FORMS: &str = "a PNG, TIFF, PGM, NPY or OpenEXR of depth";
const COLOUR_FORMS: &str = "a PNG, JPEG, WebP, BMP, TIFF, PPM or PGM";
const JPEG: &[u8] = &[0xff, 0xd8];
const JPEG_END: &[u8] = &[0xff, 0xd9];
/// Bytes at the end of a file that hold its end marker.
const TAIL_BYTES: u64 = 1024;

/// Decodes depth of any form that is read: PNG, TIFF, PGM, NPY or OpenEXR; metres are counted in `units_per_metre`.
pub fn depth_in(
    bytes: &[u8],
    size: (u32, u32),
    units_per_metre: f64,
    depth_raw: &mut [u16],
) -> Result<(), ImageError> {
    if arrays::is(bytes) {
        return arrays::depth(bytes, size, units_per_metre, depth_raw);
    }
    if netpbm::is(bytes) {
        return netpbm::depth(bytes, size, depth_raw);
    }
    if tif::is(bytes) {
        return tif::depth(bytes, size, units_per_metre, depth_raw);
    }
    if exr::is(bytes) {
        return exr::depth(bytes, size, units_per_metre, depth_raw);
    }
    depth(bytes, size, depth_raw)
}

/// What is expected where depth was painted.
const NO_PICTURE: &str = "1 channel of 16 bits; a picture of depth does not hold its values, so export these";

/// Decodes a 16-bit greyscale PNG of the given columns and rows.
pub fn depth(bytes: &[u8], size: (u32, u32), depth_raw: &mut [u16]) -> Result<(), ImageError> {
    if !is_png(bytes) {
        return Err(ImageError::Format { found: kind_of(bytes), expected: DEPTH_FORMS });
    }
    let mut png = Png::open(bytes)?;
    check_size("depth", png.reader.info().size(), size)?;
    if (png.n_channels, png.n_bits) != (1, 16) {
        let found = pixels(png.n_channels, png.n_bits);
        let expected = if png.n_bits < 16 { NO_PICTURE } else { "1 channel of 16 bits" };
        return Err(ImageError::Pixels { what: "depth", found, expected });
    }
    png.read(bytemuck::cast_slice_mut(depth_raw))?;
    for raw in depth_raw {
        *raw = u16::from_be(*raw);
    }
    Ok(())
}

/// Columns and rows of a PNG or JPEG, from its head.
///
/// # Errors
/// It is neither, or its head is damaged.
pub fn size(bytes: &[u8]) -> Result<(u32, u32), ImageError> {
    if is_png(bytes) {
        return Ok(Png::open(bytes)?.reader.info().size());
    }
    if bmp::is(bytes) {
        return bmp::size(bytes);
    }
    if webp::is(bytes) {
        return webp::size(bytes);
    }
    if arrays::is(bytes) {
        return arrays::size(bytes);
    }
    if netpbm::is(bytes) {
        return netpbm::size(bytes);
    }
    if tif::is(bytes) {
        return tif::size(bytes);
    }
    if exr::is(bytes) {
        return exr::size(bytes);
    }
    if !bytes.starts_with(JPEG) {
        return Err(ImageError::Format { found: kind_of(bytes), expected: COLOUR_FORMS });
    }
    let mut decoder = JpegDecoder::new(ZCursor::new(bytes));
    decoder.decode_headers().map_err(|error| damaged("JPEG", &error))?;
    let (columns, rows) = decoder.dimensions().ok_or_else(|| damaged("JPEG", &"no size"))?;
    jpeg_size(columns, rows)
}

/// Whether a file is a PNG of one channel of 16 bits, as depth is.
pub fn is_deep_grey(bytes: &[u8]) -> bool {
    is_png(bytes) && Png::open(bytes).is_ok_and(|png| (png.n_channels, png.n_bits) == (1, 16))
}

/// Looks at the first and last bytes of an image file: a whole PNG or JPEG begins and ends with its
/// marks.
///
/// # Errors
/// The file cannot be read, is no image, or is cut short.
pub fn inspect(path: &Path) -> Result<(), ImageError> {
    let mut file = File::open(path).map_err(ImageError::Io)?;
    let n_bytes = file.metadata().map_err(ImageError::Io)?.len();
    let (mut head, mut tail) = (Vec::new(), Vec::new());
    file.by_ref().take(12).read_to_end(&mut head).map_err(ImageError::Io)?;
    file.seek(SeekFrom::Start(n_bytes.saturating_sub(TAIL_BYTES))).map_err(ImageError::Io)?;
    file.take(TAIL_BYTES).read_to_end(&mut tail).map_err(ImageError::Io)?;
    check_marks(&head, &tail, n_bytes)
}

/// As [`inspect`], of an image in memory.
///
/// # Errors
/// It is no image, or is cut short.
pub fn inspect_bytes(bytes: &[u8]) -> Result<(), ImageError> {
    check_marks(bytes, tail(bytes), bytes.len() as u64)
}

fn check_marks(head: &[u8], tail: &[u8], n_bytes: u64) -> Result<(), ImageError> {
    let (format, end): (_, &[u8]) = if is_png(head) {
        ("PNG", b"IEND")
    } else if head.starts_with(JPEG) {
        ("JPEG", JPEG_END)
    } else if webp::is(head) {
        return webp::check_length(head, n_bytes);
    } else if [bmp::is, arrays::is, netpbm::is, tif::is, exr::is].iter().any(|is| is(head)) {
        // These have no end marker; its length is checked as it is read.
        return Ok(());
    } else {
        return Err(ImageError::Format { found: kind_of(head), expected: COLOUR_FORMS });
    };
    match tail.windows(end.len()).any(|window| window == end) {
        true => Ok(()),
        false => Err(damaged(format, &format!("no end marker in {n_bytes} bytes"))),
    }
}

/// Decodes a colour or grey PNG, JPEG, WebP, BMP, TIFF, PPM or PGM as red, green, blue.
pub fn colour(bytes: &[u8], size: (u32, u32), rgb: &mut [u8]) -> Result<(), ImageError> {
    if is_png(bytes) {
        let mut png = Png::open(bytes)?;
        check_size("colour", png.reader.info().size(), size)?;
        if png.n_bits == 16 {
            return read_rgb(png.n_channels, rgb, |to| png.read_high_bytes(to));
        }
        return read_rgb(png.n_channels, rgb, |to| png.read(to));
    }
    if bmp::is(bytes) {
        return bmp::read(bytes, size, rgb);
    }
    if webp::is(bytes) {
        return webp::read(bytes, size, rgb);
    }
    if netpbm::is(bytes) {
        return netpbm::colour(bytes, size, rgb);
    }
    if tif::is(bytes) {
        return tif::colour(bytes, size, rgb);
    }
    if !bytes.starts_with(JPEG) {
        return Err(ImageError::Format { found: kind_of(bytes), expected: COLOUR_FORMS });
    }
    // The decoder paints what is missing of a cut file grey and calls it a success.
    if !tail(bytes).windows(2).any(|pair| pair == JPEG_END) {
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
    check_size("colour", jpeg_size(columns, rows)?, size)?;
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
    let mut scratch = vec![0; (rgb.len() / 3).saturating_mul(n_channels)];
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

    /// The higher byte of each channel of 16 bits.
    fn read_high_bytes(&mut self, to: &mut [u8]) -> Result<(), ImageError> {
        let mut both = vec![0; to.len().saturating_mul(2)];
        self.read(&mut both)?;
        to.iter_mut().zip(both.iter().step_by(2)).for_each(|(to, high)| *to = *high);
        Ok(())
    }

    /// Bytes of 16-bit pixels come highest first.
    fn read(&mut self, to: &mut [u8]) -> Result<(), ImageError> {
        self.reader.next_frame(to).map(|_| ()).map_err(|error| damaged("PNG", &error))
    }
}

/// The last bytes, where an image has its end marker.
fn tail(bytes: &[u8]) -> &[u8] {
    let n = usize::try_from(TAIL_BYTES).unwrap_or(usize::MAX);
    bytes.get(bytes.len().saturating_sub(n)..).unwrap_or_default()
}

fn jpeg_size(columns: usize, rows: usize) -> Result<(u32, u32), ImageError> {
    let sides = u32::try_from(columns).ok().zip(u32::try_from(rows).ok());
    sides.ok_or_else(|| damaged("JPEG", &format!("a size of {columns}x{rows}")))
}

fn is_png(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x89PNG\r\n\x1a\n")
}

/// What some bytes begin, for people: lists of depth and colour that were swapped are common, and so are
/// files that were never downloaded.
fn kind_of(bytes: &[u8]) -> String {
    const KINDS: [(&[u8], &str); 10] = [
        (JPEG, "a JPEG (is it a colour image?)"),
        (b"GIF8", "a GIF"),
        (b"P1", "a PBM of 1 bit"),
        (b"P4", "a PBM of 1 bit"),
        (b"P7", "a PAM (pamtopng of Netpbm converts it)"),
        (b"Pf", "a PFM of floats (as NPY: numpy.save of the array)"),
        (b"PF", "a PFM of floats (as NPY: numpy.save of the array)"),
        (b"version https://git-lfs", "a pointer of Git LFS instead of the image (git lfs pull fetches it)"),
        (b"<!DOCTYPE", "a web page"),
        (b"<html", "a web page"),
    ];
    match KINDS.iter().find(|(begins, _)| bytes.starts_with(begins)) {
        _ if bytes.is_empty() => "nothing (0 bytes)".to_owned(),
        Some((_, what)) => (*what).to_owned(),
        None => format!("a file that begins with '{}'", bytes.get(..8).unwrap_or(bytes).escape_ascii()),
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
