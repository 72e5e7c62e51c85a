//! Several robots in a simulated world, started apart: are their maps joined, rightly, and how good is each
//! trajectory in the one map?
//!
//! `cargo run --example several_robots -- [--scene NAME] [--seeds N] [--first SEED] [--every N] [--whole SKIP+FRAMES] [--wire] SKIP+FRAMES... [key=value]...`
//!
//! Each SKIP+FRAMES is the part of the scene's way that one robot sees; each `--every`th frame is taken.
//! A robot maps by itself; the maps are then joined and optimised as a base does (`JointMap`).
//! A join, or a loop between two robots that the optimisation keeps, is wrong where it puts two keyframes
//! more than 1 m or 30 degrees from where they truly are to each other.
//! The error of each robot is that in the axes of the one map: all trajectories are aligned at once.
//! With `--wire` the base has of each robot the surfaces of the keyframes that it keeps, as they travel.
//! With `--whole` one run over that part is the standard.
#![forbid(unsafe_code)]

use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::error::Error;
use std::ops::Range;
use tessera_evaluation::align_rigid;
use tessera_features::Feature;
use tessera_fleet::wire::surfaces::{from_wire, pack_surface};
use tessera_geometry::{Camera, Pose, translation_rotation_norms};
use tessera_offline::{Method, RawFrame, Run};
use tessera_settings::Settings;
use tessera_slam::{
    AlignRecord, AppliedCorrection, Context, Correction, FrameHistory, FramePose, JointMap, KeyframeSurfaces,
    LoopVerdict, Meeting, PoseHistory, TrackerState,
};
use tessera_sources::{SceneName, SimulatedSource, SimulationOptions, Source};
use tessera_surface::{Grid, Vertex};

/// Beyond these a join or a loop is wrong.
const WRONG_M: f64 = 1.0;
const WRONG_DEG: f64 = 30.0;

/// What is walked.
struct Walks {
    scene: SceneName,
    every: u64,
    parts: Vec<Range<u64>>,
    whole: Option<Range<u64>>,
    seeds: Range<u64>,
    overrides: Vec<String>,
    is_wire: bool,
}

/// A robot with its finished map.
struct MappedWalk {
    records: Vec<AlignRecord>,
    state: TrackerState,
    vertices: Vec<Vec<Vertex>>,
    features: Vec<Vec<Feature>>,
    /// Frames of the scene, by the run's own.
    frames: Vec<u64>,
}

/// Surfaces of all keyframes of a joint map.
struct AllSurfaces<'a>(Vec<(&'a [Vertex], &'a [Feature])>);

impl KeyframeSurfaces for AllSurfaces<'_> {
    fn vertices(&self, keyframe: u32) -> &[Vertex] {
        self.0[keyframe as usize].0
    }

    fn features(&self, keyframe: u32) -> &[Feature] {
        self.0[keyframe as usize].1
    }
}

/// What came of one seed.
#[derive(Default)]
struct Outcome {
    components: usize,
    joins: usize,
    wrong_joins: usize,
    wrong_held: usize,
    loops: usize,
    wrong_loops: usize,
}

fn main() -> Result<(), Box<dyn Error>> {
    let walks = arguments()?;
    let mut sum = Outcome::default();
    let n = walks.seeds.end - walks.seeds.start;
    for seed in walks.seeds.clone() {
        let found = one_seed(&walks, seed)?;
        sum.components += found.components;
        sum.joins += found.joins;
        sum.wrong_joins += found.wrong_joins;
        sum.wrong_held += found.wrong_held;
        sum.loops += found.loops;
        sum.wrong_loops += found.wrong_loops;
    }
    println!("{n} seeds: {}", sum.told());
    Ok(())
}

impl Outcome {
    fn told(&self) -> String {
        format!(
            "{} joins, {} wrong, {} wrong and held; {} loops between robots kept, {} wrong; {} components",
            self.joins, self.wrong_joins, self.wrong_held, self.loops, self.wrong_loops, self.components
        )
    }
}

