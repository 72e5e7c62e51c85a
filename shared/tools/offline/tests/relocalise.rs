//! Relocalisation that was asked for, in the simulated room.

mod common;

use common::{Step, ate_m, frames, scene, step_frame, surfaces_alone};
use tessera_geometry::{Pose, translation_rotation_norms};
use tessera_offline::{Method, Run};
use tessera_slam::{FrameRecord, State};
use tessera_sources::{SceneName, SimulatedSource, SimulationOptions, Source};

fn room() -> SimulatedSource {
    scene(SceneName::Room, &SimulationOptions::default())
}

/// Indices of the frames with which the records say that relocalisation was asked for.
fn asked<'a>(frames: impl Iterator<Item = &'a FrameRecord>) -> Vec<u64> {
    frames.filter(|frame| frame.is_relocalisation_asked()).map(|frame| frame.index).collect()
}

#[test]
fn a_camera_that_knows_its_place_finds_it_anew() {
    let source = room();
    let indices: Vec<u64> = (0..90).collect();
    let mut run = Run::new(source.camera(), &Method::default()).unwrap();
    for (index, frame) in frames(&source, &indices).iter().enumerate() {
        if [0, 60].contains(&index) {
            run.relocalise();
        }
        run.push(frame);
    }
    let records = run.finish();
    let found: Vec<&FrameRecord> = records.frames().collect();
    assert_eq!(asked(found.iter().copied()), [60], "once, though each later frame tells of it");
    assert!(found[60].reason().contains("; found by ") && !found[60].reason().contains("the last pose"));
    // Some frames that show more and more of the place, and then it is certain.
    let certain = 60 + found[60..].iter().position(|frame| frame.state == State::Tracking).unwrap();
    assert!((61..66).contains(&certain), "frame {certain}");
    for frame in &found {
        let is_sought = (60..certain as u64).contains(&frame.index);
        let expected = if is_sought { State::Relocalising } else { State::Tracking };
        assert_eq!(frame.state, expected, "frame {}: {}", frame.index, frame.reason());
        assert_eq!(frame.evidence_nats > 0.0, is_sought, "frame {}: {}", frame.index, frame.reason());
        let may_change = frame.state == State::Tracking;
        assert!(may_change || (frame.change.new_keyframe.is_none() && frame.change.request.is_none()));
    }
    assert_eq!(records.submaps().n(), 1);
    let ate = ate_m(&source, &indices, &records.last());
    assert!(ate < 0.01, "{ate} m");
}

/// The frame that asks has nothing to see: what it asks for holds until a place is found. Without features,
/// by which the place would be found before the last pose is tried.
#[test]
fn the_last_pose_is_no_candidate_until_a_place_is_found() {
    let source = room();
    // The camera stands still before it sees nothing, so that its last pose is right.
    let seen = (0..50).map(Step::See).chain([Step::See(50); 6]);
    let steps: Vec<Step> = seen.chain([Step::Covered; 12]).chain((50..80).map(Step::See)).collect();
    for asks in [false, true] {
        let mut run = Run::new(source.camera(), &surfaces_alone()).unwrap();
        for (k, &step) in steps.iter().enumerate() {
            if asks && k == 58 {
                run.relocalise();
            }
            run.push(&step_frame(&source, k, step));
        }
        let records = run.finish();
        let found: Vec<&FrameRecord> = records.frames().collect();
        assert_eq!(asked(found.iter().copied()), if asks { vec![58] } else { vec![] });
        // By the motion alone it is certain at once that a camera that stood still is where it was.
        let first = found.iter().find(|frame| frame.reason().contains("found by")).expect("it is found");
        assert_eq!(first.reason().contains("found by the last pose"), !asks, "{}", first.reason());
        let truth = &source.ground_truth().unwrap().poses;
        for frame in found.iter().filter(|frame| frame.index >= 71) {
            assert_eq!(frame.state, State::Tracking, "frame {}: {}", frame.index, frame.reason());
            let map_from_camera = truth[0].inverse() * truth[frame.index as usize - 18];
            let error = map_from_camera.inverse() * Pose::from(&frame.pose.world_from_camera);
            assert!(translation_rotation_norms(&error).0 < 0.02, "frame {}", frame.index);
        }
    }
}

/// Without an answer from the map the camera goes on in a submap, as any that is lost for a second.
#[test]
fn a_place_that_is_not_in_the_map_begins_a_submap() {
    let (room, house) = (room(), scene(SceneName::House, &SimulationOptions::default()));
    let mut run = Run::new(room.camera(), &Method::default()).unwrap();
    for k in 0..20 {
        run.push(&step_frame(&room, k, Step::See(k as u64)));
    }
    run.relocalise();
    for k in 20..60 {
        run.push(&step_frame(&house, k, Step::See(180 + k as u64)));
    }
    let records = run.finish();
    let found: Vec<&FrameRecord> = records.frames().collect();
    assert_eq!(asked(found.iter().copied()), [20]);
    assert_eq!(found[20].state, State::Lost, "{}", found[20].reason());
    let first = found.iter().position(|frame| frame.submap == 1).expect("a second submap");
    assert!((45..55).contains(&first) && found[first].reason().contains("submap 1 begins"), "{first}");
    assert!(found[first..].iter().all(|frame| frame.state == State::Tracking));
}
