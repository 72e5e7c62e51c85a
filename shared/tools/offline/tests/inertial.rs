//! What a gyroscope is worth where the surfaces say little, or the camera turns fast.

mod common;

use common::surfaces_alone;
use rayon::prelude::*;
use tessera_geometry::{Pose, log, translation_rotation_norms};
use tessera_offline::{RawFrame, Run};
use tessera_slam::{FrameRecord, State};
use tessera_sources::{SceneName, SimulatedSource, SimulationOptions, Source};

/// Every `every`th frame of a scene, online, with the true poses in the map's frame; without the gyroscope's rotations
/// where these are not given.
fn online(
    name: SceneName,
    options: &SimulationOptions,
    has_rotation: bool,
    n_frames: u64,
    every: u64,
) -> Vec<(FrameRecord, Pose)> {
    let source = SimulatedSource::open(name, None, None, options).unwrap();
    let mut run = Run::new(source.camera(), &surfaces_alone()).unwrap();
    let indices: Vec<u64> = (0..n_frames).map(|k| k * every).collect();
    for some in indices.chunks(16) {
        let read = |&index: &u64| {
            let frame = RawFrame::read(&source, index).unwrap();
            RawFrame { rotation: frame.rotation.filter(|_| has_rotation), ..frame }
        };
        let frames: Vec<RawFrame> = some.par_iter().map(read).collect();
        frames.iter().for_each(|frame| drop(run.push(frame)));
    }
    let truth = &source.ground_truth().unwrap().poses;
    let records = run.stop();
    let frames = records.frames().zip(&indices);
    frames.map(|(f, &index)| (f.clone(), truth[0].inverse() * truth[index as usize])).collect()
}

fn with_imu(speed: f64) -> SimulationOptions {
    SimulationOptions { imu: true, speed, ..SimulationOptions::default() }
}

fn rotation_errors_rad(frames: &[(FrameRecord, Pose)]) -> Vec<f64> {
    frames
        .iter()
        .map(|(f, truth)| (Pose::from(&f.pose.world_from_camera).inverse() * truth).rotation.angle())
        .collect()
}

#[test]
fn on_a_wall_the_turn_about_its_normal_is_the_gyroscope_s() {
    // A constant error of 0.009 rad/s would be most of what is left after two seconds.
    let options = SimulationOptions { imu_bias_sigma_rad_per_s: 0.002, ..with_imu(1.0) };
    let worst = |has_rotation: bool| {
        let frames = online(SceneName::Wall, &options, has_rotation, 60, 1);
        let errors = rotation_errors_rad(&frames);
        let worst = errors.iter().copied().fold(0.0, f64::max);
        (worst, frames)
    };
    let (without, _) = worst(false);
    let (with, frames) = worst(true);
    assert!(with < 0.3 * without, "{with} rad, {without} rad without");
    // The covariance says how well the turn is known now.
    let within = frames.iter().skip(1).filter(|(f, truth)| {
        let error = log(&(Pose::from(&f.pose.world_from_camera).inverse() * truth)).to_vector();
        [15, 18, 20].into_iter().zip(3..6).all(|(at, k)| error[k].abs() <= 3.0 * f.pose.covariance[at].sqrt())
    });
    assert!(within.count() * 100 >= 95 * 59);
}

#[test]
fn a_camera_that_turns_too_fast_for_its_surfaces_is_kept() {
    // 2.5 frames a second: 12 degrees and more from frame to frame, and no look about.
    let n_good = |has_rotation: bool| {
        let frames = online(SceneName::Room, &with_imu(1.0), has_rotation, 28, 12);
        let good = frames.iter().filter(|(f, truth)| {
            let error = Pose::from(&f.pose.world_from_camera).inverse() * truth;
            let (metres, radians) = translation_rotation_norms(&error);
            f.state == State::Tracking && metres < 0.03 && radians < 0.02
        });
        good.count()
    };
    let (with, without) = (n_good(true), n_good(false));
    assert!(with >= 18 && without < 9, "{with} of 28 frames, {without} without");
}

#[test]
fn where_it_gives_nothing_no_bit_changes() {
    let still = SimulationOptions::default();
    let without_imu = online(SceneName::Room, &still, true, 12, 1);
    let without = online(SceneName::Room, &with_imu(1.0), false, 12, 1);
    let with = online(SceneName::Room, &with_imu(1.0), true, 12, 1);
    let poses = |frames: &[(FrameRecord, Pose)]| -> Vec<_> {
        frames.iter().map(|(f, _)| (f.pose.world_from_camera, f.pose.covariance.clone())).collect()
    };
    assert_eq!(poses(&without_imu), poses(&without));
    assert_ne!(poses(&without_imu), poses(&with));
}
