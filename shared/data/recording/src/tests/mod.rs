//! Files made by the mcap crate, for what no other writer would make: cut, damaged, odd. Files of
//! other libraries are read in `tests/end_to_end/interfaces/files/recordings.rs`.

mod bags;
#[path = "../../tests/common/mod.rs"]
mod common;

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
    let (width, height) = SIZE;
    let step = width * bytes_per_pixel;
    let data = vec![value; (step * height) as usize];
    let numbers = |numbers: &[u32]| numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
    // The byte of is_bigendian is the first of the padding behind the encoding.
    cdr(&[
        &numbers(&[seconds as u32, 0]),
        &text("c"),
        &numbers(&[height, width]),
        &text(encoding),
        &numbers(&[step, data.len() as u32]),
        &data,
    ])
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

mod cameras {
    //! Depth and colour of two cameras, as `realsense2_camera` records them by default.

    use super::*;
    use crate::ros::{CameraInfo, Extrinsics, Header, RosPose, Time, TransformStamped, Transforms};
    use serde::Serialize;

    const DEPTH: &str = "/camera/camera/depth/image_rect_raw";
    const COLOUR: &str = "/camera/camera/color/image_raw";
    const IMAGE: &str = "sensor_msgs/msg/Image";
    const INFO: &str = "sensor_msgs/msg/CameraInfo";
    /// The colour image is twice as large.
    const LARGE: (u32, u32) = (40, 32);

    struct Topic {
        topic: &'static str,
        schema: &'static str,
        data: Vec<u8>,
    }

    fn encoded(message: &impl Serialize) -> Vec<u8> {
        crate::ros::encode(message).unwrap()
    }

