use super::*;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use image::{ExtendedColorType, ImageEncoder, codecs::jpeg::JpegEncoder};
use std::io::Write;

const DEPTH_SIZE: (u32, u32) = (32, 24);
const COLOUR_SIZE: (u32, u32) = (64, 48);

fn intrinsics(f: f32, (width, height): (u32, u32)) -> [f32; 16] {
    let (cx, cy) = ((width - 1) as f32 / 2.0, (height - 1) as f32 / 2.0);
    [f, 0.0, cx, 0.0, 0.0, f, cy, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]
}

fn identity() -> [f32; 16] {
    let mut matrix = [0.0; 16];
    [0, 5, 10, 15].iter().for_each(|at| matrix[*at] = 1.0);
    matrix
}

fn depth(at: u16) -> Vec<u16> {
    (0..768).map(|pixel| 1000 + pixel + 10 * at).collect()
}

/// A file of three frames, the second of which has no pose.
fn sens(compression: u32, micros: [u64; 3], colour_extrinsics: [f32; 16]) -> Vec<u8> {
    let mut bytes = 4u32.to_le_bytes().to_vec();
    bytes.extend(15u64.to_le_bytes());
    bytes.extend(b"StructureSensor");
    for matrix in [intrinsics(60.0, COLOUR_SIZE), colour_extrinsics, intrinsics(30.0, DEPTH_SIZE), identity()]
    {
        matrix.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
    }
    for number in [2, compression, COLOUR_SIZE.0, COLOUR_SIZE.1, DEPTH_SIZE.0, DEPTH_SIZE.1] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend(1000f32.to_le_bytes());
    bytes.extend(3u64.to_le_bytes());
    for at in 0..3u16 {
        let mut pose = identity();
        pose[3] = f32::from(at);
        let pose = if at == 1 { [f32::NEG_INFINITY; 16] } else { pose };
        pose.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        let mut jpeg = Vec::new();
        let rgb = [200u8, 100, 50].repeat((COLOUR_SIZE.0 * COLOUR_SIZE.1) as usize);
        JpegEncoder::new_with_quality(&mut jpeg, 95)
            .write_image(&rgb, COLOUR_SIZE.0, COLOUR_SIZE.1, ExtendedColorType::Rgb8)
            .unwrap();
        let raw: Vec<u8> = depth(at).iter().flat_map(|raw| raw.to_le_bytes()).collect();
        let stored = match compression {
            1 => {
                let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
                encoder.write_all(&raw).unwrap();
                encoder.finish().unwrap()
            }
            _ => raw,
        };
        for number in [micros[at as usize], micros[at as usize], jpeg.len() as u64, stored.len() as u64] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend(jpeg);
        bytes.extend(stored);
    }
    bytes.extend(0u64.to_le_bytes());
    bytes
}

fn open(bytes: &[u8]) -> Result<SensSource, String> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("scene.sens");
    std::fs::write(&path, bytes).unwrap();
    SensSource::open(&path, &SourceOptions::default(), None).map_err(|error| error.to_string())
}

fn read(source: &SensSource, index: u64) -> Result<(Vec<u16>, Vec<u8>, FrameInfo), SourceError> {
    let (mut depth, mut colour) = (vec![0; 768], vec![0; 3 * 768]);
    let info = source.read(index, &mut FrameBuffers { depth: &mut depth, colour: &mut colour })?;
    Ok((depth, colour, info))
}

