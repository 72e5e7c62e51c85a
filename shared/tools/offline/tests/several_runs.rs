//! Several runs, one map: halves of a room are joined where both saw it, another place stays apart.

mod common;

use common::scene;
use tessera_geometry::{Pose, translation_rotation_norms};
use tessera_offline::{Method, RawFrame, Run};
use tessera_slam::{
    AlignRecord, Context, Correction, FrameHistory, FramePose, JointMap, KeyframeSurfaces, OptimiseRecord,
    Optimiser, PairChanges, PoseHistory, RequestRecord, TrackerState,
};
use tessera_sources::{SceneName, SimulatedSource, SimulationOptions, Source};
use tessera_surface::Vertex;

/// A finished run.
struct Finished {
    records: Vec<AlignRecord>,
    state: TrackerState,
    surfaces: Vec<Vec<Vertex>>,
    truth: Vec<Pose>,
}

fn finished(source: &SimulatedSource, frames: std::ops::Range<u64>) -> Finished {
    finished_of(source, &frames.collect::<Vec<_>>())
}

/// A run over some frames of a scene.
fn finished_of(source: &SimulatedSource, frames: &[u64]) -> Finished {
    finished_by(&Method::default(), source, frames)
}

fn finished_by(method: &Method, source: &SimulatedSource, frames: &[u64]) -> Finished {
    let mut run = Run::new(source.camera(), method).unwrap();
    for index in frames {
        run.push(&RawFrame::read(source, *index).unwrap());
    }
    let (records, map) = run.finish_with_map();
    let mut state = TrackerState::default();
    records.records.iter().for_each(|record| state.apply(record));
    let all = &source.ground_truth().unwrap().poses;
    let truth = frames.iter().map(|index| all[*index as usize]).collect();
    Finished { records: records.records, state, surfaces: map.surfaces, truth }
}

struct Surfaces(Vec<Vec<Vertex>>);

impl KeyframeSurfaces for Surfaces {
    fn vertices(&self, keyframe: u32) -> &[Vertex] {
        &self.0[keyframe as usize]
    }
}

fn context(source: &SimulatedSource) -> Context {
    let method = Method::default();
    Context::new(source.camera(), &method.surface, &method.registration, &method.mapping)
}

fn joint(source: &SimulatedSource, runs: &[&Finished]) -> (JointMap, Surfaces) {
    let mut map = JointMap::new(context(source));
    runs.iter().for_each(|run| map.add(&run.state));
    (map, Surfaces(runs.iter().flat_map(|run| run.surfaces.clone()).collect()))
}

/// A frame's pose after the joint map's correction of its run.
fn corrected(map: &JointMap, number: usize, run: &Finished, index: usize) -> Pose {
    let mut history = PoseHistory::default();
    run.records.iter().for_each(|record| history.apply(record));
    let correction = map.correction_of(number, &run.state, &run.records.as_slice());
    let applied = tessera_slam::AppliedCorrection { before_frame: u64::MAX, correction };
    history.apply(&AlignRecord::Correction(Box::new(applied)));
    let frames = run.records.iter().filter_map(|record| match record {
        AlignRecord::Frame(frame) => Some(FramePose::from(&**frame)),
        _ => None,
    });
    history.final_pose(&frames.clone().nth(index).unwrap())
}

