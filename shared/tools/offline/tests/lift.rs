//! A lift: behind its closed door the camera sees a cabin at rest, and is carried to another storey that looks
//! much like the one before.

mod common;

use common::{Step, small_building, step_frame};
use rayon::prelude::*;
use tessera_evaluation::{EvaluationOptions, Trajectory, evaluate};
use tessera_offline::{Method, RawFrame, Records, Run, State};
use tessera_slam::FrameRecord;
use tessera_sources::{SimulatedSource, Source};

/// Frames of the building: out of the lift on the ground storey into the first room; the door open, closing and
/// closed before the first ride; the ride; out of the lift on the storey above.
const OUT: u64 = 330;
const BACK: u64 = 700;
const DOOR: std::ops::Range<u64> = 6490..6570;
const RIDE_AND_OUT: std::ops::Range<u64> = 6490..7000;
/// In the cabin: what is seen from there does not tell where it is.
const CABIN: std::ops::Range<u64> = 6490..6800;
/// Way out of the cabin on which a ride is noticed, metres: another storey looks much like the one before.
const NOTICED_M: f64 = 3.5;
/// A tenth of a second from frame to frame.
const EVERY: usize = 3;

/// Frames of the building in this order, each third one.
fn run(source: &SimulatedSource, indices: &[u64]) -> Records {
    let mut run = Run::new(source.camera(), &Method::default()).unwrap();
    let numbered: Vec<(usize, u64)> = (0..).step_by(EVERY).zip(indices.iter().copied()).collect();
    for some in numbered.chunks(32) {
        let frames: Vec<RawFrame> =
            some.par_iter().map(|&(k, index)| step_frame(source, k, Step::See(index))).collect();
        frames.iter().for_each(|frame| drop(run.push(frame)));
    }
    run.finish()
}

/// True way since the camera was in the cabin, metres, of each frame; none before the first ride, and 0 in it.
fn since_ride_m(source: &SimulatedSource, indices: &[u64]) -> Vec<Option<f64>> {
    let truth = &source.ground_truth().unwrap().poses;
    let centre = |k: usize| truth[indices[k] as usize].translation.vector;
    let mut since = None;
    let of = |k: usize| {
        since = match since {
            _ if CABIN.contains(&indices[k]) => Some(0.0),
            Some(way_m) => Some(way_m + (centre(k) - centre(k - 1)).norm()),
            None => None,
        };
        since
    };
    (0..indices.len()).map(of).collect()
}

/// Frames of a component that are not in the cabin nor so near behind it that the map may yet be wrong, and their
/// absolute error, metres.
fn ate_m(source: &SimulatedSource, indices: &[u64], records: &Records, component: u32) -> (usize, f64) {
    let all = &source.ground_truth().unwrap().poses;
    let (mut truth, mut estimate) = (Trajectory::default(), Trajectory::default());
    let last = records.last();
    let since_ride_m = since_ride_m(source, indices);
    for (k, component_of_frame) in records.components().into_iter().enumerate() {
        if component_of_frame == component && since_ride_m[k].is_none_or(|way_m| way_m > NOTICED_M) {
            let stamp_nanos = last.stamps_nanos[k];
            truth.push(stamp_nanos, all[indices[k] as usize]).unwrap();
            estimate.push(stamp_nanos, last.poses[k]).unwrap();
        }
    }
    let error = evaluate(&estimate, &truth, &EvaluationOptions::default()).unwrap();
    (estimate.poses.len(), error.ate_rmse_m)
}

fn all_tracked(records: &Records) -> bool {
    records.frames().all(|frame| frame.state == State::Tracking)
}

#[test]
fn a_ride_is_noticed_and_the_way_back_leads_into_the_first_map() {
    let source = small_building();
    let there: Vec<u64> = (0..OUT).chain((0..OUT).rev()).chain(RIDE_AND_OUT).collect();
    let n_there = there.len();
    // The same way back: into the cabin, down, and out again.
    let indices: Vec<u64> =
        there.into_iter().chain(RIDE_AND_OUT.rev()).chain(0..BACK).step_by(EVERY).collect();
    let records = run(&source, &indices);
    assert!(all_tracked(&records));
    let reasons: Vec<String> =
        records.frames().map(FrameRecord::reason).filter(|r| r.contains("submap")).collect();
    let splits: Vec<u64> = records.frames().filter(|f| f.change.split.is_some()).map(|f| f.index).collect();
    let since_ride_m = since_ride_m(&source, &indices);
    let n_there = n_there / EVERY;
    let is_noticed = |frames: std::ops::Range<usize>| {
        let mut on_time = splits.iter().filter(|k| frames.contains(&(**k as usize)));
        on_time.any(|k| since_ride_m[*k as usize].is_some_and(|way_m| way_m <= NOTICED_M))
    };
    assert!(is_noticed(0..n_there) && is_noticed(n_there..indices.len()), "{splits:?} {reasons:#?}");
    // The ground storey in one map, the storey above in another one, and perhaps the rides.
    let components = records.components();
    let ground = components[0];
    assert_eq!(components.last(), Some(&ground), "{reasons:#?}");
    let above = components[(660 + 6950 - 6490) / EVERY];
    assert_ne!(above, ground, "{reasons:#?}");
    let (n_ground, ground_m) = ate_m(&source, &indices, &records, ground);
    let (n_above, above_m) = ate_m(&source, &indices, &records, above);
    assert!(n_ground > 2 * OUT as usize / EVERY && ground_m < 0.3, "{n_ground} frames, {ground_m} m");
    assert!(n_above > 50 && above_m < 0.3, "{n_above} frames, {above_m} m: {reasons:#?}");
}

#[test]
fn a_door_that_closes_and_opens_again_begins_no_submap() {
    let source = small_building();
    let indices: Vec<u64> =
        (0..OUT).chain((0..OUT).rev()).chain(DOOR).chain(DOOR.rev()).chain(0..OUT).step_by(EVERY).collect();
    let records = run(&source, &indices);
    assert!(all_tracked(&records));
    assert_eq!(records.submaps().n(), 1);
    let (_, error_m) = ate_m(&source, &indices, &records, 0);
    assert!(error_m < 0.2, "{error_m} m");
}
