//! PGM and PPM, as text (P2, P3) or bytes (P5, P6).

use super::{MOST_BYTES, check_size, damaged, pixels};
use crate::ImageError;

/// The head of a file, and the pixels behind it.
struct NetpbmFile<'a> {
    n_channels: usize,
    is_text: bool,
    size: (u32, u32),
    /// The value of white.
    most: u32,
    data: &'a [u8],
}

/// Whether these bytes begin one.
pub(super) fn is(bytes: &[u8]) -> bool {
    matches!(bytes, [b'P', b'2' | b'3' | b'5' | b'6', space, ..] if space.is_ascii_whitespace())
}

/// `P5 width height most`, separated by white space and comments, then pixels, the higher byte first.
fn open(bytes: &[u8]) -> Result<NetpbmFile<'_>, ImageError> {
    let wrong = |found: &str| damaged("PGM or PPM", &format!("its head has {found}"));
    let kind = bytes.get(1).copied().unwrap_or_default();
    let mut left = bytes.get(2..).unwrap_or_default();
    let mut numbers = [0_u32; 3];
    for number in &mut numbers {
        loop {
            left = left.trim_ascii_start();
            if !left.starts_with(b"#") {
                break;
            }
            let end = left.iter().position(|byte| *byte == b'\n').ok_or_else(|| wrong("no end"))?;
            left = left.get(end..).unwrap_or_default();
        }
        let n = left.iter().take(10).take_while(|byte| byte.is_ascii_digit()).count();
        let (digits, rest) = left.split_at_checked(n).unwrap_or_default();
        let digits = std::str::from_utf8(digits).unwrap_or_default();
        *number = digits.parse().map_err(|_| wrong("no three numbers"))?;
        left = rest;
    }
    let [width, height, most] = numbers;
    if !(1..=65_535).contains(&most) {
        return Err(wrong(&format!("the largest value {most}, expected 1 to 65535")));
    }
    Ok(NetpbmFile {
        n_channels: if matches!(kind, b'3' | b'6') { 3 } else { 1 },
        is_text: matches!(kind, b'2' | b'3'),
        size: (width, height),
        most,
        data: left.get(1..).unwrap_or_default(),
    })
}

impl NetpbmFile<'_> {
    fn n_bits(&self) -> usize {
        if self.most > 255 { 16 } else { 8 }
    }

    /// All values, row by row.
    fn values(&self) -> Result<Vec<u16>, ImageError> {
        let n = (self.size.0 as usize).saturating_mul(self.size.1 as usize).saturating_mul(self.n_channels);
        let expected = if self.is_text { n } else { n.saturating_mul(self.n_bits() / 8) };
        let too_few = |found: usize, of: &str| {
            damaged("PGM or PPM", &format!("{found} {of} of pixels, expected {expected}"))
        };
        if self.data.len() < expected || expected > MOST_BYTES {
            return Err(too_few(self.data.len(), "bytes"));
        }
        if !self.is_text {
            return Ok(match self.n_bits() {
                16 => self.data.as_chunks().0.iter().take(n).map(|two| u16::from_be_bytes(*two)).collect(),
                _ => self.data.iter().take(n).map(|byte| u16::from(*byte)).collect(),
            });
        }
        let words = self.data.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let value = |word: &[u8]| {
            let value = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
            value.filter(|value| u32::from(*value) <= self.most).ok_or_else(|| {
                let word = word.get(..12).unwrap_or(word).escape_ascii();
                damaged("PGM or PPM", &format!("a pixel is '{word}', expected 0 to {}", self.most))
            })
        };
        let values: Vec<u16> = words.take(n).map(value).collect::<Result<_, _>>()?;
        if values.len() < n { Err(too_few(values.len(), "values")) } else { Ok(values) }
    }
}

pub(super) fn size(bytes: &[u8]) -> Result<(u32, u32), ImageError> {
    Ok(open(bytes)?.size)
}

/// Decodes depth of one channel of 16 bits.
pub(super) fn depth(bytes: &[u8], size: (u32, u32), depth_raw: &mut [u16]) -> Result<(), ImageError> {
    let file = open(bytes)?;
    check_size("depth", file.size, size)?;
    if (file.n_channels, file.n_bits()) != (1, 16) {
        let found = pixels(file.n_channels, file.n_bits());
        return Err(ImageError::Pixels { what: "depth", found, expected: super::NO_PICTURE });
    }
    depth_raw.iter_mut().zip(file.values()?).for_each(|(raw, value)| *raw = value);
    Ok(())
}

