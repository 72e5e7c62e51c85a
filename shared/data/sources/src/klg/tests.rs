use super::*;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use image::{ExtendedColorType, ImageEncoder, codecs::jpeg::JpegEncoder};
use std::io::Write;
use tessera_numerics::SplitMix64;

const SIZE: (u32, u32) = (32, 24);
const N_PIXELS: usize = 768;
const CAMERA: &str =
    "width = 32\nheight = 24\nfx = 30.0\nfy = 30.0\ncx = 15.5\ncy = 11.5\nunits_per_metre = 1000.0\n";

fn depth(at: u16) -> Vec<u16> {
    (0..768).map(|pixel| 1000 + pixel + 10 * at).collect()
}

/// Frames whose depth is by zlib but for the first; colour is raw, a JPEG, and not there.
fn klg(micros: [i64; 3]) -> Vec<u8> {
    let rgb = [200_u8, 100, 50].repeat(N_PIXELS);
    let mut jpeg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpeg, 95)
        .write_image(&rgb, SIZE.0, SIZE.1, ExtendedColorType::Rgb8)
        .unwrap();
    let mut bytes = 3_i32.to_le_bytes().to_vec();
    for (at, colour) in (0_u16..3).zip([rgb, jpeg, Vec::new()]) {
        let raw: Vec<u8> = depth(at).iter().flat_map(|raw| raw.to_le_bytes()).collect();
        let stored = match at {
            0 => raw,
            _ => {
                let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
                encoder.write_all(&raw).unwrap();
                encoder.finish().unwrap()
            }
        };
        bytes.extend(micros[usize::from(at)].to_le_bytes());
        bytes.extend([stored.len() as i32, colour.len() as i32].map(i32::to_le_bytes).concat());
        bytes.extend([stored, colour].concat());
    }
    bytes
}

const MICROS: [i64; 3] = [1_500_000, 1_533_333, 1_566_666];

/// Opens bytes as a file with the camera.
fn open(bytes: &[u8], camera: Option<&str>) -> Result<Box<dyn Source>, SourceError> {
    let folder = tempfile::tempdir().unwrap();
    let (file, toml) = (folder.path().join("a.klg"), folder.path().join("c.toml"));
    std::fs::write(&file, bytes).unwrap();
    let camera = camera.map(|text| {
        std::fs::write(&toml, text).unwrap();
        toml.display().to_string()
    });
    let options = SourceOptions { camera, ..SourceOptions::default() };
    crate::open(&crate::SourceSpec::parse(&file.display().to_string()), &options)
}

fn read(source: &dyn Source, index: u64) -> Result<(Vec<u16>, Vec<u8>, FrameInfo), SourceError> {
    let n = (source.camera().width * source.camera().height) as usize;
    let (mut depth, mut colour) = (vec![9; n], vec![9; 3 * n]);
    let info = source.read(index, &mut FrameBuffers { depth: &mut depth, colour: &mut colour })?;
    Ok((depth, colour, info))
}

#[test]
fn depth_colour_and_times_are_read() {
    let source = open(&klg(MICROS), Some(CAMERA)).unwrap();
    assert_eq!((source.n_frames(), source.warnings()), (Some(3), &[] as &[String]));
    for (at, has) in [(0, true), (1, true), (2, false)] {
        let (raw, rgb, info) = read(&*source, at).unwrap();
        assert_eq!((raw, info.has_colour), (depth(at as u16), has));
        assert_eq!(info.stamp_nanos, MICROS[at as usize] * 1000);
        let near = |a: u8, b: u8| a.abs_diff(b) < 6;
        assert!(if has { near(rgb[0], 200) && near(rgb[2], 50) } else { rgb[0] == 0 }, "{:?}", &rgb[..3]);
    }
    assert_eq!((source.pairing().n_depth, source.pairing().n_pairs), (3, 2));
    // Frames that are counted have the usual rate.
    let source = open(&klg([0, 1, 2]), Some(CAMERA)).unwrap();
    assert_eq!(source.stamp_nanos(2), Some(66_666_667));
}

#[test]
fn what_is_missing_or_wrong_is_named() {
    let refusal = |bytes: &[u8], camera| open(bytes, camera).err().unwrap().to_string();
    let message = refusal(&klg(MICROS), None);
    assert!(message.contains("a .klg has no camera in it, expected --camera FILE"), "{message}");
    assert!(refusal(&[], Some(CAMERA)).contains("no whole frame"));
    let source = open(&klg(MICROS), Some(&CAMERA.replace("1000.0", "5000.0"))).unwrap();
    assert!(source.warnings()[0].contains("in millimetres, and"), "{:?}", source.warnings());
    let source = open(&klg(MICROS), Some(&CAMERA.replace("24", "20"))).unwrap();
    let message = read(&*source, 1).unwrap_err().to_string();
    assert!(message.contains("frame 1") && message.contains("depth"), "{message}");
    let whole = klg(MICROS);
    let source = open(&whole[..whole.len() - 5], Some(CAMERA)).unwrap();
    assert!(source.warnings()[0].contains("states 3 frames; 2 are whole"), "{:?}", source.warnings());
}

#[test]
fn changed_files_are_read_or_refused() {
    let whole = klg(MICROS);
    let (mut n_refused, mut n_told) = (0, 0);
    for seed in 0..400 {
        let mut chance = SplitMix64::new(seed);
        let mut bytes = whole.clone();
        let at = chance.below(bytes.len());
        match chance.below(3) {
            0 => bytes.truncate(at),
            1 => drop(bytes.remove(at)),
            _ => bytes[at] ^= 1 << chance.below(8),
        }
        match open(&bytes, Some(CAMERA)) {
            Err(_) => n_refused += 1,
            Ok(source) => {
                n_told += usize::from(!source.warnings().is_empty());
                (0..source.n_frames().unwrap()).for_each(|index| drop(read(&*source, index)));
            }
        }
    }
    assert!(n_refused > 5 && n_told > 50, "{n_refused} {n_told}");
}