fn arguments() -> Result<Walks, Box<dyn Error>> {
    let mut walks = Walks {
        scene: SceneName::House,
        every: 1,
        parts: Vec::new(),
        whole: None,
        seeds: 1..2,
        overrides: Vec::new(),
        is_wire: false,
    };
    let (mut first, mut n_seeds) = (1, 1);
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut value = || words.next().ok_or(format!("{word}: expected a value behind it"));
        match word.as_str() {
            "--scene" => walks.scene = SceneName::parse(&value()?).ok_or("--scene: no such scene")?,
            "--every" => walks.every = value()?.parse::<u64>()?.max(1),
            "--seeds" => n_seeds = value()?.parse()?,
            "--first" => first = value()?.parse()?,
            "--whole" => walks.whole = Some(part(&value()?)?),
            "--wire" => walks.is_wire = true,
            word if word.contains('=') => walks.overrides.push(word.into()),
            word => walks.parts.push(part(word)?),
        }
    }
    walks.seeds = first..first + n_seeds;
    Ok(walks)
}

/// The frames that SKIP+FRAMES names.
fn part(text: &str) -> Result<Range<u64>, Box<dyn Error>> {
    let (skip, frames) = text.split_once('+').ok_or(format!("{text}: expected SKIP+FRAMES"))?;
    let skip: u64 = skip.parse()?;
    Ok(skip..skip + frames.parse::<u64>()?)
}

fn one_seed(walks: &Walks, seed: u64) -> Result<Outcome, Box<dyn Error>> {
    let options = SimulationOptions { seed, ..SimulationOptions::default() };
    let last = walks.parts.iter().chain(&walks.whole).map(|part| part.end).max().unwrap_or(0);
    let source = SimulatedSource::open(walks.scene, None, Some(last), &options)?;
    let mut settings = Settings::load(None, &walks.overrides)?;
    settings.registration.seed += seed;
    settings.mapping.loops.min_frames = (settings.mapping.loops.min_frames / walks.every).max(1);
    let (surface, registration, mapping) = (settings.surface, settings.registration, settings.mapping);
    let method = Method { surface, registration, mapping };
    let truth = &source.ground_truth().ok_or("the scene has ground truth")?.poses;
    let mut robots = Vec::new();
    for part in &walks.parts {
        robots.push(walked(&source, &method, part.clone().step_by(walks.every as usize).collect())?);
    }
    if walks.is_wire {
        robots
            .iter_mut()
            .try_for_each(|robot| robot.travel(source.camera(), method.surface.step as usize))?;
    }
    let context = Context::new(source.camera(), &method.surface, &method.registration, &method.mapping);
    let mut map = JointMap::new(context);
    robots.iter().for_each(|robot| map.add(&robot.state));
    let surfaces = robots.iter().flat_map(|robot| {
        robot.vertices.iter().map(Vec::as_slice).zip(robot.features.iter().map(Vec::as_slice))
    });
    let surfaces = AllSurfaces(surfaces.collect());
    let found = map.join(&surfaces, &mut || ());
    // At its moment: what a join says, before the optimisation judges it.
    let is_wrong = |m: &Meeting| is_apart(&error_of(&map, &robots, truth, (m.own, m.seen)));
    let meetings: Vec<(Meeting, bool)> = found.into_iter().map(|m| (m, is_wrong(&m))).collect();
    let records: Vec<&[AlignRecord]> = robots.iter().map(|robot| robot.records.as_slice()).collect();
    let histories: Vec<&dyn FrameHistory> = records.iter().map(|records| records as _).collect();
    let correction = map.optimise(&surfaces, &histories, &mut || ());
    say_verdicts(&map, correction.as_ref());
    let outcome = judged(&map, &robots, truth, &meetings, correction.as_ref());
    println!("seed {seed}: {}", outcome.told());
    for (meeting, is_wrong) in &meetings {
        let Meeting { own, seen, n_confirmed, overlap, in_front, .. } = meeting;
        let words = if *is_wrong { "WRONG" } else { "right" };
        println!(
            "    keyframe {own} joined to {seen}: {words}; {n_confirmed} agree, {:.0} % overlap, {:.1} % in front",
            100.0 * overlap,
            100.0 * in_front
        );
    }
    say_errors(walks, &map, &robots, truth);
    if let Some(whole) = &walks.whole {
        let robot = walked(&source, &method, whole.clone().step_by(walks.every as usize).collect())?;
        let own: Vec<(Pose, Pose)> = robot.poses(None, truth);
        println!("    one run over all: {:.1} mm", 1e3 * rmse(&aligned(&own), 0..own.len()));
    }
    Ok(outcome)
}

