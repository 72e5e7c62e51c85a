//! Depth as OpenEXR: one part of scan lines, halves or floats in metres, not compressed or by RLE or
//! zlib.

use super::{MetresDepth, check_size, damaged};
use crate::ImageError;
use flate2::read::ZlibDecoder;
use std::io::Read;

const MARK: &[u8] = b"\x76\x2f\x31\x01";
/// What no reader of one part of scan lines reads: tiles, deep pixels, several parts.
const FLAGS: [(u32, &str); 3] = [(0x200, "tiles"), (0x800, "deep pixels"), (0x1000, "several parts")];
/// Names of the compressions that are not read.
const OTHERS: [&str; 6] = ["PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB"];
/// Bytes that the pixels of a file may take.
const MOST_BYTES: usize = 512 << 20;
const EXPECTED: &str = "one part of scan lines of halves or floats, not compressed or by RLE, ZIPS or ZIP (oiiotool IN.exr --compression zip -o OUT.exr)";

/// Whether these bytes begin an OpenEXR image.
pub(super) fn is(bytes: &[u8]) -> bool {
    bytes.starts_with(MARK)
}

/// A file's head.
struct ExrHead<'a> {
    size: (usize, usize),
    /// First row, as chunks count them.
    top: i64,
    /// Number of the compression: 0 none, 1 RLE, 2 and 3 zlib.
    compression: u8,
    channels: Vec<ExrChannel<'a>>,
    /// The table of chunks and what follows.
    rest: &'a [u8],
}

#[derive(Clone, Copy)]
struct ExrChannel<'a> {
    name: &'a str,
    is_half: bool,
    /// Bytes of a row before its own.
    begin: usize,
}

impl ExrChannel<'_> {
    fn n_bytes(self) -> usize {
        if self.is_half { 2 } else { 4 }
    }
}

fn wrong(found: impl Into<String>) -> ImageError {
    ImageError::Pixels { what: "OpenEXR", found: found.into(), expected: EXPECTED }
}

fn cut() -> ImageError {
    damaged("OpenEXR", &"it ends too early")
}

/// The next `n` bytes.
fn take<'a>(bytes: &mut &'a [u8], n: usize) -> Result<&'a [u8], ImageError> {
    let (head, rest) = bytes.split_at_checked(n).ok_or_else(cut)?;
    *bytes = rest;
    Ok(head)
}

fn number(bytes: &mut &[u8]) -> Result<u32, ImageError> {
    let bytes = take(bytes, 4)?;
    Ok(bytes.iter().rev().fold(0, |value, byte| (value << 8) | u32::from(*byte)))
}

/// A text that ends with a zero.
fn text<'a>(bytes: &mut &'a [u8]) -> Result<&'a str, ImageError> {
    let n = bytes.iter().position(|byte| *byte == 0).ok_or_else(cut)?;
    let text = take(bytes, n)?;
    take(bytes, 1)?;
    std::str::from_utf8(text).map_err(|_| damaged("OpenEXR", &"a name is not text"))
}

fn head(bytes: &[u8]) -> Result<ExrHead<'_>, ImageError> {
    let mut rest = bytes.get(MARK.len()..).unwrap_or_default();
    let version = number(&mut rest)?;
    if let Some((_, what)) = FLAGS.iter().find(|(flag, _)| version & flag != 0) {
        return Err(wrong(*what));
    }
    let (mut channels, mut window, mut whole, mut compression) = (None, None, None, None);
    loop {
        let name = text(&mut rest)?;
        if name.is_empty() {
            break;
        }
        text(&mut rest)?;
        let n = number(&mut rest)? as usize;
        let mut value = take(&mut rest, n)?;
        match name {
            "channels" => channels = Some(channels_of(value)?),
            "dataWindow" => window = Some(window_of(&mut value)?),
            "displayWindow" => whole = Some(window_of(&mut value)?),
            "compression" => compression = value.first().copied(),
            _ => {}
        }
    }
    let (Some(channels), Some(window), Some(compression)) = (channels, window, compression) else {
        return Err(damaged("OpenEXR", &"no channels, dataWindow or compression"));
    };
    if let Some(other) = usize::from(compression).checked_sub(4) {
        return Err(wrong(format!("compression {}", OTHERS.get(other).copied().unwrap_or("unknown"))));
    }
    if whole.is_some_and(|whole| whole != window) {
        return Err(wrong("pixels of a part of the image alone (dataWindow is not displayWindow)"));
    }
    let [left, top, right, bottom] = window;
    let side = |from: i64, to: i64| usize::try_from(to.saturating_sub(from).saturating_add(1)).ok();
    let size = side(left, right).zip(side(top, bottom)).filter(|size| size.0 > 0 && size.1 > 0);
    let size = size.ok_or_else(|| damaged("OpenEXR", &format!("a window of {window:?}")))?;
    Ok(ExrHead { size, top, compression, channels, rest })
}

