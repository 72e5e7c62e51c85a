//! A run that starts in the map of an earlier run, in the simulated room.

use rayon::prelude::*;
use tessera_geometry::{Pose, translation_rotation_norms};
use tessera_offline::{Method, RawFrame, Records, Run, SavedMap};
use tessera_slam::{AlignRecord, FrameRecord, State};
use tessera_sources::{SceneName, SimulatedSource, SimulationOptions, Source};

const FIRST_PART: u64 = 150;

fn scene(name: SceneName) -> SimulatedSource {
    SimulatedSource::open(name, None, None, &SimulationOptions::default()).unwrap()
}

fn frame(source: &SimulatedSource, index: u64) -> RawFrame {
    RawFrame::read(source, index).unwrap()
}

fn push_all(run: &mut Run, source: &SimulatedSource, indices: &[u64]) {
    for some in indices.chunks(16) {
        let frames: Vec<RawFrame> = some.par_iter().map(|&index| frame(source, index)).collect();
        frames.iter().for_each(|frame| drop(run.push(frame)));
    }
}

/// The map of the room's first part.
fn first_part(source: &SimulatedSource) -> SavedMap {
    let mut run = Run::new(source.camera(), &Method::default()).unwrap();
    push_all(&mut run, source, &(0..FIRST_PART).collect::<Vec<_>>());
    run.finish_with_map().1
}

/// Tracking within 30 frames and from then on, to 0.02 m and 1 degree of the truth in the map's
/// frame, by the final trajectory too.
fn assert_found(records: &Records, source: &SimulatedSource, indices: &[u64]) {
    let truth = &source.ground_truth().unwrap().poses;
    let map_from_world = truth[0].inverse();
    let frames: Vec<&FrameRecord> = records.frames().collect();
    assert_eq!(frames.len(), indices.len());
    let found = frames.iter().position(|f| f.state == State::Tracking);
    let found = found.unwrap_or_else(|| panic!("never found: {}", frames[frames.len() - 1].reason()));
    assert!(found <= 30, "found after {found} frames");
    let last = records.last();
    for (k, frame) in frames.iter().enumerate().skip(found) {
        assert_eq!(frame.state, State::Tracking, "frame {k}: {}", frame.reason());
        let truth = map_from_world * truth[indices[k] as usize];
        for (what, pose) in [("online", Pose::from(&frame.pose.world_from_camera)), ("final", last.poses[k])]
        {
            let (m, r) = translation_rotation_norms(&(truth.inverse() * pose));
            assert!(m < 0.02 && r.to_degrees() < 1.0, "frame {k}, {what}: off by {m} m, {r} rad");
        }
    }
    for frame in frames.iter().filter(|f| f.state != State::Tracking) {
        assert!(
            frame.change.new_keyframe.is_none()
                && frame.change.request.is_none()
                && !frame.reason().is_empty()
        );
    }
}

#[test]
fn a_start_in_the_middle_of_the_map_is_found_and_the_map_grows() {
    let source = scene(SceneName::Room);
    let map = first_part(&source);
    let n_map = map.keyframes.len();
    let origin = map.keyframes[0].world_from_camera;
    let mut run = Run::in_map(source.camera(), &Method::default(), map, None).unwrap();
    let indices: Vec<u64> = (75..FIRST_PART + 60).collect();
    push_all(&mut run, &source, &indices);
    let (records, extended) = run.finish_with_map();
    assert_found(&records, &source, &indices);
    let new = &extended.keyframes[n_map..];
    assert!(new.len() > 3 && new.iter().all(|k| k.session == 1));
    assert_eq!(new[0].id as usize, n_map);
    assert!(new[0].edges.iter().any(|e| (e.to as usize) < n_map), "joined to the map");
    // The old map holds the frame of reference.
    assert_eq!(extended.keyframes[0].world_from_camera, origin);
    assert_eq!(extended.surfaces.len(), extended.keyframes.len());
    // And so on: a third run, in the map of two.
    let n_two = extended.keyframes.len();
    let mut run = Run::in_map(source.camera(), &Method::default(), extended, None).unwrap();
    let indices: Vec<u64> = (FIRST_PART + 30..FIRST_PART + 70).collect();
    push_all(&mut run, &source, &indices);
    let (records, extended) = run.finish_with_map();
    assert_found(&records, &source, &indices);
    assert!(extended.keyframes[n_two..].iter().all(|k| k.session == 2));
}

#[test]
fn starts_all_along_the_path_are_found() {
    let source = scene(SceneName::Room);
    let map = first_part(&source);
    for start in [10, 40, 100, 130] {
        let map = SavedMap {
            surfaces: map.surfaces.clone(),
            submaps: map.submaps.clone(),
            keyframes: map.keyframes.clone(),
            features: Vec::new(),
            cameras: Vec::new(),
        };
        let mut run = Run::in_map(source.camera(), &Method::default(), map, None).unwrap();
        let indices: Vec<u64> = (start..start + 32).collect();
        push_all(&mut run, &source, &indices);
        assert_found(&run.finish(), &source, &indices);
    }
}

#[test]
fn a_start_that_is_said_is_believed_where_it_fits() {
    let source = scene(SceneName::Room);
    let map = first_part(&source);
    let truth = &source.ground_truth().unwrap().poses;
    let start = truth[0].inverse() * truth[60] * Pose::translation(0.05, 0.0, 0.02);
    // Without recognition: nothing else can find it.
    let mut method = Method::default();
    method.mapping.relocalise.n_recognised = 0;
    let mut run = Run::in_map(source.camera(), &method, map, Some(start)).unwrap();
    let indices: Vec<u64> = (60..75).collect();
    push_all(&mut run, &source, &indices);
    let records = run.finish();
    assert_found(&records, &source, &indices);
    assert!(records.frames().next().unwrap().reason().contains("the start"));
}

#[test]
fn a_run_elsewhere_is_lost_and_leaves_the_map_as_it_is() {
    let (room, house) = (scene(SceneName::Room), scene(SceneName::House));
    let map = first_part(&room);
    let before = map.keyframes.clone();
    let mut run = Run::in_map(room.camera(), &Method::default(), map, None).unwrap();
    push_all(&mut run, &house, &(0..15).map(|k| 200 + 10 * k).collect::<Vec<_>>());
    let (records, map) = run.finish_with_map();
    assert!(records.frames().all(|f| f.state == State::Lost));
    assert_eq!(map.keyframes, before);
    let n_corrections = records.records.iter().filter(|r| matches!(r, AlignRecord::Correction(_))).count();
    assert_eq!(n_corrections, 0, "there is nothing to optimise");
}

#[test]
fn a_run_that_only_localises_tracks_in_the_map_and_adds_nothing_to_it() {
    let source = scene(SceneName::Room);
    let map = first_part(&source);
    let before = map.keyframes.clone();
    let mut method = Method::default();
    method.mapping.only_localise = true;
    let mut run = Run::in_map(source.camera(), &method, map, None).unwrap();
    let indices: Vec<u64> = (40..FIRST_PART - 10).collect();
    push_all(&mut run, &source, &indices);
    let (records, after) = run.finish_with_map();
    assert_found(&records, &source, &indices);
    assert_eq!(after.keyframes, before);
    assert_eq!(after.surfaces.len(), before.len());
    assert!(!records.records.iter().any(|record| matches!(record, AlignRecord::Correction(_))));
    let stated = |frame: &FrameRecord| frame.state != State::Tracking || !frame.pose.covariance.is_empty();
    assert!(records.frames().all(|frame| frame.change.request.is_none() && stated(frame)));
}
