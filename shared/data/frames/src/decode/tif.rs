//! Depth as TIFF, 16 bits in the camera's units or floats in metres, and colour of 8 or 16 bits.

use super::{MetresDepth, check_size, damaged};
use crate::ImageError;
use std::io::Cursor;
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};

/// Both orders of bytes.
const MARKS: [&[u8]; 2] = [b"II*\0", b"MM\0*"];
/// Memory that a file may ask for, bytes.
const MOST_BYTES: usize = 512 << 20;

/// Whether these bytes begin a TIFF.
pub(super) fn is(bytes: &[u8]) -> bool {
    MARKS.iter().any(|mark| bytes.starts_with(mark))
}

fn open(bytes: &[u8]) -> Result<Decoder<Cursor<&[u8]>>, ImageError> {
    let mut limits = Limits::default();
    limits.decoding_buffer_size = MOST_BYTES;
    limits.intermediate_buffer_size = MOST_BYTES;
    let decoder = Decoder::new(Cursor::new(bytes)).map_err(|error| damaged("TIFF", &error))?;
    Ok(decoder.with_limits(limits))
}

/// Columns and rows, from the head.
pub(super) fn size(bytes: &[u8]) -> Result<(u32, u32), ImageError> {
    open(bytes)?.dimensions().map_err(|error| damaged("TIFF", &error))
}

/// Decodes raw depth; metres are counted in `units_per_metre`.
pub(super) fn depth(
    bytes: &[u8],
    size: (u32, u32),
    units_per_metre: f64,
    depth_raw: &mut [u16],
) -> Result<(), ImageError> {
    let mut decoder = open(bytes)?;
    check_size("depth", decoder.dimensions().map_err(|error| damaged("TIFF", &error))?, size)?;
    let kind = decoder.colortype().map_err(|error| damaged("TIFF", &error))?;
    let wrong = || ImageError::Pixels {
        what: "depth",
        found: format!("{kind:?}"),
        expected: "1 channel of 16 bits in the camera's units, or of floats in metres",
    };
    if kind.num_samples() != 1 {
        return Err(wrong());
    }
    let mut counted = MetresDepth::new(units_per_metre);
    match decoder.read_image().map_err(|error| damaged("TIFF", &error))? {
        DecodingResult::U16(values) => fill(depth_raw, &values, |raw| *raw),
        DecodingResult::F32(values) => fill(depth_raw, &values, |value| counted.raw(f64::from(*value))),
        DecodingResult::F64(values) => fill(depth_raw, &values, |value| counted.raw(*value)),
        _ => Err(wrong()),
    }?;
    counted.check()
}

/// Decodes colour or grey as red, green, blue; of 16 bits a channel the higher byte is taken.
pub(super) fn colour(bytes: &[u8], size: (u32, u32), rgb: &mut [u8]) -> Result<(), ImageError> {
    let mut decoder = open(bytes)?;
    check_size("colour", decoder.dimensions().map_err(|error| damaged("TIFF", &error))?, size)?;
    let kind = decoder.colortype().map_err(|error| damaged("TIFF", &error))?;
    let wrong = || ImageError::Pixels {
        what: "colour",
        found: format!("{kind:?}"),
        expected: "grey, RGB or RGBA of 8 or 16 bits a channel",
    };
    let n_channels = match kind {
        ColorType::Gray(_) | ColorType::GrayA(_) | ColorType::RGB(_) | ColorType::RGBA(_) => {
            usize::from(kind.num_samples())
        }
        _ => return Err(wrong()),
    };
    let values = match decoder.read_image().map_err(|error| damaged("TIFF", &error))? {
        DecodingResult::U8(values) => values,
        DecodingResult::U16(values) => values.iter().map(|value| value.to_be_bytes()[0]).collect(),
        _ => return Err(wrong()),
    };
    super::read_rgb(n_channels, rgb, |to| match values.get(..to.len()) {
        Some(values) => {
            to.copy_from_slice(values);
            Ok(())
        }
        None => Err(damaged("TIFF", &format!("{} values, expected {}", values.len(), to.len()))),
    })
}

