//! OpenEXR as its layout is documented: all that is read, what is not, and damage.

use super::super::{depth_in, inspect_bytes};
use super::*;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use std::io::Write;

const SIZE: (u32, u32) = (16, 20);
const UNITS: f64 = 1000.0;

/// Millimetres that halves hold exactly.
fn millimetres(at: usize) -> u16 {
    1000 + 125 * (at % 16) as u16
}

fn attribute(name: &str, kind: &str, value: &[u8]) -> Vec<u8> {
    [name.as_bytes(), b"\0", kind.as_bytes(), b"\0", &(value.len() as u32).to_le_bytes(), value].concat()
}

fn half_of(metres: f32) -> [u8; 2] {
    // Of numbers from 1 to 4 with few digits.
    let bits = metres.to_bits();
    ((((bits >> 23) - 112) << 10) as u16 | ((bits >> 13) & 0x3ff) as u16).to_le_bytes()
}

/// The bytes of a chunk, compressed.
fn packed(pixels: &[u8], compression: u8) -> Vec<u8> {
    if compression == 0 {
        return pixels.to_vec();
    }
    let parts: Vec<u8> = pixels.iter().step_by(2).chain(pixels.iter().skip(1).step_by(2)).copied().collect();
    let mut differences = vec![parts[0]];
    differences.extend(parts.windows(2).map(|pair| pair[1].wrapping_sub(pair[0]).wrapping_add(128)));
    if compression == 1 {
        // A run, then the others as they are.
        let n = differences.iter().take_while(|byte| **byte == differences[0]).count().min(128);
        let mut runs = vec![(n - 1) as u8, differences[0]];
        for bytes in differences[n..].chunks(127) {
            runs.push((-(bytes.len() as i8)).cast_unsigned());
            runs.extend(bytes);
        }
        return runs;
    }
    let mut zlib = ZlibEncoder::new(Vec::new(), Compression::default());
    zlib.write_all(&differences).unwrap();
    zlib.finish().unwrap()
}

/// A file of some channels, halves where `is_half`; all hold depth, but those in `others`.
fn file(names: &[&str], is_half: bool, compression: u8, others: &[&str]) -> Vec<u8> {
    let mut channels = Vec::new();
    for name in names {
        channels.extend([name.as_bytes(), b"\0", &if is_half { 1u32 } else { 2 }.to_le_bytes()].concat());
        channels.extend([&[0; 4][..], &1u32.to_le_bytes(), &1u32.to_le_bytes()].concat());
    }
    channels.push(0);
    let window = [0, 5, SIZE.0 - 1, SIZE.1 + 4].map(u32::to_le_bytes).concat();
    let mut file = [MARK, &[2, 0, 0, 0]].concat();
    file.extend(attribute("channels", "chlist", &channels));
    file.extend(attribute("compression", "compression", &[compression]));
    file.extend(attribute("dataWindow", "box2i", &window));
    file.extend(attribute("displayWindow", "box2i", &window));
    file.extend(attribute("owner", "string", b"some other attribute"));
    file.push(0);
    let n_rows = if compression == 3 { 16 } else { 1 };
    let (mut chunks, mut offsets) = (Vec::new(), Vec::new());
    let begin = file.len() + 8 * SIZE.1.div_ceil(n_rows) as usize;
    for row in (0..SIZE.1).step_by(n_rows as usize) {
        let mut pixels = Vec::new();
        for row in row..(row + n_rows).min(SIZE.1) {
            for name in names {
                for column in 0..SIZE.0 {
                    let mut metres = f32::from(millimetres((row * SIZE.0 + column) as usize)) / 1000.0;
                    metres *= if others.contains(name) { 2.0 } else { 1.0 };
                    match is_half {
                        true => pixels.extend(half_of(metres)),
                        false => pixels.extend(metres.to_le_bytes()),
                    }
                }
            }
        }
        let packed = packed(&pixels, compression);
        // One that did not get smaller is stored as it is.
        let packed = if packed.len() < pixels.len() { packed } else { pixels };
        offsets.extend(((begin + chunks.len()) as u64).to_le_bytes());
        chunks.extend([(row + 5).to_le_bytes(), (packed.len() as u32).to_le_bytes()].concat());
        chunks.extend(packed);
    }
    [file, offsets, chunks].concat()
}

fn read(bytes: &[u8]) -> Result<Vec<u16>, String> {
    let mut raw = vec![7; (SIZE.0 * SIZE.1) as usize];
    depth_in(bytes, SIZE, UNITS, &mut raw).map_err(|error| error.to_string())?;
    Ok(raw)
}

fn expected() -> Vec<u16> {
    (0..(SIZE.0 * SIZE.1) as usize).map(millimetres).collect()
}

