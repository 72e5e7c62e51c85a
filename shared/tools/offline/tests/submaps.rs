//! A camera that is lost where nothing is known: it goes on in a submap, which is joined to the others
//! once the same place is seen from both.

mod common;

use common::{Step, scene, step_frame};
use rayon::prelude::*;
use tessera_evaluation::{EvaluationOptions, Trajectory, evaluate};
use tessera_geometry::{Pose, PoseBits, translation_rotation_norms};
use tessera_offline::{Method, RawFrame, Records, Run, State};
use tessera_slam::{
    AlignRecord, AppliedCorrection, Context, FrameRecord, JoinRecord, KeyframeSurfaces, LoopVerdict,
    Optimiser, TrackerState,
};
use tessera_sources::{SceneName, SimulatedSource, SimulationOptions, Source};
use tessera_surface::Vertex;

/// Frames of a second: the time after which a submap begins.
const SECOND: usize = 31;

fn room() -> SimulatedSource {
    scene(SceneName::Room, &SimulationOptions::default())
}

fn see(frames: impl Iterator<Item = u64>) -> Vec<Step> {
    frames.map(Step::See).collect()
}

fn run(source: &SimulatedSource, steps: &[Step]) -> Records {
    pushed(source, steps).finish()
}

fn pushed(source: &SimulatedSource, steps: &[Step]) -> Run {
    let mut run = Run::new(source.camera(), &Method::default()).unwrap();
    let numbered: Vec<(usize, Step)> = steps.iter().copied().enumerate().collect();
    for some in numbered.chunks(16) {
        let frames: Vec<RawFrame> = some.par_iter().map(|&(k, step)| step_frame(source, k, step)).collect();
        frames.iter().for_each(|frame| drop(run.push(frame)));
    }
    run
}

/// Absolute error of the tracked frames for which `is_one` holds, all together, metres.
fn ate_m(
    source: &SimulatedSource,
    steps: &[Step],
    records: &Records,
    is_one: impl Fn(&FrameRecord) -> bool,
) -> f64 {
    let all = &source.ground_truth().unwrap().poses;
    let (mut truth, mut estimate) = (Trajectory::default(), Trajectory::default());
    let last = records.last();
    for ((step, frame), pose) in steps.iter().zip(records.frames()).zip(&last.poses) {
        if let Step::See(index) = step
            && frame.state == State::Tracking
            && is_one(frame)
        {
            truth.push(frame.stamp_nanos, all[*index as usize]).unwrap();
            estimate.push(frame.stamp_nanos, *pose).unwrap();
        }
    }
    evaluate(&estimate, &truth, &EvaluationOptions::default()).unwrap().ate_rmse_m
}

/// No pose is without a number, and the odometry jumps nowhere within a submap.
fn assert_odometry_is_smooth(records: &Records) {
    let frames: Vec<&FrameRecord> = records.frames().collect();
    for pair in frames.windows(2) {
        let odom_from_camera = |frame: &FrameRecord| {
            Pose::from(&frame.pose.world_from_odom).inverse() * Pose::from(&frame.pose.world_from_camera)
        };
        let step = odom_from_camera(pair[0]).inverse() * odom_from_camera(pair[1]);
        let (metres, radians) = translation_rotation_norms(&step);
        assert!(metres.is_finite() && radians.is_finite(), "frame {}", pair[1].index);
        let is_tracked = pair.iter().all(|frame| frame.state == State::Tracking);
        if is_tracked && pair[0].submap == pair[1].submap {
            assert!(metres < 0.06 && radians < 0.1, "frame {}: {metres} m, {radians} rad", pair[1].index);
        }
    }
}

#[test]
fn a_place_never_seen_and_back_into_the_old_map() {
    let source = room();
    let mut steps = see(0..60);
    steps.extend([Step::Covered; 15]);
    steps.extend(see((20..175).rev()));
    let records = run(&source, &steps);
    let states: Vec<State> = records.frames().map(|frame| frame.state).collect();
    assert!(states[..60].iter().chain(&states[75 + SECOND..]).all(|state| *state == State::Tracking));
    assert!(states[60..75 + SECOND - 2].iter().all(|state| *state != State::Tracking));
    let submaps = records.submaps();
    assert_eq!((submaps.n(), submaps.n_components()), (2, 1));
    let join = records.frames().find(|frame| frame.change.join.is_some()).unwrap();
    assert!(join.change.request.is_some(), "both are optimised together: {}", join.reason());
    let ate_m = ate_m(&source, &steps, &records, |_| true);
    assert!(ate_m < 0.02, "{ate_m} m");
    assert_odometry_is_smooth(&records);
}

#[test]
fn threads_change_no_byte_of_a_run_with_a_join() {
    let source = room();
    let steps = [see(0..60), see((20..175).rev())].concat();
    let checksums_with = |n_threads: usize| -> Vec<u32> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        let records = pool.install(|| run(&source, &steps));
        assert_eq!((records.submaps().n(), records.submaps().n_components()), (2, 1));
        assert!(records.n_corrections() > 0 && records.frames().any(|frame| frame.change.join.is_some()));
        records.records.iter().map(|record| tessera_journal::fingerprint(record).unwrap()).collect()
    };
    assert!(checksums_with(1) == checksums_with(4));
}

