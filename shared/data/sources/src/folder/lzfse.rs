//! Images compressed by LZFSE, as Record3D writes them: depth as 32-bit floats in metres, confidence
//! as bytes, row by row, little endian.

use crate::ImageError;
use lzfse_rust::LzfseRingDecoder;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;
use tessera_frames::decode::MetresDepth;

/// First bytes of each block; the fourth says which kind.
const BLOCK: &[u8] = b"bvx";
/// The last block.
const END: &[u8] = b"bvx$";
const METRES_BYTES: usize = size_of::<f32>();

/// Depth in metres as raw depth; 0 where it is not finite, not positive or too far for 16 bits.
///
/// # Errors
/// The stream is damaged, or is not that of `size` columns and rows.
pub(super) fn depth(
    bytes: &[u8],
    size: (u32, u32),
    units_per_metre: f64,
    depth_raw: &mut [u16],
) -> Result<(), ImageError> {
    let metres = decompress("depth", bytes, size, METRES_BYTES)?;
    let mut counted = MetresDepth::new(units_per_metre);
    for (raw, value) in depth_raw.iter_mut().zip(metres.as_chunks::<METRES_BYTES>().0) {
        *raw = counted.raw(f64::from(f32::from_le_bytes(*value)));
    }
    counted.check()
}

/// Confidence of each pixel, three times over: 0 low, 1 medium, 2 high.
///
/// # Errors
/// As of [`depth`].
pub(super) fn confidence(bytes: &[u8], size: (u32, u32), rgb: &mut [u8]) -> Result<(), ImageError> {
    let confidence = decompress("confidence", bytes, size, 1)?;
    for (pixel, value) in rgb.chunks_exact_mut(3).zip(confidence) {
        pixel.fill(value);
    }
    Ok(())
}

/// Number of pixels of a depth image of at most `most_pixels`; `None`: it has more.
///
/// # Errors
/// The stream is damaged.
pub(super) fn n_pixels(bytes: &[u8], most_pixels: usize) -> Result<Option<usize>, ImageError> {
    let n = decode(bytes, most_pixels.saturating_mul(METRES_BYTES))?.len() / METRES_BYTES;
    Ok((n <= most_pixels).then_some(n))
}

/// Looks at the first and last bytes of a file: a whole stream begins and ends with its marks.
///
/// # Errors
/// The file cannot be read, is no stream, or is cut short.
pub(super) fn inspect(path: &Path) -> Result<(), ImageError> {
    let mut file = File::open(path).map_err(ImageError::Io)?;
    let mut head = Vec::new();
    file.by_ref().take(END.len() as u64).read_to_end(&mut head).map_err(ImageError::Io)?;
    check_head(&head)?;
    let n_bytes = file.metadata().map_err(ImageError::Io)?.len();
    let mut tail = Vec::new();
    file.seek(SeekFrom::Start(n_bytes.saturating_sub(END.len() as u64))).map_err(ImageError::Io)?;
    file.read_to_end(&mut tail).map_err(ImageError::Io)?;
    check_end(&tail, n_bytes)
}

/// As [`inspect`], of a stream in memory.
///
/// # Errors
/// It is no stream, or is cut short.
pub(super) fn inspect_bytes(bytes: &[u8]) -> Result<(), ImageError> {
    check_head(bytes)?;
    check_end(bytes, bytes.len() as u64)
}

fn check_end(bytes: &[u8], n_bytes: u64) -> Result<(), ImageError> {
    match bytes.ends_with(END) {
        true => Ok(()),
        false => Err(damaged(format!("no end marker in {n_bytes} bytes"))),
    }
}

/// Decompresses an image of a known size and never more than that.
fn decompress(
    what: &'static str,
    bytes: &[u8],
    size: (u32, u32),
    pixel_bytes: usize,
) -> Result<Vec<u8>, ImageError> {
    let n_pixels = (size.0 as usize).saturating_mul(size.1 as usize);
    let expected = n_pixels.saturating_mul(pixel_bytes);
    let image = decode(bytes, expected)?;
    let found = match image.len() {
        n if n == expected => return Ok(image),
        n if n > expected => format!("more than {expected}"),
        n => n.to_string(),
    };
    Err(ImageError::Length { what, found, expected, size })
}

/// Decompresses, and stops one byte beyond `most_bytes`.
fn decode(bytes: &[u8], most_bytes: usize) -> Result<Vec<u8>, ImageError> {
    check_head(bytes)?;
    let mut decoder = LzfseRingDecoder::default();
    let mut image = Vec::new();
    let limit = (most_bytes as u64).saturating_add(1);
    let read = decoder.reader_bytes(bytes).take(limit).read_to_end(&mut image);
    read.map_err(|error| damaged(format!("{error} in {} bytes", bytes.len())))?;
    Ok(image)
}

fn check_head(bytes: &[u8]) -> Result<(), ImageError> {
    if bytes.starts_with(BLOCK) {
        return Ok(());
    }
    let head = bytes.get(..END.len()).unwrap_or(bytes);
    Err(damaged(format!("it begins with '{}'", head.escape_ascii())))
}

fn damaged(message: String) -> ImageError {
    ImageError::Damaged { format: "LZFSE stream (bvx...bvx$)", message }
}