/// Maps these frames of a scene.
fn walked(source: &SimulatedSource, method: &Method, frames: Vec<u64>) -> Result<MappedWalk, Box<dyn Error>> {
    let mut run = Run::new(source.camera(), method)?;
    let (mut features, mut before): (Vec<Vec<Feature>>, Vec<Feature>) = (Vec::new(), Vec::new());
    for some in frames.chunks(16) {
        let read = |index: &u64| RawFrame::read(source, *index);
        let some: Vec<RawFrame> = some.par_iter().map(read).collect::<Result<_, _>>()?;
        for frame in &some {
            run.push(frame);
            let own = run.last_features().to_vec();
            let made = match run.records().last() {
                Some(AlignRecord::Frame(frame)) => {
                    frame.change.new_keyframe.as_ref().map(|k| (frame.index, k))
                }
                _ => None,
            };
            // A keyframe is this frame or the one before it.
            if let Some((index, keyframe)) = made {
                features.push(if index == keyframe.frame_index { own.clone() } else { before });
            }
            before = own;
        }
    }
    let (records, map) = run.finish_with_map();
    let mut state = TrackerState::default();
    records.records.iter().for_each(|record| state.apply(record));
    Ok(MappedWalk { records: records.records, state, vertices: map.surfaces, features, frames })
}

impl MappedWalk {
    /// Leaves what a base has of the surfaces.
    fn travel(&mut self, camera: &Camera, step: usize) -> Result<(), Box<dyn Error>> {
        let [width, height] = [camera.width, camera.height].map(|size| (size as usize).div_ceil(step));
        let grid = Grid { width, height, step };
        let mut sizes = Vec::new();
        for keyframe in &self.state.keyframes {
            let id = keyframe.id as usize;
            let (vertices, features) = if keyframe.is_active() {
                let bytes = pack_surface(grid, |place| self.vertices[id][place], &self.features[id]);
                sizes.push(bytes.len());
                from_wire(grid, &bytes)?
            } else {
                (vec![Vertex::default(); grid.len()], Vec::new())
            };
            (self.vertices[id], self.features[id]) = (vertices, features);
        }
        let (n, bytes) = (sizes.len(), sizes.iter().sum::<usize>());
        let all = self.state.keyframes.len();
        let seconds = self.frames.len() as f64 / 30.0;
        println!(
            "    {n} of {all} surfaces travel, {:.1} kB each, {:.0} kB/s at 30 Hz",
            bytes as f64 / 1e3 / n.max(1) as f64,
            bytes as f64 / 1e3 / seconds
        );
        Ok(())
    }

    /// True and estimated pose of every frame, after a further correction where one is given.
    fn poses(&self, correction: Option<Correction>, truth: &[Pose]) -> Vec<(Pose, Pose)> {
        let mut history = PoseHistory::default();
        self.records.iter().for_each(|record| history.apply(record));
        if let Some(correction) = correction {
            let applied = AppliedCorrection { before_frame: u64::MAX, correction };
            history.apply(&AlignRecord::Correction(Box::new(applied)));
        }
        let frames = self.records.iter().filter_map(|record| match record {
            AlignRecord::Frame(frame) => Some(FramePose::from(&**frame)),
            _ => None,
        });
        let truth = self.frames.iter().map(|frame| truth[*frame as usize]);
        truth.zip(frames.map(|frame| history.final_pose(&frame))).collect()
    }
}

/// By how much the map is wrong about where the first of two keyframes stands to the second.
fn error_of(map: &JointMap, robots: &[MappedWalk], truth: &[Pose], (a, b): (u32, u32)) -> Pose {
    let [a, b] = [a, b].map(|id| {
        let keyframe = &map.keyframes()[id as usize];
        let robot = &robots[map.run_of(id).unwrap_or(0)];
        let frame = robot.frames[keyframe.frame_index as usize];
        (Pose::from(&keyframe.world_from_camera), truth[frame as usize])
    });
    (b.1.inverse() * a.1).inverse() * (b.0.inverse() * a.0)
}

fn is_apart(motion: &Pose) -> bool {
    let (metres, radians) = translation_rotation_norms(motion);
    metres > WRONG_M || radians.to_degrees() > WRONG_DEG
}

