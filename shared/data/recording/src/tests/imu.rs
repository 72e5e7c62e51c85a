//! The IMU of a recording: of one topic or of two, about other axes than the camera's.

use super::cameras::{Topic, encoded, header, open, two_cameras};
use super::*;
use crate::ros::{Imu, RosPose, TransformStamped, Transforms};
use nalgebra::Vector3;

const IMU: &str = "sensor_msgs/msg/Imu";

fn message(topic: &'static str, frame: &str, nanos: i64, rate: [f64; 3], force: [f64; 3]) -> Topic {
    let message = Imu {
        header: crate::ros::Header { stamp: crate::ros::Time::from_nanos(nanos), frame_id: frame.into() },
        orientation: [0.0, 0.0, 0.0, 1.0],
        orientation_covariance: [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        angular_velocity: rate,
        angular_velocity_covariance: [0.0; 9],
        linear_acceleration: force,
        linear_acceleration_covariance: [0.0; 9],
    };
    Topic { topic, schema: IMU, data: encoded(&message) }
}

/// The instrument's x is the camera's z, its y the camera's x, its z the camera's y.
fn placed() -> Topic {
    let link = TransformStamped {
        header: header("depth_optical"),
        child_frame_id: "imu".into(),
        transform: RosPose { position: [0.0; 3], orientation_xyzw: [-0.5, -0.5, -0.5, 0.5] },
    };
    let message = Transforms { transforms: vec![link] };
    Topic { topic: "/tf_static", schema: "tf2_msgs/msg/TFMessage", data: encoded(&message) }
}

/// A recording without colour: its camera stands nowhere.
fn written(topics: Vec<Topic>) -> RecordingSource {
    let options = RecordingOptions { is_without_colour: true, ..RecordingOptions::default() };
    open(&two_cameras(topics), &options).unwrap()
}

/// Two seconds around the images, at 100 Hz; the camera's y points down.
fn measured(of: impl Fn(i64) -> Vec<Topic>) -> Vec<Topic> {
    (0..200).flat_map(|k| of(k * 10_000_000)).collect()
}

#[test]
fn rates_and_forces_are_turned_into_the_camera_s_axes() {
    let (rate, force, none) = ([0.0, 0.0, 0.5], [0.0, 0.0, -9.81], [0.0; 3]);
    let one = measured(|t| vec![message("/camera/camera/imu", "imu", t, rate, force)]);
    let two = measured(|t| {
        vec![
            message("/camera/camera/gyro/sample", "imu", t, rate, none),
            message("/camera/camera/accel/sample", "imu", t + 3_000_000, none, force),
        ]
    });
    // Another one, of the robot, is not asked.
    let base = measured(|t| vec![message("/base/imu", "nowhere", t, [9.0; 3], force)]);
    for mut topics in [one, two] {
        topics.extend(base.iter().cloned());
        topics.push(placed());
        let source = written(topics);
        assert_eq!(source.warnings(), &[] as &[String]);
        let (_, _, info) = read(&source, 0);
        let up = info.up.unwrap();
        assert!((Vector3::from(up.in_camera) + Vector3::y()).norm() < 1e-9, "{up:?}");
        assert!(up.sigma_rad < 0.05, "{up:?}");
        assert!(info.rotation.is_some());
        let imu = source.imu.rates[0].rate_rad_per_s;
        assert!((imu - Vector3::y() * 0.5).norm() < 1e-9, "{imu}");
        let words = source.description().into_iter().find(|(name, _)| *name == "imu").unwrap().1;
        assert!(words.starts_with("gyroscope and accelerometer of /camera/camera/"), "{words}");
    }
}

#[test]
fn what_cannot_be_used_is_told() {
    let topics = |rate| measured(move |t| vec![message("/imu", "imu", t, rate, [0.0, 0.0, 9.81])]);
    let source = written(topics([0.1; 3]));
    let words = &source.warnings()[0];
    assert!(words.contains("no way from \"imu\" to \"depth_optical\": the IMU is left out"), "{words}");
    assert_eq!((read(&source, 0).2.up, read(&source, 0).2.rotation), (None, None));
    let mut wrong = topics([f64::NAN; 3]);
    wrong.push(placed());
    let source = written(wrong);
    let words = &source.warnings()[0];
    assert!(words.contains("200 messages of the IMU are left out, the first: "), "{words}");
    assert!(words.contains("angular_velocity in rad/s is [NaN, NaN, NaN], expected at most 100"), "{words}");
}
