//! A camera that loses its place and finds it again, in the simulated room.

mod common;

use common::{Step, step_frame as frame};
use rayon::prelude::*;
use tessera_geometry::{Pose, translation_rotation_norms};
use tessera_offline::{Method, RawFrame, Run};
use tessera_slam::{AlignRecord, FrameRecord, State};
use tessera_sources::{SceneName, SimulatedSource, SimulationOptions, Source};

fn scene(name: SceneName) -> SimulatedSource {
    SimulatedSource::open(name, None, None, &SimulationOptions::default()).unwrap()
}

/// Runs the steps and returns each frame's record with its true pose in the map.
fn run(source: &SimulatedSource, steps: &[Step]) -> Vec<(FrameRecord, Option<Pose>)> {
    let mut run = Run::new(source.camera(), &Method::default()).unwrap();
    let numbered: Vec<(usize, Step)> = steps.iter().copied().enumerate().collect();
    for some in numbered.chunks(16) {
        let frames: Vec<RawFrame> = some.par_iter().map(|&(k, step)| frame(source, k, step)).collect();
        frames.iter().for_each(|frame| drop(run.push(frame)));
    }
    let records = run.finish();
    let truth = &source.ground_truth().unwrap().poses;
    let first = steps.iter().find_map(|s| if let Step::See(index) = s { Some(*index) } else { None });
    let map_from_world = truth[first.unwrap() as usize].inverse();
    let frames = records.records.into_iter().filter_map(|record| match record {
        AlignRecord::Frame(frame) => Some(*frame),
        _ => None,
    });
    frames
        .zip(steps)
        .map(|(frame, step)| match step {
            Step::See(index) => (frame, Some(map_from_world * truth[*index as usize])),
            Step::Covered => (frame, None),
        })
        .collect()
}

/// From frame `from` on: tracking again within 30 frames, to 0.02 m and 1 degree, for good; while
/// not tracking no keyframe and no request is made.
fn assert_recovers(frames: &[(FrameRecord, Option<Pose>)], from: usize) {
    for (frame, _) in frames.iter().filter(|(f, _)| f.state != State::Tracking) {
        assert!(
            frame.change.new_keyframe.is_none() && frame.change.request.is_none(),
            "frame {}",
            frame.index
        );
        assert!(!frame.reason().is_empty());
    }
    let found = frames[from..].iter().position(|(f, _)| f.state == State::Tracking);
    let found =
        from + found.unwrap_or_else(|| panic!("never found: {}", frames[frames.len() - 1].0.reason()));
    assert!(found - from <= 30, "found after {} frames", found - from);
    for (frame, truth) in &frames[found..] {
        assert_eq!(frame.state, State::Tracking, "frame {}: {}", frame.index, frame.reason());
        let Some(truth) = truth else { continue };
        let (m, r) =
            translation_rotation_norms(&(truth.inverse() * Pose::from(&frame.pose.world_from_camera)));
        assert!(m < 0.02 && r.to_degrees() < 1.0, "frame {}: off by {m} m, {r} rad", frame.index);
    }
}

/// Metres and degrees between two frames.
fn jump(source: &SimulatedSource, a: u64, b: u64) -> (f64, f64) {
    let truth = &source.ground_truth().unwrap().poses;
    let (m, r) = translation_rotation_norms(&(truth[a as usize].inverse() * truth[b as usize]));
    (m, r.to_degrees())
}

#[test]
fn a_lens_covered_for_two_seconds() {
    let mut steps: Vec<Step> = (0..50).map(Step::See).collect();
    steps.extend([Step::Covered; 60]);
    steps.extend((46..80).map(Step::See));
    let frames = run(&scene(SceneName::Room), &steps);
    assert!(frames[50..110].iter().all(|(f, _)| f.state == State::Lost));
    assert_recovers(&frames, 110);
}

#[test]
fn a_jump_back_to_a_place_seen_before() {
    let source = scene(SceneName::Room);
    let (metres, degrees) = jump(&source, 119, 5);
    assert!(metres > 0.7 && degrees > 90.0, "{metres} m, {degrees} deg");
    let steps: Vec<Step> = (0..120).chain(5..45).map(Step::See).collect();
    assert_recovers(&run(&source, &steps), 121);
}

#[test]
fn a_jump_ahead_to_a_view_that_only_overlaps() {
    let source = scene(SceneName::Room);
    let to = (31..).find(|to| jump(&source, 30, *to).1 >= 30.0).unwrap();
    let steps: Vec<Step> = (0..=30).chain(to..to + 35).map(Step::See).collect();
    assert_recovers(&run(&source, &steps), 32);
}

#[test]
fn a_jump_of_a_metre_and_forty_degrees() {
    let source = scene(SceneName::House);
    let n = source.ground_truth().unwrap().poses.len() as u64;
    let (from, to) = (20..n - 40)
        .flat_map(|from| (from..n - 40).map(move |to| (from, to)))
        .find(|&(from, to)| {
            let (metres, degrees) = jump(&source, from, to);
            (1.0..1.2).contains(&metres) && (40.0..45.0).contains(&degrees)
        })
        .unwrap();
    // Back from there: what lies around frame `from` has been seen.
    let steps: Vec<Step> = (from - 20..=to).chain(from..from + 40).map(Step::See).collect();
    let n_before = (to - from + 21) as usize;
    let frames: Vec<_> = run(&source, &steps);
    assert_recovers(&frames, n_before + 1);
}

#[test]
fn a_place_that_is_not_in_the_map_is_not_found() {
    let (room, house) = (scene(SceneName::Room), scene(SceneName::House));
    let mut run = Run::new(room.camera(), &Method::default()).unwrap();
    for k in 0..30 {
        run.push(&frame(&room, k, Step::See(k as u64)));
    }
    for k in 0..15 {
        run.push(&frame(&house, 30 + k, Step::See(200 + 10 * k as u64)));
    }
    let records = run.finish();
    let states: Vec<State> = records.frames().map(|f| f.state).collect();
    assert!(states[..30].iter().all(|s| *s == State::Tracking));
    assert!(states[30..].iter().all(|s| *s == State::Lost), "{states:?}");
}