fn window_of(value: &mut &[u8]) -> Result<[i64; 4], ImageError> {
    let mut side = || Ok::<_, ImageError>(i64::from(number(value)?.cast_signed()));
    Ok([side()?, side()?, side()?, side()?])
}

/// The channels in the order of their pixels; `begin` counts bytes of one pixel of each before it.
fn channels_of(mut value: &[u8]) -> Result<Vec<ExrChannel<'_>>, ImageError> {
    let (mut channels, mut begin) = (Vec::new(), 0_usize);
    loop {
        let name = text(&mut value)?;
        if name.is_empty() {
            return Ok(channels);
        }
        let kind = number(&mut value)?;
        take(&mut value, 4)?;
        if (number(&mut value)?, number(&mut value)?) != (1, 1) {
            return Err(wrong(format!("channel {name} of fewer pixels than the image")));
        }
        let channel = ExrChannel { name, is_half: kind == 1, begin };
        if !(1..=2).contains(&kind) {
            return Err(wrong(format!("channel {name} of whole numbers")));
        }
        begin = begin.saturating_add(channel.n_bytes());
        channels.push(channel);
    }
}

/// The channels that hold depth: one, or red, green and blue that must be the same.
fn depth_channels<'a>(channels: &[ExrChannel<'a>]) -> Result<Vec<ExrChannel<'a>>, ImageError> {
    let last = |channel: &ExrChannel<'_>| channel.name.rsplit('.').next().unwrap_or_default().to_lowercase();
    let one_of = |is: &dyn Fn(&ExrChannel<'a>) -> bool| channels.iter().find(|channel| is(channel)).copied();
    let depth = one_of(&|channel| channel.name == "Z")
        .or_else(|| {
            one_of(&|channel| last(channel) == "z" && !channel.name.to_lowercase().contains("normal"))
        })
        .or_else(|| one_of(&|channel| channel.name.to_lowercase().contains("depth") && last(channel) != "a"))
        .or_else(|| channels.first().copied().filter(|_| channels.len() == 1))
        .or_else(|| one_of(&|channel| ["y", "v"].contains(&last(channel).as_str())));
    if let Some(depth) = depth {
        return Ok(vec![depth]);
    }
    let grey: Vec<_> = ["R", "G", "B"].iter().filter_map(|name| one_of(&|c| c.name == *name)).collect();
    match grey.len() {
        3 => Ok(grey),
        _ => {
            let names: Vec<&str> = channels.iter().map(|channel| channel.name).collect();
            let found = format!("channels {}", names.join(", "));
            Err(ImageError::Pixels {
                what: "depth",
                found,
                expected: "a channel Z of depth, or one channel alone",
            })
        }
    }
}

/// Columns and rows, from the head.
pub(super) fn size(bytes: &[u8]) -> Result<(u32, u32), ImageError> {
    let (width, height) = head(bytes)?.size;
    let sides = u32::try_from(width).ok().zip(u32::try_from(height).ok());
    sides.ok_or_else(|| damaged("OpenEXR", &format!("a size of {width}x{height}")))
}

/// Decodes depth in metres.
pub(super) fn depth(
    bytes: &[u8],
    size: (u32, u32),
    units_per_metre: f64,
    depth_raw: &mut [u16],
) -> Result<(), ImageError> {
    check_size("depth", self::size(bytes)?, size)?;
    let head = head(bytes)?;
    let channels = depth_channels(&head.channels)?;
    let (width, height) = head.size;
    let n_pixel = head.channels.last().map_or(0, |last| last.begin.saturating_add(last.n_bytes()));
    let n_row = width.saturating_mul(n_pixel);
    if n_row.saturating_mul(height) > MOST_BYTES {
        return Err(damaged("OpenEXR", &format!("{n_row} bytes in each of {height} rows")));
    }
    let n_rows_of_chunk = if head.compression == 3 { 16 } else { 1 };
    let n_chunks = height.div_ceil(n_rows_of_chunk);
    let mut rows: Vec<Option<Vec<u8>>> = Vec::new();
    rows.resize(n_chunks, None);
    let mut offsets = head.rest;
    for _ in 0..n_chunks {
        let offset = u64::from(number(&mut offsets)?) | (u64::from(number(&mut offsets)?) << 32);
        let mut chunk = usize::try_from(offset).ok().and_then(|at| bytes.get(at..)).ok_or_else(cut)?;
        let row = i64::from(number(&mut chunk)?.cast_signed()).saturating_sub(head.top);
        let n = number(&mut chunk)? as usize;
        let row =
            usize::try_from(row).ok().filter(|row| row.is_multiple_of(n_rows_of_chunk) && *row < height);
        let row = row.ok_or_else(|| damaged("OpenEXR", &"a chunk of no row"))?;
        let n_expected = n_row.saturating_mul(n_rows_of_chunk.min(height.saturating_sub(row)));
        let pixels = unpacked(take(&mut chunk, n)?, n_expected, head.compression)?;
        if let Some(place) = rows.get_mut(row.checked_div(n_rows_of_chunk).unwrap_or_default()) {
            *place = Some(pixels);
        }
    }
    let mut raw = depth_raw.chunks_exact_mut(width);
    let mut counted = MetresDepth::new(units_per_metre);
    for chunk in rows {
        let chunk = chunk.ok_or_else(|| damaged("OpenEXR", &"rows are missing"))?;
        for (row, raw) in chunk.chunks_exact(n_row).zip(&mut raw) {
            fill(row, width, &channels, |metres| counted.raw(metres), raw)?;
        }
    }
    counted.check()
}