#[test]
fn halves_and_floats_of_each_compression_are_read() {
    for compression in 0..4 {
        for is_half in [false, true] {
            let bytes = file(&["Z"], is_half, compression, &[]);
            assert_eq!(super::super::size(&bytes).unwrap(), SIZE);
            assert_eq!(read(&bytes).unwrap(), expected(), "compression {compression}, half {is_half}");
            assert!(inspect_bytes(&bytes).is_ok());
        }
    }
    let halves = [0, 1, 0x0400, 0x3c00, 0x4248, 0xc000, 0x7bff].map(half);
    assert_eq!(halves, [0.0, 2.0_f64.powi(-24), 2.0_f64.powi(-14), 1.0, 3.140625, -2.0, 65504.0]);
    assert!(half(0x7c00).is_nan() && half(0xfe00).is_nan());
}

/// Files of 16x16 px that the OpenEXR library wrote, each behind a byte of the corpus.
#[test]
fn files_of_the_openexr_library_are_read() {
    let files: [&[u8]; 3] = [
        include_bytes!("../../../../../../fuzz/corpus/images/exr_zip_float32"),
        include_bytes!("../../../../../../fuzz/corpus/images/exr_zips_float16"),
        include_bytes!("../../../../../../fuzz/corpus/images/exr_rle_float32"),
    ];
    for bytes in files {
        let mut raw = [7; 256];
        depth_in(&bytes[1..], (16, 16), UNITS, &mut raw).unwrap();
        assert_eq!(raw[..], expected()[..256]);
    }
}

#[test]
fn depth_is_the_channel_that_names_it_or_the_only_one() {
    for (names, others) in [
        (&["A", "B", "G", "R", "Z"][..], &["A", "B", "G", "R"][..]),
        (&["View.Combined.B", "View.Depth.Z", "View.Normal.Z"], &["View.Combined.B", "View.Normal.Z"]),
        (&["Depth.V", "Image.B", "Image.G", "Image.R"], &["Image.B", "Image.G", "Image.R"]),
        (&["WorldDepth.A", "WorldDepth.R"], &["WorldDepth.A"]),
        (&["A"], &[]),
        (&["Y"], &[]),
        (&["A", "B", "G", "R"], &["A"]),
    ] {
        assert_eq!(read(&file(names, false, 3, others)).unwrap(), expected(), "{names:?}");
    }
    let message = read(&file(&["B", "G", "R"], false, 3, &["G"])).unwrap_err();
    assert!(message.contains("channels R, G, B that differ, expected a channel Z of depth"), "{message}");
    let message = read(&file(&["U", "W"], false, 3, &[])).unwrap_err();
    assert!(message.contains("channels U, W, expected a channel Z"), "{message}");
}

#[test]
fn what_is_not_read_is_named() {
    let whole = file(&["Z"], false, 0, &[]);
    let with = |from: &[u8], into: &[u8]| {
        let at = whole.windows(from.len()).position(|window| window == from).unwrap();
        let mut bytes = whole.clone();
        bytes[at..at + into.len()].copy_from_slice(into);
        read(&bytes).unwrap_err()
    };
    for (message, expected) in [
        (
            with(b"\x02\0\0\0channels", b"\x02\x02"),
            "OpenEXR image has tiles, expected one part of scan lines",
        ),
        (with(b"\x02\0\0\0channels", b"\x02\x10"), "several parts"),
        (with(b"compression\0\x01\0\0\0\0", b"compression\0\x01\0\0\0\x04"), "compression PIZ, expected"),
        (with(b"compression\0\x01\0\0\0\0", b"compression\0\x01\0\0\0\x63"), "compression unknown"),
        (with(b"Z\0\x02", b"Z\0\0"), "channel Z of whole numbers"),
        (with(b"displayWindow\0box2i\0\x10\0\0\0\0", b"displayWindow\0box2i\0\x10\0\0\0\x01"), "dataWindow"),
        (with(b"compression\0c", b"x"), "no channels, dataWindow or compression"),
    ] {
        assert!(message.contains(expected), "{message}");
    }
    let message = read(&file(&["Z"], true, 3, &[])[..200]).unwrap_err();
    assert!(message.contains("damaged") || message.contains("early"), "{message}");
    let other = depth_in(&whole, (20, 16), UNITS, &mut [0; 320]).unwrap_err().to_string();
    assert!(other.contains("depth image is 16x20 px, expected 20x16"), "{other}");
}

/// A file that was cut is never a whole image, and nonsense never panics.
#[test]
fn cut_and_changed_files_are_read_or_refused() {
    for compression in 0..4 {
        let whole = file(&["Z"], true, compression, &[]);
        for end in 0..whole.len() {
            assert!(read(&whole[..end]).is_err(), "compression {compression}, {end} bytes");
        }
        let mut n_refused = 0;
        for at in 4..whole.len() {
            for change in [1, 0x40, 0x80, 0xff] {
                let mut bytes = whole.clone();
                bytes[at] ^= change;
                n_refused += usize::from(read(&bytes).is_err());
            }
        }
        assert!(n_refused > 300, "{n_refused} refused");
    }
}
