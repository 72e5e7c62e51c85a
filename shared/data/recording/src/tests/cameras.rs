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

#[derive(Clone)]
pub(super) struct Topic {
    pub(super) topic: &'static str,
    pub(super) schema: &'static str,
    pub(super) data: Vec<u8>,
}

pub(super) fn encoded(message: &impl Serialize) -> Vec<u8> {
    crate::ros::encode(message).unwrap()
}

pub(super) fn header(frame: &str) -> Header<'_> {
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
        binning: [0; 2],
        region: Default::default(),
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
pub(super) fn two_cameras(further: Vec<Topic>) -> Vec<Topic> {
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

pub(super) fn open(topics: &[Topic], options: &RecordingOptions<'_>) -> Result<RecordingSource, String> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = mcap::WriteOptions::new().compression(None).create(&mut bytes).unwrap();
    for (at, message) in topics.iter().enumerate() {
        let schema = writer.add_schema(message.schema, "ros2msg", b"").unwrap();
        let channel_id = writer.add_channel(schema, message.topic, "cdr", &Default::default()).unwrap();
        let time = at as u64;
        let header = MessageHeader { channel_id, sequence: at as u32, log_time: time, publish_time: time };
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