#[test]
fn runs_that_share_a_place_become_one_map_and_others_stay_apart() {
    let room = scene(SceneName::Room, &SimulationOptions::default());
    let house = scene(SceneName::House, &SimulationOptions::default());
    let (first, second) = (finished(&room, 0..40), finished(&room, 25..60));
    let elsewhere = finished(&house, 0..25);
    let solve = || {
        let (mut map, surfaces) = joint(&room, &[&first, &elsewhere, &second]);
        assert_eq!(map.submaps().n_components(), 3);
        let meetings = map.join(&surfaces, &mut || ());
        let records = [&first, &elsewhere, &second].map(|run| run.records.as_slice());
        let histories = records.each_ref().map(|records| records as &dyn FrameHistory);
        let correction = map.optimise(&surfaces, &histories, &mut || ()).unwrap();
        (map, meetings, correction)
    };
    let (map, meetings, correction) = solve();
    assert_eq!(meetings.len(), 1, "{meetings:?}");
    assert_eq!((map.run_of(meetings[0].own), map.run_of(meetings[0].seen)), (Some(2), Some(0)));
    assert!(meetings[0].n_confirmed >= 2 && meetings[0].overlap > 0.2);
    assert_eq!(map.component(0, 0), map.component(2, 0), "held by its loops");
    assert_ne!(map.component(0, 0), map.component(1, 0));
    // The pose between frames of both runs is the true one.
    for (a, b) in [(5, 30), (39, 0)] {
        let found = corrected(&map, 0, &first, a).inverse() * corrected(&map, 2, &second, b);
        let expected = first.truth[a].inverse() * second.truth[b];
        let (metres, radians) = translation_rotation_norms(&(expected.inverse() * found));
        assert!(metres < 0.03 && radians < 0.02, "{metres} m, {radians} rad");
    }
    // In one thread as in any number.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let (_, meetings_again, correction_again) = pool.install(solve);
    assert!(meetings_again == meetings && correction_again == correction);
}

#[test]
fn what_culled_keyframes_measured_counts_in_the_map_of_several_runs() {
    let room = scene(SceneName::Room, &SimulationOptions::default());
    let mut method = Method::default();
    method.mapping.keyframe.budget = 10;
    let walk = |frames: std::ops::Range<u64>| finished_by(&method, &room, &frames.collect::<Vec<_>>());
    let runs = [walk(0..60), walk(40..100)];
    let (mut map, surfaces) = joint(&room, &[&runs[0], &runs[1]]);
    assert_eq!(map.join(&surfaces, &mut || ()).len(), 1);
    let (keyframes, own) = (map.keyframes().to_vec(), [0, 1].map(|run| map.keyframes_of(run)));
    let records = runs.each_ref().map(|run| run.records.as_slice());
    let histories = records.each_ref().map(|records| records as &dyn FrameHistory);
    let correction = map.optimise(&surfaces, &histories, &mut || ()).unwrap();
    let solved = |id: usize| correction.keyframes.iter().find(|k| k.id as usize == id);
    let culled =
        |run: usize| own[run].clone().filter(|id| !keyframes[*id].is_active() && solved(*id).is_some());
    let n_culled = [0, 1].map(|run| culled(run).count());
    assert!(n_culled.iter().all(|n| *n > 0), "{n_culled:?} culled keyframes are solved for");
    // Each has the blocks of its own frames: it is where it was.
    let world_from_truth = Pose::from(&map.keyframes()[0].world_from_camera) * runs[0].truth[0].inverse();
    for (run, id) in [0, 1].into_iter().flat_map(|run| culled(run).map(move |id| (run, id))) {
        let found = Pose::from(&solved(id).unwrap().world_from_camera);
        let expected = world_from_truth * runs[run].truth[keyframes[id].frame_index as usize];
        let (metres, radians) = translation_rotation_norms(&(expected.inverse() * found));
        assert!(metres < 0.03 && radians < 0.02, "keyframe {id}: {metres} m, {radians} rad");
    }
}

/// In the lounges of the building, which look alike, a person walks in the first one alone: what was seen of it
/// floats in front of what the same robot and another one saw at other times.
#[test]
fn a_person_who_walks_about_contradicts_no_join_and_rooms_that_look_alike_stay_apart() {
    let options = SimulationOptions::default();
    let building = SimulatedSource::open(SceneName::Building, None, Some(4000), &options).unwrap();
    let each_fifth =
        |frames: std::ops::Range<u64>| finished_of(&building, &frames.step_by(5).collect::<Vec<_>>());
    let runs = [each_fifth(1260..1560), each_fifth(1385..1635), each_fifth(3290..3620)];
    let (mut map, surfaces) = joint(&building, &[&runs[0], &runs[1], &runs[2]]);
    let meetings = map.join(&surfaces, &mut || ());
    let joined: Vec<_> = meetings.iter().map(|m| (map.run_of(m.own), map.run_of(m.seen))).collect();
    assert_eq!(joined, [(Some(1), Some(0))], "{meetings:?}");
    let found = corrected(&map, 0, &runs[0], 40).inverse() * corrected(&map, 1, &runs[1], 40);
    let expected = runs[0].truth[40].inverse() * runs[1].truth[40];
    let (metres, radians) = translation_rotation_norms(&(expected.inverse() * found));
    assert!(metres < 0.05 && radians < 0.02, "{metres} m, {radians} rad");
}

