//! Runs of different cameras, one map: each keyframe is seen by its own.

#[path = "../../../../tests/requirements.rs"]
mod requirements;

use std::path::Path;
use tessera_evaluation::{EvaluationOptions, Trajectory, evaluate};
use tessera_features::Feature;
use tessera_geometry::{Camera, translation_rotation_norms};
use tessera_offline::{Method, RawFrame, Run, SavedMap};
use tessera_slam::{
    AlignRecord, AppliedCorrection, Context, FrameHistory, FramePose, JointMap, KeyframeSurfaces,
    PoseHistory, TrackerState,
};
use tessera_sources::{
    DepthSensor, SceneName, SimulatedSource, SimulationOptions, Source, SourceOptions, SourceSpec,
};
use tessera_surface::Vertex;

/// Every so many frames of the house are seen.
const STEP: usize = 3;

/// What a camera saw, and where it truly was.
struct Walk {
    camera: Camera,
    indices: Vec<u64>,
    stamps_nanos: Vec<i64>,
    truth: Trajectory,
    records: Vec<AlignRecord>,
    map: SavedMap,
}

impl Walk {
    /// Some frames of the house.
    fn in_house(
        folder: &Path,
        camera: &Camera,
        sensor: DepthSensor,
        frames: std::ops::Range<u64>,
        seed: u64,
    ) -> Self {
        let file = folder.join("camera.toml");
        std::fs::write(&file, toml::to_string(camera).unwrap()).unwrap();
        let options = SimulationOptions { sensor, ..SimulationOptions::default() };
        let house =
            SimulatedSource::open(SceneName::House, Some(file.to_str().unwrap()), None, &options).unwrap();
        Self::new(&house, frames.step_by(STEP), house.camera(), seed, |frame| frame)
    }

    /// Some frames of a source, as `seen` makes them those of a camera.
    fn new(
        source: &dyn Source,
        indices: impl Iterator<Item = u64>,
        camera: &Camera,
        seed: u64,
        seen: impl Fn(RawFrame) -> RawFrame,
    ) -> Self {
        let mut method = Method::default();
        method.registration.seed = seed;
        let mut run = Run::new(camera, &method).unwrap();
        let indices: Vec<u64> = indices.collect();
        let mut stamps_nanos = Vec::new();
        for index in &indices {
            let frame = seen(RawFrame::read(source, *index).unwrap());
            stamps_nanos.push(frame.stamp_nanos);
            run.push(&frame);
        }
        let (records, map) = run.finish_with_map();
        let truth = source.ground_truth().unwrap().clone();
        Self { camera: camera.clone(), indices, stamps_nanos, truth, records: records.records, map }
    }

    fn context(&self) -> Context {
        let method = Method::default();
        Context::new(&self.camera, &method.surface, &method.registration, &method.mapping)
    }

    fn state(&self) -> TrackerState {
        let mut state = TrackerState::default();
        self.records.iter().for_each(|record| state.apply(record));
        state
    }

    /// The pose of every frame, with a correction behind its own ones.
    fn trajectory(&self, correction: Option<AppliedCorrection>) -> Trajectory {
        let mut history = PoseHistory::default();
        self.records.iter().for_each(|record| history.apply(record));
        if let Some(correction) = correction {
            history.apply(&AlignRecord::Correction(Box::new(correction)));
        }
        let of = |record: &AlignRecord| match record {
            AlignRecord::Frame(frame) => Some(FramePose::from(&**frame)),
            _ => None,
        };
        let poses = self.records.iter().filter_map(of).map(|frame| history.final_pose(&frame)).collect();
        Trajectory { stamps_nanos: self.stamps_nanos.clone(), poses }
    }

    fn error_m(&self, of: &Trajectory) -> f64 {
        evaluate(of, &self.truth, &EvaluationOptions::default()).unwrap().ate_rmse_m
    }
}

struct Seen(Vec<Vec<Vertex>>, Vec<Vec<Feature>>);

impl KeyframeSurfaces for Seen {
    fn vertices(&self, keyframe: u32) -> &[Vertex] {
        &self.0[keyframe as usize]
    }

