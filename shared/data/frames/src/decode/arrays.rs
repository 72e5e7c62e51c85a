//! Depth as an array of numpy: integers in the camera's units, floats in metres.

use super::{MetresDepth, check_size, damaged};
use crate::ImageError;

const NPY: &[u8] = b"\x93NUMPY";
/// Longest header.
const MOST_HEADER: usize = 4096;

/// Whether these bytes begin one.
pub(super) fn is(bytes: &[u8]) -> bool {
    bytes.starts_with(NPY)
}

/// The pixels of a file.
struct ArrayPixels<'a> {
    size: (u32, u32),
    kind: ArrayKind,
    data: &'a [u8],
}

#[derive(Clone, Copy)]
enum ArrayKind {
    /// 16 bits without a sign.
    Whole { is_big_endian: bool },
    /// Bits of a float in metres.
    Metres { n_bytes: usize, is_big_endian: bool },
}

impl ArrayKind {
    fn n_bytes(self) -> usize {
        match self {
            Self::Whole { .. } => 2,
            Self::Metres { n_bytes, .. } => n_bytes,
        }
    }
}

fn open(bytes: &[u8]) -> Result<ArrayPixels<'_>, ImageError> {
    let pixels = npy(bytes)?;
    let n_pixels = (pixels.size.0 as usize).saturating_mul(pixels.size.1 as usize);
    let expected = n_pixels.saturating_mul(pixels.kind.n_bytes());
    if pixels.data.len() < expected {
        return Err(damaged("NPY", &format!("{} bytes of pixels, expected {expected}", pixels.data.len())));
    }
    Ok(pixels)
}

pub(super) fn size(bytes: &[u8]) -> Result<(u32, u32), ImageError> {
    Ok(open(bytes)?.size)
}

/// Decodes raw depth; metres are counted in `units_per_metre`.
pub(super) fn depth(
    bytes: &[u8],
    size: (u32, u32),
    units_per_metre: f64,
    depth_raw: &mut [u16],
) -> Result<(), ImageError> {
    let pixels = open(bytes)?;
    check_size("depth", pixels.size, size)?;
    let values = pixels.data.chunks_exact(pixels.kind.n_bytes());
    let mut counted = MetresDepth::new(units_per_metre);
    for (raw, bytes) in depth_raw.iter_mut().zip(values) {
        *raw = match pixels.kind {
            ArrayKind::Whole { is_big_endian } => match (bytes.first_chunk(), is_big_endian) {
                (Some(raw), true) => u16::from_be_bytes(*raw),
                (Some(raw), false) => u16::from_le_bytes(*raw),
                (None, _) => 0,
            },
            ArrayKind::Metres { is_big_endian, .. } => counted.raw(metres(bytes, is_big_endian)),
        };
    }
    counted.check()
}

fn metres(bytes: &[u8], is_big_endian: bool) -> f64 {
    match (bytes.first_chunk::<8>(), bytes.first_chunk::<4>(), is_big_endian) {
        (Some(value), _, true) => f64::from_be_bytes(*value),
        (Some(value), _, false) => f64::from_le_bytes(*value),
        (None, Some(value), true) => f64::from(f32::from_be_bytes(*value)),
        (None, Some(value), false) => f64::from(f32::from_le_bytes(*value)),
        (None, None, _) => f64::NAN,
    }
}

