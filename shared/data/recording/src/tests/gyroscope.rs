//! Angular rates beside the images, as of a RealSense D435i.

use super::*;
use crate::ros::{CameraInfo, Header, RosPose, Time, TransformStamped, Transforms, encode};
use nalgebra::Vector3;

const GYRO: &str = "/camera/gyro/sample";
const N_FRAMES: i64 = 5;

fn header(nanos: i64, frame: &str) -> Header<'_> {
    Header { stamp: Time::from_nanos(nanos), frame_id: frame.into() }
}

fn camera() -> Vec<u8> {
    let info = CameraInfo {
        header: header(0, "depth_optical"),
        height: SIZE.1,
        width: SIZE.0,
        distortion_model: "plumb_bob".into(),
        d: vec![0.0; 5],
        k: [20.0, 0.0, 9.5, 0.0, 20.0, 7.5, 0.0, 0.0, 1.0],
        r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: [20.0, 0.0, 9.5, 0.0, 0.0, 20.0, 7.5, 0.0, 0.0, 0.0, 1.0, 0.0],
    };
    encode(&info).unwrap()
}

/// The instrument is turned by a quarter about the camera's z.
fn transforms() -> Vec<u8> {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let link = |child: &'static str, orientation_xyzw| TransformStamped {
        header: header(0, "camera_link"),
        child_frame_id: child.into(),
        transform: RosPose { position: [0.01, 0.0, 0.0], orientation_xyzw },
    };
    let links = [link("depth_optical", [0.0, 0.0, 0.0, 1.0]), link("gyro_optical", [0.0, 0.0, half, half])];
    encode(&Transforms { transforms: links.to_vec() }).unwrap()
}

fn rate(nanos: i64, frame: &str, angular_velocity: [f64; 3]) -> Vec<u8> {
    let front = crate::ros::ImuFront {
        header: header(nanos, frame),
        orientation: [0.0; 4],
        orientation_covariance: [0.0; 9],
        angular_velocity,
    };
    let mut bytes = encode(&front).unwrap();
    bytes.resize(bytes.len() + 21 * 8, 0);
    bytes
}

/// Frames of a tenth of a second from `begin_s` on, and samples of a rate about the instrument's x from 1 s on.
fn bag(begin_s: i64, has_transforms: bool, angular_velocity: [f64; 3]) -> Result<RecordingSource, String> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = mcap::WriteOptions::new().compression(None).create(&mut bytes).unwrap();
    let mut channel = |topic: &str, schema: &str| {
        let schema = writer.add_schema(schema, "ros2msg", b"").unwrap();
        writer.add_channel(schema, topic, "cdr", &Default::default()).unwrap()
    };
    let depth = channel("/camera/depth/image_rect_raw", "sensor_msgs/msg/Image");
    let info = channel("/camera/depth/camera_info", "sensor_msgs/msg/CameraInfo");
    let imu = channel(GYRO, "sensor_msgs/msg/Imu");
    let still = channel("/tf_static", "tf2_msgs/msg/TFMessage");
    let mut write = |channel_id, nanos: i64, data: &[u8]| {
        let time = nanos as u64;
        let header = MessageHeader { channel_id, sequence: 0, log_time: time, publish_time: time };
        writer.write_to_known_channel(&header, data).unwrap();
    };
    write(info, 1, &camera());
    if has_transforms {
        write(still, 1, &transforms());
    }
    for k in 0..60 {
        let nanos = 1_000_000_000 + 10_000_000 * k;
        write(imu, nanos, &rate(nanos, "gyro_optical", angular_velocity));
    }
    for k in 0..N_FRAMES {
        let stamp = [begin_s as u32, 100_000_000 * k as u32];
        write(depth, 1_000_000_000 * begin_s + 100_000_000 * k, &image_at(stamp, "16UC1", 2, 4));
    }
    writer.finish().unwrap();
    drop(writer);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    std::fs::write(&path, bytes.into_inner()).unwrap();
    RecordingSource::open(&path, &RecordingOptions::default(), None).map_err(|error| error.to_string())
}

fn rotation(source: &RecordingSource, index: u64) -> Option<InertialRotation> {
    read(source, index).2.rotation
}

#[test]
fn rates_are_turned_into_the_camera_and_integrated_between_frames() {
    let source = bag(1, true, [0.5, 0.0, 0.0]).unwrap();
    assert!(source.description().contains(&("gyroscope", format!("{GYRO}, 60 samples"))));
    let (first, last) = (rotation(&source, 0).unwrap(), rotation(&source, 4).unwrap());
    let turned = first.until(&last, 0.4);
    // About the instrument's x, which is the camera's y.
    let found = turned.earlier_from_later.scaled_axis();
    assert!((found - Vector3::new(0.0, 0.2, 0.0)).norm() < 1e-9, "{found}");
    assert!(turned.sigma_rad < 0.01);
    assert_eq!(source.angular_rates().len(), 60);
}

#[test]
fn rates_that_cannot_be_used_are_named_and_left_out() {
    for (source, expected) in [
        (bag(1, false, [0.5, 0.0, 0.0]), "nothing says how 'gyro_optical' is turned from 'depth_optical'"),
        (bag(7, true, [0.5, 0.0, 0.0]), "covers the times of 0 of 5 depth images"),
        (bag(1, true, [0.0; 3]), "all its angular rates are 0"),
        (bag(1, true, [f64::NAN, 0.0, 0.0]), "60 of 60 messages have no angular rate"),
    ] {
        let source = source.unwrap();
        assert!(rotation(&source, 0).is_none());
        let words = source.warnings().join("; ");
        assert!(words.contains(GYRO) && words.contains(expected), "{words}");
    }
}