    fn features(&self, keyframe: u32) -> &[Feature] {
        &self.1[keyframe as usize]
    }
}

/// The joint map of walks, its places joined, with the trajectory of each in it.
fn joined(walks: &[&Walk]) -> (usize, Vec<Trajectory>) {
    let mut map = JointMap::new(walks[0].context());
    let states: Vec<TrackerState> = walks.iter().map(|walk| walk.state()).collect();
    for (walk, state) in walks.iter().zip(&states) {
        map.add_seen_by(state, &walk.context().session_cameras());
    }
    let all = |of: fn(&SavedMap) -> Vec<Vec<Vertex>>| walks.iter().flat_map(|w| of(&w.map)).collect();
    let features = walks.iter().flat_map(|walk| walk.map.features.clone()).collect();
    let seen = Seen(all(|map| map.surfaces.clone()), features);
    let meetings = map.join(&seen, &mut || ());
    let records: Vec<&[AlignRecord]> = walks.iter().map(|walk| walk.records.as_slice()).collect();
    let histories: Vec<&dyn FrameHistory> = records.iter().map(|records| records as _).collect();
    map.optimise(&seen, &histories, &mut || ());
    let trajectories = walks.iter().enumerate().map(|(number, walk)| {
        let correction = map.correction_of(number, &states[number], &walk.records.as_slice());
        walk.trajectory(Some(AppliedCorrection { before_frame: u64::MAX, correction }))
    });
    (meetings.len(), trajectories.collect())
}

/// Errors of two walks through a house, one as by a Kinect and one as by a RealSense D435, each together over alone;
/// the place of one in the other is the true one.
fn ratios_of_halves(folder: &Path, seed: u64) -> [f64; 2] {
    let kinect = Camera::pinhole((640, 480), [525.0, 525.0, 319.5, 239.5], 5000.0);
    let d435 = Camera::pinhole((848, 480), [615.0, 615.0, 423.5, 239.5], 1000.0);
    let walks = [
        Walk::in_house(folder, &kinect, DepthSensor::StructuredLight, 0..1000, seed),
        Walk::in_house(folder, &d435, DepthSensor::ActiveStereo, 850..1800, seed),
    ];
    let (n_meetings, together) = joined(&[&walks[0], &walks[1]]);
    assert_eq!(n_meetings, 1);
    let found = together[0].poses[20].inverse() * together[1].poses[20];
    let truth = |walk: &Walk| walk.truth.poses[walk.indices[20] as usize];
    let expected = truth(&walks[0]).inverse() * truth(&walks[1]);
    let (metres, radians) = translation_rotation_norms(&(expected.inverse() * found));
    assert!(metres < 0.1 && radians < 0.03, "seed {seed}: {metres} m, {radians} rad");
    std::array::from_fn(|k| {
        let (alone_m, together_m) =
            (walks[k].error_m(&walks[k].trajectory(None)), walks[k].error_m(&together[k]));
        eprintln!("seed {seed}, walk {k}: alone {alone_m:.4} m, together {together_m:.4} m");
        together_m / alone_m
    })
}

/// By the median of three seeds: errors of single runs spread by a factor of ten.
#[test]
fn halves_of_a_house_that_two_cameras_saw_are_one_map_as_good_as_each() {
    let folder = tempfile::tempdir().unwrap();
    let ratios = [0, 1, 2].map(|seed| ratios_of_halves(folder.path(), seed));
    for walk in 0..2 {
        let mut of_walk = ratios.map(|ratios| ratios[walk]);
        of_walk.sort_by(f64::total_cmp);
        assert!(of_walk[1] <= 1.2, "walk {walk}: {of_walk:?} of its error alone");
    }
}

