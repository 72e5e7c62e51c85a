//! Files made by the mcap crate, for what no other writer would make: cut, damaged, odd. Files of
//! other libraries are read in `tests/end_to_end/interfaces/files/recordings.rs`.

mod bags;
mod cameras;
#[path = "../../tests/common/mod.rs"]
mod common;
mod imu;
mod misread;
mod mutations;

use super::*;
use mcap::records::MessageHeader;
use std::io::Cursor;

const SIZE: (u32, u32) = (20, 16);

fn cdr(parts: &[&[u8]]) -> Vec<u8> {
    // Little endian, and what follows is aligned by hand.
    [&[0u8, 1, 0, 0][..]].iter().chain(parts).flat_map(|part| part.iter().copied()).collect()
}

fn text(text: &str) -> Vec<u8> {
    let mut bytes = (text.len() as u32 + 1).to_le_bytes().to_vec();
    bytes.extend(text.bytes().chain([0]));
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes
}

fn image(seconds: i32, encoding: &str, bytes_per_pixel: u32, value: u8) -> Vec<u8> {
    image_at([seconds as u32, 0], encoding, bytes_per_pixel, value)
}

fn image_at(stamp: [u32; 2], encoding: &str, bytes_per_pixel: u32, value: u8) -> Vec<u8> {
    let (width, height) = SIZE;
    let step = width * bytes_per_pixel;
    let data = vec![value; (step * height) as usize];
    let numbers = |numbers: &[u32]| numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
    cdr(&[
        &numbers(&stamp),
        &text("c"),
        &numbers(&[height, width]),
        &encoding_and_order(encoding),
        &numbers(&[step, data.len() as u32]),
        &data,
    ])
}

/// The encoding, and behind it the byte of is_bigendian.
fn encoding_and_order(encoding: &str) -> Vec<u8> {
    let mut bytes = (encoding.len() as u32 + 1).to_le_bytes().to_vec();
    bytes.extend(encoding.bytes().chain([0, 0]));
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes
}

fn recording(n: i32) -> Vec<u8> {
    recording_of(n, |at| image(at, "16UC1", 2, 4))
}

fn recording_of(n: i32, depth_of: impl Fn(i32) -> Vec<u8>) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer =
        mcap::WriteOptions::new().compression(None).chunk_size(Some(4000)).create(&mut bytes).unwrap();
    let schema = writer.add_schema("sensor_msgs/msg/Image", "ros2msg", b"").unwrap();
    let none = Default::default();
    let depth = writer.add_channel(schema, "/depth", "cdr", &none).unwrap();
    let colour = writer.add_channel(schema, "/rgb", "cdr", &none).unwrap();
    for at in 0..n {
        let mut write = |channel_id, data: &[u8]| {
            let time = at as u64;
            let header =
                MessageHeader { channel_id, sequence: at as u32, log_time: time, publish_time: time };
            writer.write_to_known_channel(&header, data).unwrap();
        };
        write(colour, &image(at, "rgb8", 3, at as u8));
        write(depth, &depth_of(at));
    }
    writer.finish().unwrap();
    drop(writer);
    bytes.into_inner()
}

#[test]
fn messages_that_are_compressed_one_by_one_are_read() {
    use ruzstd::encoding::{CompressionLevel, compress_to_vec};
    let pack = |at: i32| compress_to_vec(&image(at, "16UC1", 2, at as u8)[..], CompressionLevel::Fastest);
    let source = open(&recording_of(9, pack)).unwrap();
    assert_eq!((source.n_frames(), source.pairing().n_pairs), (Some(9), 9));
    let (depth, _, info) = read(&source, 7);
    assert!(depth.iter().all(|raw| *raw == 0x0707) && info.stamp_nanos == 7_000_000_000);
    let cut = |at: i32| {
        let mut data = pack(at);
        let n = data.len();
        data.truncate(if at == 5 { n / 2 } else { n });
        data
    };
    let words = open(&recording_of(9, cut)).err().unwrap();
    assert!(words.contains("a.mcap"), "{words}");
}