fn judged(
    map: &JointMap,
    robots: &[MappedWalk],
    truth: &[Pose],
    meetings: &[(Meeting, bool)],
    correction: Option<&Correction>,
) -> Outcome {
    let component = |id: u32| map.submaps().component(map.keyframes()[id as usize].submap);
    let is_held = |meeting: &Meeting| component(meeting.own) == component(meeting.seen);
    let kept = correction.iter().flat_map(|correction| &correction.loops);
    let kept: Vec<(u32, u32)> = kept
        .filter(|l| l.verdict == LoopVerdict::Accepted && l.weight >= 0.5)
        .filter(|l| map.run_of(l.newer) != map.run_of(l.older))
        .map(|l| (l.newer, l.older))
        .collect();
    Outcome {
        components: map.submaps().n_components() as usize,
        joins: meetings.len(),
        wrong_joins: meetings.iter().filter(|(_, is_wrong)| *is_wrong).count(),
        wrong_held: meetings.iter().filter(|(meeting, is_wrong)| *is_wrong && is_held(meeting)).count(),
        loops: kept.len(),
        wrong_loops: kept.iter().filter(|pair| is_apart(&error_of(map, robots, truth, **pair))).count(),
    }
}

/// What became of the pairs of keyframes of two robots that stand near each other in the one map.
fn say_verdicts(map: &JointMap, correction: Option<&Correction>) {
    let mut counts: BTreeMap<String, (usize, f64)> = BTreeMap::new();
    let loops = correction.iter().flat_map(|correction| &correction.loops);
    for pair in loops.filter(|l| map.run_of(l.newer) != map.run_of(l.older)) {
        let count = counts.entry(format!("{:?}", pair.verdict)).or_default();
        count.0 += 1;
        count.1 += pair.in_front;
    }
    for (verdict, (n, in_front)) in counts {
        println!("    pairs of two robots: {n} {verdict}, {:.0} % in front", 100.0 * in_front / n as f64);
    }
}

/// The error of each robot in the axes of the largest component, aligned at once, and alone.
fn say_errors(walks: &Walks, map: &JointMap, robots: &[MappedWalk], truth: &[Pose]) {
    let mut all: Vec<(Pose, Pose)> = Vec::new();
    let mut places = Vec::new();
    for (run, robot) in robots.iter().enumerate() {
        let correction = map.correction_of(run, &robot.state, &robot.records.as_slice());
        let first = all.len();
        all.extend(robot.poses(Some(correction), truth));
        places.push((first..all.len(), map.component(run, 0)));
    }
    let largest = places.iter().map(|(_, component)| *component).min().flatten();
    let errors = {
        let joined = places.iter().filter(|(_, component)| *component == largest);
        let joined: Vec<(Pose, Pose)> = joined.flat_map(|(place, _)| all[place.clone()].to_vec()).collect();
        aligned(&joined)
    };
    let mut at = 0;
    for ((place, component), (robot, part)) in places.iter().zip(robots.iter().zip(&walks.parts)) {
        let own = robot.poses(None, truth);
        let alone = 1e3 * rmse(&aligned(&own), 0..own.len());
        let joint = match *component == largest {
            true => {
                at += place.len();
                format!("{:.1} mm in the one map", 1e3 * rmse(&errors, at - place.len()..at))
            }
            false => "apart".into(),
        };
        println!("    frames {part:?}: {alone:.1} mm alone, {joint}");
    }
    if at > 0 {
        println!("    all in the one map: {:.1} mm", 1e3 * rmse(&errors, 0..at));
    }
}

/// Distances to the truth once all poses are aligned at once, metres.
fn aligned(poses: &[(Pose, Pose)]) -> Vec<f64> {
    let [truth, own]: [Vec<Vector3<f64>>; 2] = [
        poses.iter().map(|(truth, _)| truth.translation.vector).collect(),
        poses.iter().map(|(_, own)| own.translation.vector).collect(),
    ];
    let truth_from_own = align_rigid(&own, &truth);
    own.iter()
        .zip(&truth)
        .map(|(own, truth)| {
            (truth_from_own * nalgebra::Point3::from(*own) - nalgebra::Point3::from(*truth)).norm()
        })
        .collect()
}

fn rmse(errors: &[f64], place: Range<usize>) -> f64 {
    let n = place.len().max(1) as f64;
    (errors[place].iter().map(|error| error * error).sum::<f64>() / n).sqrt()
}