/// A version, the length of the header, and a dictionary of Python: `descr`, `fortran_order`, `shape`.
fn npy(bytes: &[u8]) -> Result<ArrayPixels<'_>, ImageError> {
    let wrong = |found: &str| damaged("NPY", &format!("its head has {found}"));
    let version = *bytes.get(6).ok_or_else(|| wrong("no version"))?;
    let length = bytes.get(8..).and_then(<[u8]>::first_chunk::<4>).ok_or_else(|| wrong("no length"))?;
    let (begin, n) = match (version, *length) {
        (1, [low, high, ..]) => (10_usize, usize::from(u16::from_le_bytes([low, high]))),
        (_, length) => (12, u32::from_le_bytes(length) as usize),
    };
    let head = bytes.get(begin..begin.saturating_add(n.min(MOST_HEADER))).ok_or_else(|| wrong("no end"))?;
    let head = String::from_utf8_lossy(head);
    let value =
        |key: &str| head.split_once(key).map(|(_, rest)| rest.trim_start_matches([' ', ':', '\'', '"']));
    let descr = value("'descr'").and_then(|rest| rest.split(['\'', '"']).next()).unwrap_or_default();
    let shape = value("'shape'").and_then(|rest| rest.split_once(')')).map_or("", |(shape, _)| shape);
    let sides: Vec<u32> = shape.split(['(', ',', ' ']).filter_map(|side| side.parse().ok()).collect();
    let [height, width] = sides[..] else {
        return Err(wrong(&format!("the shape {shape}), expected (rows, columns)")));
    };
    if value("'fortran_order'").is_some_and(|rest| rest.starts_with("True")) {
        return Err(wrong("columns first, expected rows: numpy.ascontiguousarray"));
    }
    let is_big_endian = descr.starts_with('>');
    let kind = match descr.trim_start_matches(['<', '>', '|', '=']) {
        "u2" => ArrayKind::Whole { is_big_endian },
        "f4" => ArrayKind::Metres { n_bytes: 4, is_big_endian },
        "f8" => ArrayKind::Metres { n_bytes: 8, is_big_endian },
        other => {
            let found = format!("values of type '{other}'");
            return Err(ImageError::Pixels {
                what: "depth",
                found,
                expected: "u2 in the camera's units, or f4 or f8 in metres",
            });
        }
    };
    Ok(ArrayPixels {
        size: (width, height),
        kind,
        data: bytes.get(begin.saturating_add(n)..).unwrap_or_default(),
    })
}

#[cfg(test)]
mod tests {
    use super::super::{depth_in, inspect_bytes, size};

    fn npy(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let head = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
        [b"\x93NUMPY\x01\x00", &(head.len() as u16).to_le_bytes()[..], head.as_bytes(), data].concat()
    }

    fn read(bytes: &[u8]) -> Result<[u16; 6], String> {
        let mut raw = [9; 6];
        depth_in(bytes, (3, 2), 1000.0, &mut raw).map(|()| raw).map_err(|error| error.to_string())
    }

    #[test]
    fn arrays_of_numpy_are_metres_or_units() {
        let metres = [1.5_f32, 0.25, f32::NAN, -1.0, 70.0, 0.0004];
        let bytes: Vec<u8> = metres.iter().flat_map(|m| m.to_le_bytes()).collect();
        let array = npy("<f4", "(2, 3)", &bytes);
        assert_eq!(read(&array), Ok([1500, 250, 0, 0, 0, 0]));
        assert_eq!(size(&array).unwrap(), (3, 2));
        inspect_bytes(&array).unwrap();
        let bytes: Vec<u8> = metres.iter().flat_map(|m| f64::from(*m).to_be_bytes()).collect();
        assert_eq!(read(&npy(">f8", "(2, 3)", &bytes)), Ok([1500, 250, 0, 0, 0, 0]));
        let whole: Vec<u8> = (1..7_u16).flat_map(|raw| (raw * 300).to_le_bytes()).collect();
        assert_eq!(read(&npy("<u2", "(2, 3)", &whole)), Ok([300, 600, 900, 1200, 1500, 1800]));
        for (array, expected) in [
            (npy("<u2", "(3, 2)", &whole), "2x3 px, expected 3x2"),
            (npy("<u2", "(2, 3, 1)", &whole), "the shape (2, 3, 1), expected (rows, columns)"),
            (npy("<i4", "(2, 3)", &whole), "values of type 'i4', expected u2"),
            (npy("<f8", "(2, 3)", &whole), "12 bytes of pixels, expected 48"),
        ] {
            let found = read(&array).unwrap_err();
            assert!(found.contains(expected), "'{found}' lacks '{expected}'");
        }
        for end in 0..array.len() {
            assert!(read(&array[..end]).is_err(), "cut at {end}");
        }
    }
}