    fn header(frame: &str) -> Header<'_> {
        Header { stamp: Time { sec: 1, nanosec: 0 }, frame_id: frame.into() }
    }

    fn picture(topic: &'static str, (width, height): (u32, u32), encoding: &str, data: &[u8]) -> Topic {
        let image = crate::ros::Image {
            header: header("frame"),
            height,
            width,
            encoding: encoding.into(),
            is_bigendian: 0,
            step: data.len() as u32 / height,
            data,
        };
        Topic { topic, schema: IMAGE, data: encoded(&image) }
    }

    fn info(topic: &'static str, frame: &str, (width, height): (u32, u32), model: &str, d: &[f64]) -> Topic {
        let (f, cx, cy) = (f64::from(width), f64::from(width - 1) / 2.0, f64::from(height - 1) / 2.0);
        let info = CameraInfo {
            header: header(frame),
            height,
            width,
            distortion_model: model.into(),
            d: d.to_vec(),
            k: [f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, 1.0],
            r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            p: [f, 0.0, cx, 0.0, 0.0, f, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        };
        Topic { topic, schema: INFO, data: encoded(&info) }
    }

    /// The colour camera stands 0.1 m to the right of the depth camera.
    fn still() -> Topic {
        let link = |child: &'static str, x: f64| TransformStamped {
            header: header("camera_link"),
            child_frame_id: child.into(),
            transform: RosPose { position: [x, 0.0, 0.0], orientation_xyzw: [0.0, 0.0, 0.0, 1.0] },
        };
        let message = Transforms { transforms: vec![link("depth_optical", 0.0), link("color_optical", 0.1)] };
        Topic { topic: "/tf_static", schema: "tf2_msgs/msg/TFMessage", data: encoded(&message) }
    }

    fn extrinsics() -> Topic {
        let rotation = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        let message = Extrinsics { rotation, translation: [-0.1, 0.0, 0.0] };
        let topic = "/camera/camera/extrinsics/depth_to_color";
        Topic { topic, schema: "realsense2_camera_msgs/msg/Extrinsics", data: encoded(&message) }
    }

    /// Depth of 1 m everywhere, and colour whose red is its column.
    fn two_cameras(further: Vec<Topic>) -> Vec<Topic> {
        let depth: Vec<u8> = (0..SIZE.0 * SIZE.1).flat_map(|_| 1000_u16.to_le_bytes()).collect();
        let colour: Vec<u8> =
            (0..LARGE.1).flat_map(|_| (0..LARGE.0).flat_map(|column| [column as u8, 7, 7])).collect();
        let mut topics = vec![
            info("/camera/camera/depth/camera_info", "depth_optical", SIZE, "plumb_bob", &[]),
            info("/camera/camera/color/camera_info", "color_optical", LARGE, "plumb_bob", &[]),
        ];
        topics.extend(further);
        topics.push(picture(DEPTH, SIZE, "16UC1", &depth));
        topics.push(picture(COLOUR, LARGE, "rgb8", &colour));
        topics
    }

    fn open(topics: &[Topic], options: &RecordingOptions<'_>) -> Result<RecordingSource, String> {
        let mut bytes = Cursor::new(Vec::new());
        let mut writer = mcap::WriteOptions::new().compression(None).create(&mut bytes).unwrap();
        for (at, message) in topics.iter().enumerate() {
            let schema = writer.add_schema(message.schema, "ros2msg", b"").unwrap();
            let channel_id = writer.add_channel(schema, message.topic, "cdr", &Default::default()).unwrap();
            let time = at as u64;
            let header =
                MessageHeader { channel_id, sequence: at as u32, log_time: time, publish_time: time };
            writer.write_to_known_channel(&header, &message.data).unwrap();
        }
        writer.finish().unwrap();
        drop(writer);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        std::fs::write(&path, bytes.into_inner()).unwrap();
        RecordingSource::open(&path, options, None).map_err(|error| error.to_string())
    }

    #[test]
    fn colour_of_another_camera_is_warped_where_the_recording_says_how() {
        for further in [still(), extrinsics()] {
            let name = further.topic;
            let source = open(&two_cameras(vec![further]), &RecordingOptions::default()).unwrap();
            assert_eq!(source.warnings(), &[] as &[String], "{name}");
            let (depth, colour, info) = read(&source, 0);
            assert!(info.has_colour && depth.iter().all(|raw| *raw == 1000), "{name}");
            // At 1 m a point of column c is seen 0.1 * 40 px further left, in an image twice as wide.
            let red = |column: usize| i32::from(colour[3 * (20 * 8 + column)]);
            for column in [5, 10, 15] {
                assert!(
                    (red(column) - (2 * column as i32 - 4)).abs() <= 1,
                    "{name}: {} at {column}",
                    red(column)
                );
            }
            let words = source.description();
            assert!(words.iter().any(|(_, words)| words.contains("40x32 px, warped to depth")), "{words:?}");
        }
    }

    #[test]
    fn colour_of_another_camera_is_left_out_where_it_does_not() {
        let source = open(&two_cameras(Vec::new()), &RecordingOptions::default()).unwrap();
        let warning = &source.warnings()[0];
        assert!(warning.contains("40x32 px, depth 20x16 px, and no /tf_static says"), "{warning}");
        let (depth, colour, info) = read(&source, 0);
        assert!(!info.has_colour && depth[0] == 1000 && colour.iter().all(|c| *c == 0));
        let without = RecordingOptions { is_without_colour: true, ..RecordingOptions::default() };
        let source = open(&two_cameras(vec![still()]), &without).unwrap();
        assert_eq!((source.warnings().len(), read(&source, 0).2.has_colour), (0, false));
    }

    #[test]
    fn a_camera_file_may_state_the_colour_camera() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let depth =
            "width = 20\nheight = 16\nfx = 20.0\nfy = 20.0\ncx = 9.5\ncy = 7.5\nunits_per_metre = 1000.0\n";
        let lens = "[colour]\nwidth = 40\nheight = 32\nfx = 40.0\nfy = 40.0\ncx = 19.5\ncy = 15.5\n";
        let place = "colour_from_depth = [-0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]\n";
        let opened = |lens: &str| {
            std::fs::write(file.path(), format!("{depth}{lens}{place}")).unwrap();
            let options = RecordingOptions { camera: file.path().to_str(), ..RecordingOptions::default() };
            open(&two_cameras(Vec::new()), &options).unwrap()
        };
        let source = opened(lens);
        assert_eq!(source.warnings(), &[] as &[String]);
        let (_, colour, info) = read(&source, 0);
        assert!(info.has_colour);
        let red = i32::from(colour[3 * (20 * 8 + 10)]);
        assert!((red - 16).abs() <= 1, "{red}");
        let source = opened(&lens.replace("width = 40", "width = 80"));
        let warning = &source.warnings()[0];
        assert!(warning.contains("40x32 px, where the camera file's [colour] says 80x32"), "{warning}");
        assert!(!read(&source, 0).2.has_colour);
    }

    #[test]
    fn a_rational_lens_is_taken_out_of_the_images() {
        // The image as taken is drawn together towards its middle: r (1 - 0.4 r^2).
        let lens = [-0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.01];
        let depth: Vec<u8> =
            (0..SIZE.1).flat_map(|_| (0..SIZE.0).flat_map(|c| (1000 + c as u16).to_le_bytes())).collect();
        let topics = [
            info("/depth/camera_info", "depth", SIZE, "rational_polynomial", &lens),
            picture("/depth/image", SIZE, "16UC1", &depth),
        ];
        let source = open(&topics, &RecordingOptions::default()).unwrap();
        assert!(!source.camera().is_distorted());
        let (depth, ..) = read(&source, 0);
        let row = &depth[20 * 8..20 * 9];
        // 9.5 columns from the middle are 0.475 of the focal length: seen at 0.475 (1 - 0.4 * 0.475^2).
        assert!((1000..=1002).contains(&row[0]) && row[0] > 1000, "{row:?}");
        assert!(row[9] == 1009 && row[10] == 1010, "{row:?}");
        assert!(row.windows(2).all(|pair| pair[0] <= pair[1]), "{row:?}");
    }
}