fn compressed(n: i32, name: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    common::compress(recording(n).as_slice(), &mut bytes, name);
    bytes
}

fn open(bytes: &[u8]) -> Result<RecordingSource, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    std::fs::write(&path, bytes).unwrap();
    let camera = folder.path().join("camera.toml");
    let numbers = "fx = 20.0\nfy = 20.0\ncx = 10.0\ncy = 8.0\nunits_per_metre = 1000.0\n";
    std::fs::write(&camera, format!("width = {}\nheight = {}\n{numbers}", SIZE.0, SIZE.1)).unwrap();
    let camera = camera.display().to_string();
    let options = RecordingOptions { camera: Some(&camera), ..RecordingOptions::default() };
    RecordingSource::open(&path, &options, None).map_err(|error| error.to_string())
}

fn read(source: &RecordingSource, index: u64) -> (Vec<u16>, Vec<u8>, FrameInfo) {
    let n = (SIZE.0 * SIZE.1) as usize;
    let (mut depth, mut colour) = (vec![0; n], vec![0; 3 * n]);
    let info = source.read(index, &mut FrameBuffers { depth: &mut depth, colour: &mut colour }).unwrap();
    (depth, colour, info)
}

#[test]
fn frames_are_read_in_any_order() {
    let source = open(&recording(12)).unwrap();
    assert_eq!((source.n_frames(), source.pairing().n_pairs), (Some(12), 12));
    assert_eq!(source.warnings(), &[] as &[String]);
    for index in [11, 0, 5] {
        let (depth, colour, info) = read(&source, index);
        assert!(depth.iter().all(|raw| *raw == 0x0404) && colour.iter().all(|c| u64::from(*c) == index));
        assert_eq!((info.stamp_nanos, info.has_colour), (index as i64 * 1_000_000_000, true));
    }
    let beyond = source.read(12, &mut FrameBuffers { depth: &mut [0; 320], colour: &mut [0; 960] });
    assert!(beyond.unwrap_err().to_string().contains("frames 0 to 11"));
}

#[test]
fn an_image_that_is_not_whole_is_found_without_reading_it() {
    // Two bytes for each pixel of four.
    let depth = |at| image(at, if at == 2 { "32FC1" } else { "16UC1" }, 2, 4);
    let source = open(&recording_of(4, depth)).unwrap();
    let broken: Vec<u64> = (0..4).filter(|index| source.inspect(*index).is_err()).collect();
    assert_eq!(broken, [2]);
    assert!(source.inspect(2).unwrap_err().to_string().contains("/depth"));
    assert!(source.inspect(4).unwrap_err().to_string().contains("frames 0 to 3"));
    let report = tessera_frames::check(&source, 2).unwrap();
    assert_eq!(report.broken_frames, [2], "{report:?}");
}

#[test]
fn a_cut_file_is_read_up_to_its_last_whole_chunk() {
    let whole = recording(40);
    let mut n_before = 0;
    for percent in [30, 60, 80] {
        let source = open(&whole[..whole.len() * percent / 100]).unwrap();
        let n = source.n_frames().unwrap();
        assert!(n > n_before && n < 40, "{n} at {percent} %");
        n_before = n;
        assert!(source.warnings()[0].contains("read up to its last whole record"), "{:?}", source.warnings());
        read(&source, n - 1);
    }
    // Without its summary it is whole.
    let source = open(&whole[..whole.len() - 30]).unwrap();
    assert_eq!((source.n_frames(), source.warnings().len()), (Some(40), 1));
    // Zeros at the end, as after a power cut.
    let mut zeros = whole[..whole.len() / 2].to_vec();
    zeros.resize(whole.len(), 0);
    assert!(open(&zeros).unwrap().n_frames() < Some(40));
}