/// Decodes colour or grey as red, green, blue.
pub(super) fn colour(bytes: &[u8], size: (u32, u32), rgb: &mut [u8]) -> Result<(), ImageError> {
    let file = open(bytes)?;
    check_size("colour", file.size, size)?;
    let values = file.values()?;
    let of_255 = |value: u16| {
        let scaled = u32::from(value).saturating_mul(255).checked_div(file.most);
        u8::try_from(scaled.unwrap_or_default()).unwrap_or(u8::MAX)
    };
    for (pixel, from) in rgb.chunks_exact_mut(3).zip(values.chunks_exact(file.n_channels)) {
        pixel.iter_mut().zip(from.iter().cycle()).for_each(|(to, value)| *to = of_255(*value));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::{colour, depth_in, inspect_bytes, size};

    const RAW: [u16; 6] = [300, 600, 900, 1200, 1500, 1800];

    fn read(bytes: &[u8]) -> Result<[u16; 6], String> {
        let mut raw = [9; 6];
        depth_in(bytes, (3, 2), 1000.0, &mut raw).map(|()| raw).map_err(|error| error.to_string())
    }

    fn painted(bytes: &[u8]) -> Result<[u8; 6], String> {
        let mut rgb = [9; 6];
        colour(bytes, (2, 1), &mut rgb).map(|()| rgb).map_err(|error| error.to_string())
    }

    #[test]
    fn depth_is_text_or_has_the_higher_byte_first() {
        let whole: Vec<u8> = RAW.iter().flat_map(|raw| raw.to_be_bytes()).collect();
        let file = [b"P5\n# a camera\n3 2\n65535\n", &whole[..]].concat();
        assert_eq!((read(&file), size(&file).unwrap()), (Ok(RAW), (3, 2)));
        for end in 0..file.len() {
            assert!(read(&file[..end]).is_err(), "cut at {end}");
        }
        let text = b"P2\n# a camera\n3 2\n10000\n300 600 900\n1200 1500  1800\n";
        assert_eq!(read(text), Ok(RAW));
        inspect_bytes(text).unwrap();
        for (file, expected) in [
            (&b"P5 3 2 255\n123456"[..], "1 channel of 8 bits, expected 1 channel of 16"),
            (b"P2 3 2 255\n1 2 3 4 5 6", "1 channel of 8 bits, expected 1 channel of 16"),
            (b"P3 3 2 1000\n1 2 3 4 5 6", "3 channels of 16 bits, expected 1 channel of 16"),
            (b"P2 3 2 1000\n300 600 900 1200 10 10", "a pixel is '1200', expected 0 to 1000"),
            (b"P2 3 2 9000\n300 600 900 -1 10 10", "a pixel is '-1', expected 0 to 9000"),
            (b"P2 3 2 9000\n300 600 900 12 10", "5 values of pixels, expected 6"),
            (b"P2 3 2 90000\n300 600 900 12 10 10", "the largest value 90000"),
            (b"P2 2 3 9000\n300 600 900 12 10 10", "2x3 px, expected 3x2"),
        ] {
            let found = read(file).unwrap_err();
            assert!(found.contains(expected), "'{found}' lacks '{expected}'");
        }
    }

    #[test]
    fn colour_is_scaled_to_eight_bits() {
        let six = [0, 51, 102, 153, 204, 255];
        assert_eq!(painted(&[&b"P6 2 1 255\n"[..], &six].concat()), Ok(six));
        assert_eq!(painted(b"P3 2 1 255 0 51 102 153 204 255"), Ok(six));
        assert_eq!(painted(b"P3 2 1 5 0 1 2 3 4 5"), Ok(six));
        assert_eq!(painted(b"P2 2 1 1000 200 1000"), Ok([51, 51, 51, 255, 255, 255]));
        assert_eq!(painted(b"P5 2 1 65535\n\x33\x33\xff\xff"), Ok([51, 51, 51, 255, 255, 255]));
        assert!(painted(b"P6 2 1 255\n12345").unwrap_err().contains("5 bytes of pixels, expected 6"));
        for (file, expected) in
            [(&b"P4 2 1\n\x80"[..], "1 bit"), (b"P7\nWIDTH 2\n", "a PAM"), (b"Pf\n2 1\n-1.0\n", "a PFM")]
        {
            let found = painted(file).unwrap_err();
            assert!(found.contains(expected), "'{found}' lacks '{expected}'");
        }
    }
}
