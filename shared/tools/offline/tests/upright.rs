//! A world that stands upright, whatever the tilt of the camera at the start.

use nalgebra::Vector3;
use tessera_geometry::Pose;
use tessera_offline::{Method, RawFrame, Run};
use tessera_slam::WorldUp;
use tessera_sources::{SceneName, SimulatedSource, SimulationOptions, Source};

const UP: Vector3<f64> = Vector3::new(0.0, -1.0, 0.0);

/// Tilt of the world after the first frames of a run, by the truth, radians, and the reason of the first frame.
fn tilt_rad(options: &SimulationOptions, world_up: WorldUp, without_up: bool) -> (f64, String) {
    let source = SimulatedSource::open(SceneName::Room, None, Some(150), options).unwrap();
    let mut method = Method::default();
    method.mapping.world_up = world_up;
    let mut run = Run::new(source.camera(), &method).unwrap();
    for index in 0..8 {
        let mut frame = RawFrame::read(&source, index).unwrap();
        frame.up = frame.up.filter(|_| !without_up);
        run.push(&frame);
    }
    let truth = &source.ground_truth().unwrap().poses;
    let records = run.stop();
    let last = records.frames().last().unwrap();
    // The truth has z up.
    let camera_from_world = truth[7].rotation.inverse();
    let up_in_world = Pose::from(&last.pose.world_from_camera).rotation * (camera_from_world * Vector3::z());
    (up_in_world.angle(&UP), records.frames().next().unwrap().reason())
}

#[test]
fn a_tilted_start_is_levelled_within_its_stated_deviation() {
    for seed in [1, 2, 3] {
        let options = SimulationOptions { imu: true, seed, ..SimulationOptions::default() };
        // The camera looks down by 14 degrees.
        let (as_today, reason) = tilt_rad(&options, WorldUp::Camera, false);
        assert!(as_today > 0.2, "{as_today}");
        assert_eq!(reason, "the first frame");
        let (tilt, reason) = tilt_rad(&options, WorldUp::Gravity, false);
        let stated: f64 = reason.split_whitespace().rev().nth(1).unwrap().parse().unwrap();
        assert!(reason.contains("levelled by gravity, within "), "{reason}");
        // Two axes.
        assert!(tilt < 3.0 * stated.to_radians() && stated < 2.0, "{tilt} rad, {reason}");
        let (tilt, reason) = tilt_rad(&options, WorldUp::Gravity, true);
        assert_eq!(reason, "the first frame; levelled by the floor, within 1.1 deg");
        assert!(tilt < 0.04, "{tilt} rad by the floor");
    }
}

#[test]
fn a_camera_that_sees_a_wall_alone_keeps_its_axes() {
    let source =
        SimulatedSource::open(SceneName::Wall, None, Some(4), &SimulationOptions::default()).unwrap();
    let mut method = Method::default();
    method.mapping.world_up = WorldUp::Gravity;
    let mut run = Run::new(source.camera(), &method).unwrap();
    run.push(&RawFrame::read(&source, 0).unwrap());
    let records = run.stop();
    let first = records.frames().next().unwrap();
    assert_eq!(Pose::from(&first.pose.world_from_camera), Pose::identity());
    assert!(first.reason().contains("not levelled: gravity was not measured"), "{}", first.reason());
}