/// The optimiser of a run at the final request.
fn asking(source: &SimulatedSource, run: &Finished) -> (Optimiser, RequestRecord) {
    let mut optimiser = Optimiser::new(context(source));
    for record in &run.records {
        if let AlignRecord::Correction(applied) = record {
            optimiser.apply_own(&OptimiseRecord::Correction(Box::new(applied.correction.clone())));
        }
        optimiser.apply(record);
        if let AlignRecord::End { request: Some(request), .. } = record {
            return (optimiser, *request);
        }
    }
    panic!("the run has no final request");
}

/// The answer to the final request of `run` from what is known of `others`.
fn answer(source: &SimulatedSource, run: &Finished, others: &[&Finished]) -> (Correction, usize) {
    let (optimiser, request) = asking(source, run);
    let mut map = JointMap::of_request(context(source), &optimiser, &request).unwrap();
    others.iter().for_each(|other| map.add(&other.state));
    let all = std::iter::once(&run).chain(others).flat_map(|run| run.surfaces.clone());
    let surfaces = Surfaces(all.collect());
    map.join(&surfaces, &mut || ());
    let (found, changes) =
        map.answer(&optimiser, &request, &surfaces, &run.records.as_slice(), &mut || ()).unwrap();
    assert_eq!(changes, PairChanges::default(), "nothing follows the final answer");
    (found, map.n_sharing())
}

#[test]
fn an_answer_is_the_run_s_own_without_others_and_another_with_those_that_share_a_place() {
    let room = scene(SceneName::Room, &SimulationOptions::default());
    let house = scene(SceneName::House, &SimulationOptions::default());
    let (run, other, elsewhere) = (finished(&room, 25..60), finished(&room, 0..40), finished(&house, 0..25));
    let (optimiser, request) = asking(&room, &run);
    let history = run.records.as_slice();
    let own = optimiser.solve(&request, &Surfaces(run.surfaces.clone()), &history, &mut || ()).unwrap();
    let own = own.into_correction();
    let accept = |answer: Correction| {
        optimiser.accept(&request, (answer, PairChanges::default()), &history).unwrap().into_correction()
    };
    let (alone, n_sharing) = answer(&room, &run, &[&elsewhere]);
    assert_eq!(n_sharing, 0);
    assert!(accept(alone) == own, "the same bits");
    let (among, n_sharing) = answer(&room, &run, &[&elsewhere, &other]);
    assert_eq!(n_sharing, 1);
    let among = accept(among);
    assert_eq!(among.keyframes[0], own.keyframes[0], "in its own gauge");
    assert_ne!(among.keyframes, own.keyframes);
    assert_eq!(among.frames.len(), own.frames.len());
    assert!(among.loops.iter().all(|l| (l.newer as usize) < among.keyframes.len()));
    let first = run.records.iter().find_map(|record| match record {
        AlignRecord::Frame(frame) => Some(frame.index),
        _ => None,
    });
    assert!(among.frames.len() > 30);
    for (index, pose) in &among.frames {
        let expected = run.truth[0].inverse() * run.truth[(index - first.unwrap()) as usize];
        let (metres, radians) = translation_rotation_norms(&(expected.inverse() * Pose::from(pose)));
        assert!(metres < 0.02 && radians < 0.01, "{metres} m, {radians} rad");
    }
}

#[test]
fn runs_without_a_place_in_common_are_maps_of_their_own() {
    let room = scene(SceneName::Room, &SimulationOptions::default());
    // The camera turns: these saw opposite walls.
    let n = room.n_frames().unwrap();
    let runs = [finished(&room, 0..8), finished(&room, n / 2..n / 2 + 8)];
    let (mut map, surfaces) = joint(&room, &[&runs[0], &runs[1]]);
    assert!(map.join(&surfaces, &mut || ()).is_empty());
    map.optimise(&surfaces, &[], &mut || ());
    assert_eq!(map.submaps().n_components(), 2);
}
