//! A large recording takes little memory. Alone in its file: it asks how much the process took.

mod common;
#[path = "../../../../tests/requirements.rs"]
mod requirements;

use mcap::WriteOptions;
use mcap::records::MessageHeader;
use std::fs::File;
use std::io::{BufReader, BufWriter};
use std::path::Path;
use tessera_frames::{FrameBuffers, Source};
use tessera_recording::{RecordingOptions, RecordingSource};

const SIZE: (u32, u32) = (640, 480);
const N_PIXELS: usize = 640 * 480;
const N_FRAMES: u64 = 200;
const FRAME_BYTES: u64 = 5 * N_PIXELS as u64;
/// What chunks that were read are kept, chunks that are being read, and the rest of the process.
const MOST_BYTES: u64 = 160 << 20;

/// Most memory that the process has had, bytes; the cache of files is not its own.
fn most_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? << 10)
}

fn image(stamp_s: u64, encoding: &str, bytes_per_pixel: u32, data: &[u8]) -> Vec<u8> {
    let numbers = |numbers: &[u32]| numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
    let mut name = encoding.as_bytes().to_vec();
    name.resize((name.len() + 1).next_multiple_of(4), 0);
    // Little endian; the byte of is_bigendian is the first of the padding behind the encoding.
    let mut bytes = vec![0, 1, 0, 0];
    bytes.extend(numbers(&[stamp_s as u32, 0, 1, 0, SIZE.1, SIZE.0, encoding.len() as u32 + 1]));
    bytes.extend(name);
    bytes.extend(numbers(&[SIZE.0 * bytes_per_pixel, data.len() as u32]));
    bytes.extend(data);
    bytes
}

/// Noise, which no compression makes smaller, the same for the same seed.
fn noise(seed: u64, bytes: &mut [u8]) {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    for bytes in bytes.chunks_mut(8) {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        bytes.copy_from_slice(&state.to_le_bytes()[..bytes.len()]);
    }
}

fn write(path: &Path) {
    let file = BufWriter::new(File::create(path).unwrap());
    let mut writer = WriteOptions::new().compression(None).create(file).unwrap();
    let schema = writer.add_schema("sensor_msgs/msg/Image", "ros2msg", b"").unwrap();
    let none = Default::default();
    let depth = writer.add_channel(schema, "/depth", "cdr", &none).unwrap();
    let colour = writer.add_channel(schema, "/rgb", "cdr", &none).unwrap();
    let mut pixels = vec![0; 5 * N_PIXELS];
    for at in 0..N_FRAMES {
        let mut write = |channel_id, data: &[u8]| {
            let header = MessageHeader { channel_id, sequence: at as u32, log_time: at, publish_time: at };
            writer.write_to_known_channel(&header, data).unwrap();
        };
        noise(at, &mut pixels);
        let (of_depth, of_colour) = pixels.split_at(2 * N_PIXELS);
        write(depth, &image(at, "16UC1", 2, of_depth));
        write(colour, &image(at, "rgb8", 3, of_colour));
    }
    writer.finish().unwrap();
}

#[test]
fn a_large_recording_takes_little_memory() {
    let folder = tempfile::tempdir().unwrap();
    let camera = folder.path().join("camera.toml");
    let numbers =
        "width = 640\nheight = 480\nfx = 525\nfy = 525\ncx = 320\ncy = 240\nunits_per_metre = 1000\n";
    std::fs::write(&camera, numbers).unwrap();
    let camera = camera.display().to_string();
    let options = RecordingOptions { camera: Some(&camera), ..RecordingOptions::default() };
    let plain = folder.path().join("plain.mcap");
    write(&plain);
    for words in ["plain", "zstd", "lz4"] {
        let path = folder.path().join(format!("{words}.mcap"));
        if words != "plain" {
            let (from, to) = (File::open(&plain).unwrap(), File::create(&path).unwrap());
            common::compress(BufReader::new(from), BufWriter::new(to), words);
        }
        assert!(std::fs::metadata(&path).unwrap().len() > N_FRAMES * FRAME_BYTES, "{words}");
        let source = RecordingSource::open(&path, &options, None).unwrap();
        assert_eq!((source.n_frames(), source.pairing().n_pairs), (Some(N_FRAMES), N_FRAMES as usize));
        let (mut depth, mut colour) = (vec![0; N_PIXELS], vec![0; 3 * N_PIXELS]);
        let mut expected = vec![0; 5 * N_PIXELS];
        for index in 0..N_FRAMES {
            source.read(index, &mut FrameBuffers { depth: &mut depth, colour: &mut colour }).unwrap();
            noise(index, &mut expected);
            assert!(colour == expected[2 * N_PIXELS..], "{words}: frame {index}");
        }
        let Some(bytes) = most_memory_bytes() else {
            requirements::missing("proc", "no /proc/self/status");
            return;
        };
        let mb = bytes >> 20;
        assert!(bytes < MOST_BYTES, "{words}: {mb} MB for a file of {} MB", (N_FRAMES * FRAME_BYTES) >> 20);
        println!("{words}: {mb} MB at most");
    }
}