fn fill<T>(depth_raw: &mut [u16], values: &[T], mut raw: impl FnMut(&T) -> u16) -> Result<(), ImageError> {
    if values.len() < depth_raw.len() {
        let message = format!("{} pixels, expected {}", values.len(), depth_raw.len());
        return Err(damaged("TIFF", &message));
    }
    depth_raw.iter_mut().zip(values).for_each(|(to, value)| *to = raw(value));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::{colour, depth_in, inspect_bytes, size};
    use std::io::Cursor;
    use tiff::encoder::colortype::{CMYK8, ColorType, Gray8, Gray16, Gray32Float, RGB8, RGBA16};
    use tiff::encoder::{Compression, DeflateLevel, TiffEncoder, TiffValue};

    fn tif<C: ColorType>(values: &[C::Inner], compression: Compression) -> Vec<u8>
    where
        [C::Inner]: TiffValue,
    {
        let mut bytes = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut bytes).unwrap().with_compression(compression);
        encoder.write_image::<C>(3, 2, values).unwrap();
        bytes.into_inner()
    }

    fn read(bytes: &[u8]) -> Result<[u16; 6], String> {
        let mut raw = [9; 6];
        depth_in(bytes, (3, 2), 1000.0, &mut raw).map(|()| raw).map_err(|error| error.to_string())
    }

    #[test]
    fn units_and_metres_are_read_compressed_or_not() {
        let whole = [0, 300, 600, 900, 1200, 65535];
        let metres = [1.5, 0.25, f32::NAN, -1.0, 70.0, 0.0004];
        for compression in
            [Compression::Uncompressed, Compression::Lzw, Compression::Deflate(DeflateLevel::Fast)]
        {
            let image = tif::<Gray16>(&whole, compression);
            assert_eq!(read(&image), Ok(whole));
            assert_eq!(size(&image).unwrap(), (3, 2));
            inspect_bytes(&image).unwrap();
            assert_eq!(read(&tif::<Gray32Float>(&metres, compression)), Ok([1500, 250, 0, 0, 0, 0]));
        }
        let message = read(&tif::<Gray8>(&[1; 6], Compression::Uncompressed)).unwrap_err();
        assert!(
            message.contains("Gray(8)") && message.contains("expected 1 channel of 16 bits"),
            "{message}"
        );
        let image = tif::<Gray16>(&whole, Compression::Deflate(DeflateLevel::Fast));
        assert!((0..image.len()).all(|end| read(&image[..end]) != Ok([9; 6])));
        let mut raw = [0; 4];
        let message = depth_in(&image, (2, 2), 1000.0, &mut raw).unwrap_err().to_string();
        assert!(message.contains("3x2 px, expected 2x2"), "{message}");
    }

    #[test]
    fn colour_is_read_grey_or_not_of_8_or_16_bits() {
        let read = |bytes: &[u8]| {
            let mut rgb = [9; 18];
            colour(bytes, (3, 2), &mut rgb).map(|()| rgb).map_err(|error| error.to_string())
        };
        let values: [u8; 18] = std::array::from_fn(|k| 7 * k as u8);
        assert_eq!(read(&tif::<RGB8>(&values, Compression::Lzw)), Ok(values));
        let grey = read(&tif::<Gray8>(&[1, 2, 3, 4, 5, 6], Compression::Uncompressed)).unwrap();
        assert_eq!(grey, std::array::from_fn(|k| 1 + k as u8 / 3));
        let deep: [u16; 24] = std::array::from_fn(|k| 1000 * k as u16);
        let deep = read(&tif::<RGBA16>(&deep, Compression::Uncompressed)).unwrap();
        assert_eq!(deep[..6], [0, 3, 7, 15, 19, 23]);
        let words = read(&tif::<CMYK8>(&[0; 24], Compression::Uncompressed)).unwrap_err();
        assert!(words.contains("CMYK(8), expected grey, RGB or RGBA"), "{words}");
    }
}