/// A row of the image.
fn fill(
    row: &[u8],
    width: usize,
    channels: &[ExrChannel<'_>],
    mut raw_of: impl FnMut(f64) -> u16,
    raw: &mut [u16],
) -> Result<(), ImageError> {
    for (at, channel) in channels.iter().enumerate() {
        let values = row.get(channel.begin.saturating_mul(width)..).unwrap_or_default();
        for (raw, value) in raw.iter_mut().zip(values.chunks_exact(channel.n_bytes())) {
            let found = raw_of(match *value {
                [a, b] => half(u16::from_le_bytes([a, b])),
                [a, b, c, d] => f64::from(f32::from_le_bytes([a, b, c, d])),
                _ => f64::NAN,
            });
            if at > 0 && found != *raw {
                let found = "channels R, G, B that differ".to_owned();
                return Err(ImageError::Pixels { what: "depth", found, expected: "a channel Z of depth" });
            }
            *raw = found;
        }
    }
    Ok(())
}

/// A half as a float.
fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from((bits >> 10) & 31), f64::from(bits & 0x3ff) / 1024.0);
    let value = match exponent {
        0 => fraction * 2.0_f64.powi(-14),
        31 => f64::NAN,
        _ => (1.0 + fraction) * 2.0_f64.powi(exponent.saturating_sub(15)),
    };
    if bits >> 15 == 1 { -value } else { value }
}

/// The pixels of a chunk; one that would not get smaller is stored as it is.
fn unpacked(packed: &[u8], n_expected: usize, compression: u8) -> Result<Vec<u8>, ImageError> {
    let bytes = match compression {
        _ if packed.len() == n_expected => return Ok(packed.to_vec()),
        0 => return Err(cut()),
        1 => runs(packed, n_expected)?,
        _ => {
            let mut bytes = Vec::new();
            let most = (n_expected as u64).saturating_add(1);
            let read = ZlibDecoder::new(packed).take(most).read_to_end(&mut bytes);
            read.map_err(|error| damaged("OpenEXR", &error))?;
            bytes
        }
    };
    if bytes.len() != n_expected {
        return Err(damaged("OpenEXR", &format!("{} bytes of pixels, expected {n_expected}", bytes.len())));
    }
    // Differences to the byte before, first those of even places, then those of odd ones.
    let mut before = 0_u8;
    let whole = bytes.iter().enumerate().map(|(at, byte)| {
        before = if at == 0 { *byte } else { before.wrapping_add(*byte).wrapping_sub(128) };
        before
    });
    let whole: Vec<u8> = whole.collect();
    let (even, odd) = whole.split_at(whole.len().div_ceil(2));
    let mut pixels = vec![0; whole.len()];
    for (pair, at) in pixels.chunks_mut(2).zip(0..) {
        let both = [even.get(at), odd.get(at)];
        pair.iter_mut().zip(both).for_each(|(to, from)| *to = from.copied().unwrap_or_default());
    }
    Ok(pixels)
}

/// Runs of one byte, and bytes as they are.
fn runs(mut packed: &[u8], n_expected: usize) -> Result<Vec<u8>, ImageError> {
    let mut bytes = Vec::new();
    while let Some((count, rest)) = packed.split_first().filter(|_| bytes.len() <= n_expected) {
        packed = rest;
        let count = count.cast_signed();
        match count < 0 {
            true => bytes.extend(take(&mut packed, usize::from(count.unsigned_abs()))?),
            false => {
                let byte = take(&mut packed, 1)?.first().copied().unwrap_or_default();
                bytes.resize(
                    bytes.len().saturating_add(usize::from(count.unsigned_abs())).saturating_add(1),
                    byte,
                );
            }
        }
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests;
