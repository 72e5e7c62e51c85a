//! Each number of a record that a robot could lie with is refused by name.

use super::*;
use tessera_outputs::test_run;
use tessera_slam::{
    BlockRecord, ContradictionRecord, EdgeRecord, RequestRecord, RetiredRecord, SightingRecord, SkippedFrames,
};

/// What is known of a run with two keyframes of one submap.
fn facts() -> RunFacts {
    let mut facts = RunFacts::default();
    (facts.n_submaps, facts.n_records) = (1, 3);
    facts.slots.resize(2, Default::default());
    facts.is_active.resize(2, true);
    facts
}

fn pose() -> PoseBits {
    PoseBits::IDENTITY
}

fn far() -> PoseBits {
    PoseBits { translation_m: [f64::NAN, 0.0, 0.0], ..pose() }
}

/// A frame, with the keyframe that it makes where that is asked for.
fn frame(makes_keyframe: bool) -> FrameRecord {
    let frames = test_run::records().into_iter().filter_map(|record| match record {
        AlignRecord::Frame(frame) => Some(*frame),
        _ => None,
    });
    let mut frame =
        frames.into_iter().find(|frame| frame.change.new_keyframe.is_some() == makes_keyframe).unwrap();
    frame.pose.keyframe = 0;
    if let Some(keyframe) = &mut frame.change.new_keyframe {
        (keyframe.id, keyframe.edges) = (2, Vec::new());
    }
    frame
}

fn check(record: AlignRecord) -> Result<(), String> {
    CheckedRecord::check(record, &facts()).map(drop)
}

/// A frame that one number makes a lie.
fn lie(makes_keyframe: bool, change: impl Fn(&mut FrameRecord)) -> String {
    let mut frame = frame(makes_keyframe);
    assert_eq!(check(AlignRecord::Frame(Box::new(frame.clone()))), Ok(()), "before it lies");
    change(&mut frame);
    check(AlignRecord::Frame(Box::new(frame))).unwrap_err()
}

#[test]
fn keyframes_that_are_not_there_are_refused_wherever_they_are_named() {
    let block = BlockRecord { keyframe: 7, keyframe_from_camera: pose(), cost: Vec::new(), n_matches: 1 };
    let sighting = |seen, own| SightingRecord { seen, own, seen_from_own: pose(), evidence_millinats: 1 };
    let request = RequestRecord { request: 0, n_keyframes: 7, effective_before: 9, is_final: false };
    let lies = [
        lie(false, |f| f.pose.keyframe = u32::MAX),
        lie(false, |f| f.evidence.blocks = vec![block.clone()]),
        lie(false, |f| f.change.sighting = Some(sighting(7, 0))),
        lie(false, |f| f.change.sighting = Some(sighting(0, 7))),
        lie(false, |f| {
            f.change.contradiction =
                Some(ContradictionRecord { first: 7, before_nats: 0.0, seen: 0, n_looks: 1, looks_nats: 1.0 })
        }),
        lie(false, |f| f.change.request = Some(request)),
        lie(true, |f| f.change.new_keyframe.as_mut().unwrap().alike = vec![u32::MAX]),
        lie(true, |f| {
            f.change.new_keyframe.as_mut().unwrap().edges = vec![EdgeRecord { to: 7, is_loop: true }]
        }),
        lie(true, |f| {
            let retired = RetiredRecord { keyframe: 0, anchored_to: 7 };
            f.change.new_keyframe.as_mut().unwrap().retires = vec![retired];
        }),
    ];
    for words in lies {
        assert!(words.contains("keyframe") && words.contains("there are"), "{words}");
    }
}

#[test]
fn submaps_and_poses_that_cannot_be_are_refused() {
    let join = |kept, moved, kept_from_moved| JoinRecord { kept, moved, kept_from_moved };
    assert!(lie(false, |f| f.change.join = Some(join(0, 7, pose()))).contains("component 7 is joined"));
    assert!(lie(false, |f| f.change.refused = Some(join(u32::MAX, 0, pose()))).contains("is joined"));
    assert!(lie(false, |f| f.change.join = Some(join(0, 0, far()))).contains("a pose that none can have"));
    assert!(lie(false, |f| f.submap = 7).contains("submap 7"));
    assert!(lie(false, |f| f.pose.covariance = vec![0.0; 5]).contains("a covariance of 5 numbers"));
    assert!(lie(false, |f| f.pose.velocity = [f64::NAN; 6]).contains("numbers that are none"));
    assert!(lie(false, |f| f.pose.world_from_camera = far()).contains("a pose that none can have"));
}

#[test]
fn a_map_comes_first_or_not_at_all() {
    let map = || {
        AlignRecord::Map(Box::new(MapRecord {
            keyframes: Vec::new(),
            submaps: Submaps::default(),
            start: None,
        }))
    };
    let words = check(map()).unwrap_err();
    assert_eq!(words, "a map behind 3 records, expected it first");
    assert!(CheckedRecord::check(map(), &RunFacts::default()).is_ok());
}

#[test]
fn a_range_of_no_frames_is_refused() {
    let skipped = |frames| check(AlignRecord::Skipped(SkippedFrames { frames, reason: String::new() }));
    assert_eq!(skipped(5..9), Ok(()));
    assert!(skipped(std::ops::Range { start: 9, end: 5 }).unwrap_err().contains("no frames are left out"));
}
