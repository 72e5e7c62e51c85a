//! A camera that halves its rate, changes its exposure, vanishes, and comes back at another place.

use tessera_geometry::{Pose, translation_rotation_norms};
use tessera_offline::{Method, RawFrame, Run};
use tessera_slam::State;
use tessera_sources::{SceneName, SimulatedSource, SimulationOptions, Source};

const FRAME_NANOS: i64 = 33_333_333;

/// What the camera does: image of the room, time since the last one in images, and exposure.
type Shot = (u64, i64, f64);

/// Online poses and states of a run over these images, with the error of each in the map's frame.
fn errors(shots: &[Shot]) -> Vec<(State, f64, f64)> {
    let source = SimulatedSource::open(SceneName::Room, None, None, &SimulationOptions::default()).unwrap();
    let mut run = Run::new(source.camera(), &Method::default()).unwrap();
    let mut stamp_nanos = 0;
    for (index, since, exposure) in shots {
        let mut frame = RawFrame::read(&source, *index).unwrap();
        stamp_nanos += since * FRAME_NANOS;
        frame.stamp_nanos = stamp_nanos;
        for byte in frame.colour.iter_mut().flatten() {
            *byte = (f64::from(*byte) * exposure).min(255.0) as u8;
        }
        run.push(&frame);
    }
    let truth = &source.ground_truth().unwrap().poses;
    let first = truth[shots[0].0 as usize];
    let records = run.stop();
    let frames = records.frames().zip(shots);
    frames
        .map(|(frame, (index, ..))| {
            let expected = first.inverse() * truth[*index as usize];
            let error = Pose::from(&frame.pose.world_from_camera).inverse() * expected;
            let (metres, radians) = translation_rotation_norms(&error);
            (frame.state, metres, radians)
        })
        .collect()
}

fn assert_tracked(what: &str, errors: &[(State, f64, f64)]) {
    for (at, (state, metres, radians)) in errors.iter().enumerate() {
        assert!(
            *state == State::Tracking && *metres < 0.03 && *radians < 0.02,
            "{what}, image {at}: {state:?}, {metres} m, {radians} rad"
        );
    }
}

#[test]
fn half_the_rate_and_other_exposures_lose_nothing() {
    let mut shots: Vec<Shot> = (0..45).map(|index| (index, 1, 1.0)).collect();
    // 15 Hz, and back to 30.
    shots.extend((46..92).step_by(2).map(|index| (index, 2, 1.0)));
    shots.extend((91..105).map(|index| (index, 1, 1.0)));
    // Into the dark, all at once; a lamp; and automatic exposure on its way back.
    shots.extend((105..120).map(|index| (index, 1, 0.35)));
    shots.extend((120..135).map(|index| (index, 1, 1.8)));
    shots.extend((135..150).map(|index| (index, 1, 1.8 - 0.8 * (index - 135) as f64 / 15.0)));
    assert_tracked("unsteady", &errors(&shots));
}

#[test]
fn a_camera_that_vanishes_is_found_again_where_it_comes_back() {
    let mut shots: Vec<Shot> = (0..90).map(|index| (index, 1, 1.0)).collect();
    // Pulled out for three seconds and put in again where the robot was before, darker.
    shots.push((40, 90, 0.6));
    shots.extend((41..80).map(|index| (index, 1, 0.6)));
    let found = errors(&shots);
    assert_tracked("before", &found[..90]);
    let n_sought = found[90..].iter().take_while(|(state, ..)| *state != State::Tracking).count();
    assert!(n_sought <= 10, "{n_sought} images until it was found");
    assert_tracked("after", &found[90 + n_sought..]);
}

#[test]
fn images_without_depth_cost_themselves_alone() {
    let source = SimulatedSource::open(SceneName::Room, None, None, &SimulationOptions::default()).unwrap();
    let mut run = Run::new(source.camera(), &Method::default()).unwrap();
    // One alone, and three in a row.
    let is_empty = |index: u64| index == 40 || (60..63).contains(&index);
    for index in 0..90 {
        let mut frame = RawFrame::read(&source, index).unwrap();
        if is_empty(index) {
            frame.depth.fill(0);
        }
        run.push(&frame);
    }
    let records = run.stop();
    let lost: Vec<u64> =
        records.frames().filter(|frame| frame.state != State::Tracking).map(|frame| frame.index).collect();
    assert_eq!(lost, (0..90).filter(|index| is_empty(*index)).collect::<Vec<_>>());
}
