//! Uncompressed BMP of 8, 24 or 32 bits: what cameras' viewers save.

use super::{check_size, damaged, pixels};
use crate::ImageError;

const MAGIC: &[u8] = b"BM";
/// Bytes of the two headers, as far as they are used.
const HEAD: usize = 54;

pub(super) fn is(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

/// What the headers state.
struct BmpHead {
    size: (u32, u32),
    is_top_down: bool,
    n_bits: usize,
    /// Where the pixels and the palette begin.
    pixels_at: usize,
    palette_at: usize,
}

fn head(bytes: &[u8]) -> Result<BmpHead, ImageError> {
    let whole: &[u8; HEAD] =
        bytes.first_chunk().ok_or_else(|| damaged("BMP", &format!("{} bytes", bytes.len())))?;
    let word =
        |at: usize| whole.get(at..).and_then(<[u8]>::first_chunk).map_or(0, |word| u32::from_le_bytes(*word));
    let (width, height) = (word(18) as i32, word(22) as i32);
    let (n_bits, compression) = (word(28) as usize & 0xff, word(30));
    // 3: fields of bits, which are those of 32 bits without.
    let is_plain = compression == 0 || (compression == 3 && n_bits == 32);
    if !is_plain || ![8, 24, 32].contains(&n_bits) {
        let found = format!("{n_bits} bits a pixel and compression {compression}");
        return Err(ImageError::Pixels {
            what: "colour",
            found,
            expected: "an uncompressed BMP of 8, 24 or 32 bits",
        });
    }
    if width <= 0 || height == 0 || height == i32::MIN {
        return Err(damaged("BMP", &format!("a size of {width}x{height}")));
    }
    Ok(BmpHead {
        size: (width as u32, height.unsigned_abs()),
        is_top_down: height < 0,
        n_bits,
        pixels_at: word(10) as usize,
        palette_at: 14_usize.saturating_add(word(14) as usize),
    })
}

pub(super) fn size(bytes: &[u8]) -> Result<(u32, u32), ImageError> {
    Ok(head(bytes)?.size)
}

/// Decodes as red, green, blue.
pub(super) fn read(bytes: &[u8], size: (u32, u32), rgb: &mut [u8]) -> Result<(), ImageError> {
    let head = head(bytes)?;
    check_size("colour", head.size, size)?;
    let (width, height) = (size.0 as usize, size.1 as usize);
    let n = head.n_bits / 8;
    // Rows are filled up to four bytes.
    let n_row = width.saturating_mul(n);
    let row_bytes = n_row.saturating_add(3) & !3;
    for (row, to) in rgb.chunks_exact_mut(width.saturating_mul(3)).enumerate() {
        let at = if head.is_top_down { row } else { height.saturating_sub(1).saturating_sub(row) };
        let begin = head.pixels_at.saturating_add(at.saturating_mul(row_bytes));
        let from = bytes.get(begin..begin.saturating_add(n_row));
        let from =
            from.ok_or_else(|| damaged("BMP", &format!("{} bytes, row {at} is not whole", bytes.len())))?;
        for (pixel, from) in to.as_chunks_mut().0.iter_mut().zip(from.chunks_exact(n)) {
            let bgr = match from {
                [grey] => {
                    let entry = head.palette_at.saturating_add(usize::from(*grey).saturating_mul(4));
                    bytes.get(entry..).and_then(<[u8]>::first_chunk)
                }
                _ => from.first_chunk(),
            };
            let [blue, green, red] = *bgr.ok_or_else(|| damaged("BMP", &pixels(1, 8)))?;
            *pixel = [red, green, blue];
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::{colour, inspect_bytes, size};

    fn bmp(n_bits: u8, height: i32, palette: &[u8], pixels: &[u8]) -> Vec<u8> {
        let at = 54 + palette.len() as u32;
        let mut bytes = b"BM\0\0\0\0\0\0\0\0".to_vec();
        bytes.extend(at.to_le_bytes());
        bytes.extend(40_u32.to_le_bytes());
        bytes.extend(2_i32.to_le_bytes());
        bytes.extend(height.to_le_bytes());
        bytes.extend([1, 0, n_bits, 0]);
        bytes.extend([0; 24]);
        bytes.extend(palette);
        bytes.extend(pixels);
        bytes
    }

    #[test]
    fn rows_go_up_unless_the_height_is_negative() {
        let pixels = [1, 2, 3, 4, 5, 6, 0, 0, 7, 8, 9, 10, 11, 12, 0, 0];
        let read = |bytes: &[u8]| {
            let mut rgb = [0; 12];
            colour(bytes, (2, 2), &mut rgb).map(|()| rgb)
        };
        let up = bmp(24, 2, &[], &pixels);
        assert_eq!(read(&up).unwrap(), [9, 8, 7, 12, 11, 10, 3, 2, 1, 6, 5, 4]);
        assert_eq!(size(&up).unwrap(), (2, 2));
        inspect_bytes(&up).unwrap();
        let down = bmp(24, -2, &[], &pixels);
        assert_eq!(read(&down).unwrap(), [3, 2, 1, 6, 5, 4, 9, 8, 7, 12, 11, 10]);
        let palette: Vec<u8> = (0..=255).flat_map(|v| [v, v, 255 - v, 0]).collect();
        let indexed = bmp(8, -2, &palette, &[5, 6, 0, 0, 7, 8, 0, 0]);
        assert_eq!(read(&indexed).unwrap()[..3], [250, 5, 5]);
        for end in 0..up.len() - 2 {
            assert!(read(&up[..end]).is_err(), "cut at {end}");
        }
        let words = read(&bmp(16, 2, &[], &pixels)).unwrap_err().to_string();
        assert!(words.contains("16 bits a pixel and compression 0, expected an uncompressed BMP"), "{words}");
    }
}