/// Images cropped by so many pixels on each side and then scaled by 4/5, and the camera that has them.
fn cropped(of: &Camera, [left, top]: [u32; 2]) -> (Camera, impl Fn(RawFrame) -> RawFrame) {
    let [width, height] = [(of.width - 2 * left) * 4 / 5, (of.height - 2 * top) * 4 / 5];
    // Pixel p of the new image shows pixel left + 1.25 (p + 0.5) - 0.5 of the old one.
    let centre = |c: f64, cut: u32| (c - f64::from(cut) + 0.5) * 0.8 - 0.5;
    let camera = Camera {
        width,
        height,
        fx: 0.8 * of.fx,
        fy: 0.8 * of.fy,
        cx: centre(of.cx, left),
        cy: centre(of.cy, top),
        ..of.clone()
    };
    let old_width = of.width as usize;
    let place = move |at: usize| {
        let [row, column] = [at / width as usize, at % width as usize];
        let old = |p: usize, cut: u32| cut as usize + (5 * p + 2) / 4;
        old(row, top) * old_width + old(column, left)
    };
    let n = (width * height) as usize;
    let seen = move |frame: RawFrame| RawFrame {
        depth: (0..n).map(|at| frame.depth[place(at)]).collect(),
        colour: frame.colour.map(|rgb| (0..n).flat_map(|at| rgb[3 * place(at)..][..3].to_vec()).collect()),
        ..frame
    };
    (camera, seen)
}

#[test]
fn a_kitchen_seen_by_another_camera_the_second_time_is_one_map() {
    let Some(folder) = requirements::data("kitchen_450") else { return };
    let spec = SourceSpec::parse(folder.to_str().unwrap());
    let kitchen = tessera_sources::open(&spec, &SourceOptions::default()).unwrap();
    let (camera, seen) = cropped(kitchen.camera(), [40, 20]);
    let walks = [
        Walk::new(&*kitchen, 0..250, kitchen.camera(), 0, |frame| frame),
        Walk::new(&*kitchen, 200..450, &camera, 0, seen),
    ];
    let (n_meetings, together) = joined(&[&walks[0], &walks[1]]);
    assert_eq!(n_meetings, 1);
    // That they are joined is the mark.
    for (walk, together) in walks.iter().zip(&together) {
        let (alone_m, together_m) = (walk.error_m(&walk.trajectory(None)), walk.error_m(together));
        eprintln!("alone {alone_m:.4} m, together {together_m:.4} m");
        assert!(together_m <= 1.3 * alone_m, "{together_m} m together, {alone_m} m alone");
    }
}

#[test]
fn a_run_starts_in_the_map_of_another_camera_and_extends_it() {
    let options = SimulationOptions::default();
    let folder = tempfile::tempdir().unwrap();
    let open = |focal_px: f64| {
        let file = folder.path().join("camera.toml");
        let camera = Camera::pinhole((640, 480), [focal_px, focal_px, 322.0, 238.0], 5000.0);
        std::fs::write(&file, toml::to_string(&camera).unwrap()).unwrap();
        SimulatedSource::open(SceneName::Room, Some(file.to_str().unwrap()), None, &options).unwrap()
    };
    let (first, second) = (open(525.0), open(560.0));
    let monday = Walk::new(&first, (0..160).step_by(2), first.camera(), 0, |frame| frame);
    let (n_map, truth) = (monday.map.keyframes.len(), second.ground_truth().unwrap().poses.clone());
    let mut run = Run::in_map(second.camera(), &Method::default(), monday.map, None).unwrap();
    let indices: Vec<u64> = (90..220).step_by(2).collect();
    indices.iter().for_each(|index| drop(run.push(&RawFrame::read(&second, *index).unwrap())));
    let (records, extended) = run.finish_with_map();
    assert!(extended.keyframes.len() > n_map + 2 && extended.cameras.len() == 2);
    let last = records.last();
    let tracked = last.poses.len() - 20;
    let worst_m = last.poses.iter().zip(&indices).skip(20).map(|(pose, index)| {
        let expected = truth[0].inverse() * truth[*index as usize];
        translation_rotation_norms(&(expected.inverse() * pose)).0
    });
    let worst_m = worst_m.fold(0.0, f64::max);
    eprintln!("{tracked} frames, worst {worst_m:.4} m");
    // As of one camera (tests/saved_map.rs).
    assert!(worst_m < 0.02, "{worst_m} m");
}