#[test]
fn submaps_that_share_nothing_stay_apart() {
    let source = room();
    let mut steps = see(0..60);
    steps.extend(see((150..220).rev()));
    let records = run(&source, &steps);
    let submaps = records.submaps();
    assert_eq!((submaps.n(), submaps.n_components()), (2, 2));
    assert!(records.frames().all(|frame| frame.change.join.is_none()));
    for submap in [0, 1] {
        let ate_m = ate_m(&source, &steps, &records, |frame| frame.submap == submap);
        assert!(ate_m < 0.02, "submap {submap}: {ate_m} m");
    }
    assert_odometry_is_smooth(&records);
}

#[test]
fn another_world_is_never_joined() {
    let (room, house) = (room(), scene(SceneName::House, &SimulationOptions::default()));
    let mut run = Run::new(room.camera(), &Method::default()).unwrap();
    (0..60).for_each(|k| drop(run.push(&step_frame(&room, k, Step::See(k as u64)))));
    (60..150).for_each(|k| drop(run.push(&step_frame(&house, k, Step::See(k as u64)))));
    (150..180).for_each(|k| drop(run.push(&step_frame(&room, k, Step::See(k as u64 - 140)))));
    let records = run.finish();
    let submaps = records.submaps();
    assert_eq!((submaps.n(), submaps.n_components()), (2, 2));
    let of: Vec<u32> = records.frames().map(|frame| frame.submap).collect();
    assert_eq!((of[59], of[149], of[179]), (0, 1, 0), "back in the room it is found in the first one");
}

#[test]
fn a_cut_in_a_recording_costs_a_second() {
    let source = room();
    let steps = [see(0..60), see(130..200), see(60..100)].concat();
    let records = run(&source, &steps);
    assert!(records.n_untracked() <= 2 * SECOND, "{} frames", records.n_untracked());
    assert_odometry_is_smooth(&records);
}

#[test]
fn none_begins_where_the_settings_say_so() {
    let source = room();
    let mut method = Method::default();
    method.mapping.submaps.after_s = 0.0;
    let mut run = Run::new(source.camera(), &method).unwrap();
    let steps = [see(0..20), see(180..220)].concat();
    steps.iter().enumerate().for_each(|(k, step)| drop(run.push(&step_frame(&source, k, *step))));
    let records = run.finish();
    assert_eq!((records.submaps().n(), records.n_untracked()), (1, 40));
    let is_plain = |record: &AlignRecord| !matches!(record, AlignRecord::Frame(frame) if frame.submap > 0);
    assert!(records.records.iter().all(is_plain));
}

struct Surfaces(Vec<Vec<Vertex>>);

impl KeyframeSurfaces for Surfaces {
    fn vertices(&self, keyframe: u32) -> &[Vertex] {
        &self.0[keyframe as usize]
    }
}

/// Two submaps that share nothing, joined by force where the last keyframe of the one and the first of
/// the other would be the same view.
#[test]
fn a_wrong_join_comes_apart_again() {
    let source = room();
    let steps = [see(0..40), see((150..210).rev())].concat();
    let (records, map) = pushed(&source, &steps).finish_with_map();
    let pose = |id: usize| Pose::from(&map.keyframes[id].world_from_camera);
    let first = map.keyframes.iter().position(|k| k.submap == 1).unwrap();
    let kept_from_moved = PoseBits::from(&(pose(first - 1) * pose(first).inverse()));

    let method = Method::default();
    let context = Context::new(source.camera(), &method.surface, &method.registration, &method.mapping);
    let (mut optimiser, mut state) = (Optimiser::new(context), TrackerState::default());
    let mut journal: Vec<AlignRecord> = Vec::new();
    let last_frame = records.frames().last().unwrap().index;
    for mut record in records.records.into_iter().filter(|r| !matches!(r, AlignRecord::Correction(_))) {
        if let AlignRecord::Frame(frame) = &mut record
            && frame.index == last_frame
        {
            frame.change.join = Some(JoinRecord { kept: 0, moved: 1, kept_from_moved });
        }
        optimiser.apply(&record);
        state.apply(&record);
        journal.push(record);
    }
    assert_eq!(state.submaps.n_components(), 1);
    let request = state.pending.unwrap();
    let correction =
        optimiser.solve(&request, &Surfaces(map.surfaces), &journal.as_slice(), &mut || ()).unwrap();
    let correction = correction.into_correction();
    let crosses = |newer: u32, older: u32| newer as usize >= first && (older as usize) < first;
    let across: Vec<_> = correction.loops.iter().filter(|l| crosses(l.newer, l.older)).collect();
    assert!(!across.is_empty() && across.iter().all(|l| l.verdict != LoopVerdict::Accepted), "{across:?}");
    let applied = AppliedCorrection { before_frame: last_frame + 1, correction };
    state.apply(&AlignRecord::Correction(Box::new(applied)));
    assert_eq!((state.submaps.n_components(), state.refused.len()), (2, 1));
}