#[test]
fn depth_colour_camera_times_and_poses_are_read() {
    for compression in [0, 1] {
        let source = open(&sens(compression, [7_000, 40_333, 73_666], identity())).unwrap();
        let camera = source.camera();
        assert_eq!((camera.fx, camera.cx, camera.units_per_metre), (30.0, 15.5, 1000.0));
        assert_eq!(source.stamps, [7_000_000, 40_333_000, 73_666_000]);
        for at in 0..3 {
            let (found, colour, info) = read(&source, at).unwrap();
            assert_eq!(found, depth(at as u16));
            assert!(
                info.has_colour && colour[..3].iter().zip([200, 100, 50]).all(|(a, b)| a.abs_diff(b) < 6)
            );
        }
        let taken = source.colour_as_taken(0).unwrap().unwrap();
        assert_eq!((taken.camera.camera.fx, taken.rgb.len()), (60.0, 64 * 48 * 3));
        let truth = source.ground_truth().unwrap();
        assert_eq!(truth.stamps_nanos, [7_000_000, 73_666_000]);
        assert_eq!(truth.poses[1].translation.x, 2.0);
        assert!(source.warnings().is_empty() && source.pairing().n_pairs == 3);
    }
}

#[test]
fn a_scene_is_opened_by_its_file_or_its_folder() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("scene0000_00.sens"), sens(1, [0; 3], identity())).unwrap();
    let opened = |path: &Path| {
        let spec = crate::SourceSpec::parse(&path.display().to_string());
        crate::open(&spec, &SourceOptions { skip: 1, ..SourceOptions::default() }).unwrap()
    };
    for path in [dir.path().to_owned(), dir.path().join("scene0000_00.sens")] {
        let source = opened(&path);
        assert_eq!((source.n_frames(), source.camera().fx), (Some(2), 30.0));
        assert!(source.colour_as_taken(0).unwrap().is_some());
    }
}

#[test]
fn times_that_are_not_set_are_counted_and_a_cut_file_is_read_up_to_there() {
    let whole = sens(1, [0; 3], identity());
    let source = open(&whole).unwrap();
    assert_eq!(source.stamps, [0, 33_333_333, 66_666_667]);
    assert!(source.description()[3].1.contains("30 frames a second are assumed"));
    let mut n_frames = 3;
    for end in (0..whole.len()).rev().step_by(37) {
        match open(&whole[..end]) {
            Ok(source) => {
                assert!(source.frames.len() <= n_frames);
                n_frames = source.frames.len();
                let is_cut = source.warnings().iter().any(|words| words.contains("cut behind frame"));
                assert!(is_cut || n_frames == 3);
                (0..n_frames as u64).for_each(|at| drop(read(&source, at).unwrap()));
            }
            Err(words) => assert!(words.contains("scene.sens"), "{words}"),
        }
    }
    assert_eq!(n_frames, 1);
}

#[test]
fn what_is_not_read_is_told() {
    let whole = sens(1, [0; 3], identity());
    let changed = |at: usize, value: u8| {
        let mut bytes = whole.clone();
        bytes[at] = value;
        bytes
    };
    for (bytes, expected) in [
        (changed(0, 3), "version 3, expected 4 of a .sens file"),
        (changed(287, 2), "depth compression 2, expected 0 (raw) or 1 (zlib)"),
        (changed(9, 255), "expected at most 4096"),
        (whole[..100].to_vec(), "expected 4 more bytes of a .sens file"),
    ] {
        let words = open(&bytes).err().unwrap();
        assert!(words.contains(expected), "{words}");
    }
    let mut beside = identity();
    beside[3] = 0.05;
    let source = open(&sens(0, [0; 3], beside)).unwrap();
    assert!(source.warnings()[0].contains("its camera is at another place"), "{:?}", source.warnings());
    assert!(!read(&source, 0).unwrap().2.has_colour);
    // A frame whose depth is damaged is one frame.
    let source = open(&whole).unwrap();
    let (begin, length) = source.frames[1].depth;
    let mut bytes = whole.clone();
    bytes[begin as usize..begin as usize + length].fill(7);
    let source = open(&bytes).unwrap();
    let error = read(&source, 1).unwrap_err();
    assert!(error.is_of_one_frame() && error.to_string().contains("frame 1"), "{error}");
    assert!(read(&source, 2).is_ok());
}
