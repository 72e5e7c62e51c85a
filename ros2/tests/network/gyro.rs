//! The gyroscope and the accelerometer of the network are those of the run.

use crate::common::{Network, Setup};
use crate::images::{base_from_camera, pose, room};
use nalgebra::{UnitQuaternion, Vector3};
use tessera_journal::Follower;
use tessera_slam::{AlignRecord, FrameRecord};
use tessera_stage::ALIGN_JOURNAL;

/// Of `camera.py`: the rate about the axes of the instrument, and how that stands on the base.
const RATE: [f64; 3] = [0.2, -0.1, 0.4];
const BASE_FROM_IMU: [f64; 7] = [0.0, 0.1, 0.0, 0.0, 0.0, 0.6, 0.8];

fn frames(setup: &Setup) -> Vec<FrameRecord> {
    let mut journal = Follower::open(&setup.out().join("align.journal"), ALIGN_JOURNAL).unwrap();
    let mut frames: Vec<FrameRecord> = Vec::new();
    while let Some(record) = journal.next().unwrap() {
        if let AlignRecord::Frame(frame) = record {
            frames.push(*frame);
        }
    }
    frames
}

#[test]
fn a_robot_on_a_ramp_has_a_level_map() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(20);
    room(setup.frames());
    // The camera first, so that its IMU is heard before the first image of the run.
    let camera = network.camera(&setup, &["--imu", "--still"]);
    let run = setup.start_with(&["--set", "mapping.world_up=gravity"]);
    let ros2 = network.join(&setup, &["--imu-topic", "/imu"]);
    setup.finish(run);
    let words = ros2.finish();
    drop(camera);
    let first = &frames(&setup)[0];
    assert!(first.reason().contains("levelled by gravity"), "{}\n{words}", first.reason());
    // Of `camera.py`: along the axes of the instrument.
    let up = base_from_camera().rotation.inverse()
        * (pose(&BASE_FROM_IMU).rotation * Vector3::new(1.0, 0.0, 9.76).normalize());
    let world_from_camera = tessera_geometry::Pose::from(&first.pose.world_from_camera).rotation;
    let up_in_world = world_from_camera * up;
    assert!((up_in_world + Vector3::y()).norm() < 1e-6, "{up_in_world}\n{words}");
    assert!(world_from_camera.angle_to(&UnitQuaternion::identity()) > 0.09);
}

#[test]
fn each_frame_has_the_rotation_that_the_gyroscope_measured() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(40);
    room(setup.frames());
    // The camera does not turn as this instrument says, by less than a degree from image to image.
    let run = setup.start();
    let ros2 = network.join(&setup, &["--imu-topic", "/imu"]);
    let camera = network.camera(&setup, &["--imu"]);
    setup.finish(run);
    let words = ros2.finish();
    drop(camera);
    let frames = frames(&setup);
    let camera_from_imu = base_from_camera().rotation.inverse() * pose(&BASE_FROM_IMU).rotation;
    let rate = camera_from_imu * Vector3::from(RATE);
    let mut n_compared = 0;
    for pair in frames.windows(2) {
        let (Some(earlier), Some(later)) = (pair[0].pose.rotation, pair[1].pose.rotation) else { continue };
        let seconds = (pair[1].stamp_nanos - pair[0].stamp_nanos) as f64 * 1e-9;
        let measured = earlier.until(&later, seconds);
        // Between the images of before and after a gap nothing is known.
        if measured.sigma_rad > 0.1 {
            continue;
        }
        let turned = measured.earlier_from_later.scaled_axis();
        assert!(
            (turned - rate * seconds).norm() < 1e-6,
            "{turned} in {seconds} s, expected {}",
            rate * seconds
        );
        n_compared += 1;
    }
    assert!(n_compared >= 20, "{n_compared} of {} frames\n{words}", frames.len());
}