#[test]
fn damage_and_other_files_are_named() {
    let words = |bytes: &[u8]| open(bytes).err().unwrap();
    assert!(words(b"RIFFxxxx").contains("begins with 'RIFFxxxx', expected an MCAP file"));
    assert!(words(b"").contains("begins with ''"));
    let mut damaged = recording(40);
    let middle = damaged.len() / 2;
    damaged[middle..middle + 40].fill(0x77);
    // What no checksum was needed for is found when its frame is read.
    let source = open(&damaged).unwrap();
    let read = |index| {
        let n = (SIZE.0 * SIZE.1) as usize;
        let (mut depth, mut colour) = (vec![0; n], vec![0; 3 * n]);
        source.read(index, &mut FrameBuffers { depth: &mut depth, colour: &mut colour })
    };
    let errors: Vec<String> = (0..40).filter_map(|at| read(at).err()).map(|e| e.to_string()).collect();
    assert!((1..10).contains(&errors.len()), "{errors:?}");
    assert!(errors.iter().all(|error| error.contains("a.mcap: the record at byte ")), "{errors:?}");
    let end = recording(0);
    assert!(words(&end).contains("/depth has no messages"), "{}", words(&end));
    assert!(words(&end[..10]).contains("there are: no image topics"));
}

#[test]
fn compressed_chunks_are_read_one_by_one() {
    let plain = open(&recording(40)).unwrap();
    for name in ["zstd", "lz4"] {
        let whole = compressed(40, name);
        let source = open(&whole).unwrap();
        assert_eq!((source.n_frames(), source.warnings()), (Some(40), &[] as &[String]), "{name}");
        for index in [39, 0, 20] {
            assert_eq!(read(&source, index), read(&plain, index), "{name}");
        }
        let cut = open(&whole[..whole.len() * 7 / 10]).unwrap();
        let n = cut.n_frames().unwrap();
        assert!((20..32).contains(&n), "{name}: {n}");
        assert!(cut.warnings()[0].contains("read up to its last whole record"), "{:?}", cut.warnings());
        read(&cut, n - 1);
        // Damage in the records of a chunk: words, or the same images, but never other ones.
        let head = [&(name.len() as u32).to_le_bytes()[..], name.as_bytes()].concat();
        let at = whole.windows(head.len()).position(|bytes| bytes == head).unwrap() + head.len();
        let n_bytes = u64::from_le_bytes(std::array::from_fn(|k| whole[at + k])) as usize;
        let mut n_refused = 0;
        for place in at + 8..at + 8 + n_bytes {
            let mut damaged = whole.clone();
            damaged[place] ^= 0x41;
            match open(&damaged) {
                Ok(source) => assert_eq!(read(&source, 0), read(&plain, 0), "{name}: byte {place}"),
                Err(words) => {
                    assert!(words.contains("a.mcap: the record at byte "), "{name}: {words}");
                    n_refused += 1;
                }
            }
        }
        assert!(2 * n_refused > n_bytes, "{name}: {n_refused} of {n_bytes}");
    }
}

#[test]
fn what_a_chunk_declares_is_checked() {
    let whole = compressed(8, "zstd");
    let at = whole.windows(8).position(|bytes| bytes == b"\x04\0\0\0zstd").unwrap();
    let words = |change: &dyn Fn(&mut [u8])| {
        let mut bytes = whole.clone();
        change(&mut bytes[at - 12..]);
        open(&bytes).err().unwrap()
    };
    let n_bytes = u64::from_le_bytes(std::array::from_fn(|k| whole[at - 12 + k]));
    let size = |n: u64| words(&move |head: &mut [u8]| head[..8].copy_from_slice(&n.to_le_bytes()));
    assert!(size(1 << 40).contains("it has 1099511627776 bytes, expected at most 1073741824"));
    assert!(size(n_bytes + 5).contains("it ends 5 bytes before the size that it declares"));
    assert!(size(n_bytes - 5).contains("it holds more bytes than it declares"));
    assert!(words(&|head| head[8] ^= 1).contains("its checksum is "));
    let other = words(&|head| head[16..20].copy_from_slice(b"brot"));
    assert!(other.contains("its compression is 'brot', expected zstd, lz4 or none"), "{other}");
    let long = words(&|head| head[12..16].fill(0x7f));
    assert!(long.contains("the name of its compression has 2139062143 bytes, expected at most 32"), "{long}");
}
