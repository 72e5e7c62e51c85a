//! The one map of all runs: a pure function of the order in which they came and of their bytes.

use crate::copies::arrivals::{Arrival, Mapped};
use crate::error::FleetError;
use crate::map::past::Past;
use crate::map::scene::{JointScene, MOST_POINTS};
use crate::map::summary::{ComponentSummary, JoinSummary, JoinVerdict, JointSummary, RunSummary};
use crate::map::surfaces::JointSurfaces;
use rustix::fs::{CWD, RenameFlags, renameat_with};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;
use tessera_evaluation::write_tum;
use tessera_geometry::Pose;
use tessera_outputs::{JointCloud, joint_preview, write_file, write_joint_map};
use tessera_settings::Settings;
use tessera_slam::{AlignRecord, AppliedCorrection, Context, FrameHistory, JointCache, JointMap, Meeting};
use tessera_stage::RunFile;

/// Folder of the map in the base's folder.
pub const MAP_FOLDER: &str = "map";
/// Says which map the folder holds.
pub const MAP_NUMBER: &str = "map.number";

/// A map that was made.
pub struct MadeMap {
    /// What it is.
    pub summary: JointSummary,
    /// What it cost.
    pub cost: MapCost,
    /// What the next map need not find out again.
    pub known: KnownMap,
}

/// What a map leaves to the next one, which is the same without it.
#[derive(Debug, Default)]
pub struct KnownMap {
    /// The first run in the map: its settings are those of the map.
    first: Option<u64>,
    cache: JointCache,
}

/// What a map cost, seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapCost {
    /// Reading journals.
    pub read_s: f64,
    /// Looking for places that runs share.
    pub join_s: f64,
    /// Optimising all keyframes in one graph.
    pub optimise_s: f64,
    /// All of it, the outputs included.
    pub all_s: f64,
    /// Keyframes that were looked for among other runs'.
    pub looks: u64,
    /// Those of them of which the last map left the outcome.
    pub looks_known: u64,
}

/// A run that is in the map, or why it is not.
enum RunPart {
    In(Box<Past>),
    Out(String),
}

/// Makes the map of these runs and puts it in the place of the one before, whole or not at all.
///
/// # Errors
/// Where an output cannot be written. A run that cannot be read is left out, and the summary says why.
pub fn make_map(
    base: &Path,
    arrivals: &[Arrival],
    mapped: &Mapped,
    known: KnownMap,
) -> Result<MadeMap, FleetError> {
    let begun = Instant::now();
    let mut cost = MapCost::default();
    let folder = base.join(format!("{MAP_FOLDER}.partial"));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).map_err(FleetError::io("make", &folder))?;
    let mut parts = read_parts(base, arrivals, mapped);
    cost.read_s = begun.elapsed().as_secs_f64();
    let first = arrivals.iter().zip(&parts).find_map(|(arrival, part)| match part {
        RunPart::In(past) => Some((arrival.identity, context_of(&past.run, &past.settings))),
        RunPart::Out(_) => None,
    });
    let mut cache = if known.first == first.as_ref().map(|(identity, _)| *identity) {
        known.cache
    } else {
        JointCache::default()
    };
    let known = first.as_ref().map(|(identity, _)| *identity);
    let labels = labels(arrivals);
    let summary = match first {
        Some((_, context)) => {
            let map = JointMap::knowing(context, std::mem::take(&mut cache));
            joint(&folder, map, (arrivals, &labels, &mut parts), (&mut cost, &mut cache))?
        }
        None => JointSummary::empty(run_summaries(arrivals, &labels, &parts, &BTreeMap::new())),
    };
    summary.write(&folder)?;
    replace(base, &folder, mapped.number)?;
    cost.all_s = begun.elapsed().as_secs_f64();
    Ok(MadeMap { summary, cost, known: KnownMap { first: known, cache } })
}

/// What the algorithms of mapping share, for the camera and settings of a run.
pub(crate) fn context_of(run: &RunFile, settings: &Settings) -> Context {
    Context::new(&run.camera, &settings.surface, &settings.registration, &settings.mapping)
        .in_map_of(&run.map_cameras)
}

fn read_parts(base: &Path, arrivals: &[Arrival], mapped: &Mapped) -> Vec<RunPart> {
    let mut parts: Vec<RunPart> = Vec::new();
    for (arrival, extent) in arrivals.iter().zip(&mapped.extents) {
        let part = match Past::read(base, arrival, *extent, true) {
            // Where the base is says nothing of the map.
            Err(error) => RunPart::Out(error.to_string().replace(&format!("{}/", base.display()), "")),
            Ok(past) => RunPart::In(Box::new(past)),
        };
        parts.push(part);
    }
    parts
}

/// Joins, solves and writes.
fn joint(
    folder: &Path,
    mut map: JointMap,
    (arrivals, labels, parts): (&[Arrival], &[String], &mut [RunPart]),
    (cost, cache): (&mut MapCost, &mut JointCache),
) -> Result<JointSummary, FleetError> {
    let mut surfaces = JointSurfaces::default();
    // Runs in the map by their number among those that are in it.
    let mut pasts: Vec<(usize, &mut Past)> = Vec::new();
    for (number, part) in parts.iter_mut().enumerate() {
        if let RunPart::In(past) = part {
            map.add_seen_by(&past.state, &context_of(&past.run, &past.settings).session_cameras());
            pasts.push((number, past));
        }
    }
    for (run, (_, past)) in pasts.iter().enumerate() {
        surfaces.add(map.keyframes_of(run), past.surfaces.of_keyframes());
    }
    let begun = Instant::now();
    let meetings = map.join(&surfaces, &mut || ());
    cost.join_s = begun.elapsed().as_secs_f64();
    // Runs that share no place stay as they are.
    let histories: Vec<&dyn FrameHistory> = pasts.iter().map(|(_, past)| &past.journal as _).collect();
    let correction = if meetings.is_empty() { None } else { map.optimise(&surfaces, &histories, &mut || ()) };
    drop(histories);
    cost.optimise_s = begun.elapsed().as_secs_f64() - cost.join_s;
    let components = components(&map);
    let seen: Vec<&Past> = pasts.iter().map(|(_, past)| &**past).collect();
    let clouds = write_clouds(folder, &map, &components, &seen, &surfaces)?;
    let output = seen.first().map(|first| first.settings.output.clone()).unwrap_or_default();
    let names = (0..components.0.len()).map(|place| component_file("map", place, "ply"));
    let mut scene = JointScene::new(names, joint_preview(clouds, &output, MOST_POINTS), arrivals);
    drop(surfaces);
    if correction.is_some() {
        for (run, (_, past)) in pasts.iter_mut().enumerate() {
            let correction = map.correction_of(run, &past.state, &past.journal);
            let applied = AppliedCorrection { before_frame: past.state.next_index, correction };
            past.replay.apply(AlignRecord::Correction(Box::new(applied)));
        }
    }
    let mut places = BTreeMap::new();
    for (run, (number, past)) in pasts.iter().enumerate() {
        places.insert(*number, write_run(folder, &labels[*number], &map, run, &components, past)?);
        let place = |submap| map.component(run, submap).and_then(|of| components.place(of));
        scene.add_run(&arrivals[*number], &past.replay, place);
    }
    let run_of =
        |keyframe: u32| map.run_of(keyframe).map_or_else(String::new, |run| labels[pasts[run].0].clone());
    let joins: Vec<JoinSummary> =
        meetings.iter().map(|meeting| join_summary(&map, meeting, &run_of)).collect();
    scene.write(folder, &joins, |component| components.place(component))?;
    let loops = correction.map_or(Vec::new(), |correction| correction.loops);
    let between = loops.iter().filter(|l| map.run_of(l.newer) != map.run_of(l.older)).copied().collect();
    let components = component_summaries(&components, &places, labels);
    drop(pasts);
    *cache = map.into_cache();
    let (looks, looks_known) = cache.looks();
    (cost.looks, cost.looks_known) = (looks as u64, looks_known as u64);
    for part in parts.iter_mut() {
        let damage = match part {
            RunPart::In(past) => past.surfaces.check().err(),
            RunPart::Out(_) => None,
        };
        // What was computed from it is no map.
        damage.map_or(Ok(()), Err)?;
    }
    let runs = run_summaries(arrivals, labels, parts, &places);
    Ok(JointSummary::new(runs, components, joins, between))
}

fn component_summaries(
    components: &MapComponents,
    places: &BTreeMap<usize, BTreeMap<u32, u64>>,
    labels: &[String],
) -> Vec<ComponentSummary> {
    let runs_in = |component: u32| {
        let runs = places.iter().filter(move |(_, place)| place.contains_key(&component));
        runs.filter_map(|(number, _)| labels.get(*number).cloned()).collect()
    };
    let summary = |(place, (component, keyframes)): (usize, &(u32, u64))| ComponentSummary {
        component: *component,
        keyframes: *keyframes,
        map: component_file("map", place, "ply"),
        runs: runs_in(*component),
    };
    components.0.iter().enumerate().map(summary).collect()
}

/// Writes the cloud of each component, with the settings of the first run.
fn write_clouds(
    folder: &Path,
    map: &JointMap,
    components: &MapComponents,
    pasts: &[&Past],
    surfaces: &JointSurfaces<'_>,
) -> Result<Vec<JointCloud>, FleetError> {
    let Some(first) = pasts.first() else { return Ok(Vec::new()) };
    let seen_by = |k| {
        let past = map.run_of(k).map_or(*first, |run| pasts[run]);
        (&past.run.camera, past.settings.surface.step as usize)
    };
    let mut clouds = Vec::new();
    for (place, component) in components.keys().enumerate() {
        let name = component_file("map", place, "ply");
        let is_in = |k: &&tessera_slam::KeyframeState| map.submaps().component(k.submap) == *component;
        let keyframes = map.keyframes().iter().filter(is_in).map(|k| (k, seen_by(k.id)));
        clouds.push(write_joint_map((folder, &name), &first.settings.output, keyframes, surfaces)?);
    }
    Ok(clouds)
}

/// Keyframes of each component, the largest component first.
struct MapComponents(Vec<(u32, u64)>);

impl MapComponents {
    fn keys(&self) -> impl Iterator<Item = &u32> {
        self.0.iter().map(|(component, _)| component)
    }

    fn place(&self, component: u32) -> Option<usize> {
        self.0.iter().position(|(known, _)| *known == component)
    }
}

fn components(map: &JointMap) -> MapComponents {
    let mut counts: BTreeMap<u32, u64> = BTreeMap::new();
    for keyframe in map.keyframes() {
        *counts.entry(map.submaps().component(keyframe.submap)).or_default() += 1;
    }
    let mut counts: Vec<(u32, u64)> = counts.into_iter().collect();
    counts.sort_by_key(|(component, n)| (std::cmp::Reverse(*n), *component));
    MapComponents(counts)
}

/// `NAME.EXT` of the largest component, `NAME_component_K.EXT` of the next ones.
pub(crate) fn component_file(name: &str, place: usize, extension: &str) -> String {
    match place {
        0 => format!("{name}.{extension}"),
        place => format!("{name}_component_{place}.{extension}"),
    }
}

/// Writes the trajectories of a run, one for each component that it has frames in; answers the frames of
/// each.
fn write_run(
    folder: &Path,
    label: &str,
    map: &JointMap,
    run: usize,
    components: &MapComponents,
    past: &Past,
) -> Result<BTreeMap<u32, u64>, FleetError> {
    let mut rows: BTreeMap<u32, Vec<(i64, Pose)>> = BTreeMap::new();
    for frame in &past.replay.frames {
        let Some(component) = map.component(run, past.replay.component(frame)) else { continue };
        let row = (frame.stamp_nanos, past.replay.final_pose(frame));
        rows.entry(component).or_default().push(row);
    }
    for (component, rows) in &rows {
        let Some(place) = components.place(*component) else { continue };
        let name = component_file(&format!("trajectory_{label}"), place, "txt");
        let header = format!(
            "final pose of every frame of {label} in the axes of {}\nworld_from_camera, metres: timestamp tx ty tz qx qy qz qw",
            component_file("map", place, "ply")
        );
        write_file(&folder.join(name), |mut writer| {
            write_tum(&mut writer, &header, rows.iter().map(|(stamp, pose)| (*stamp, pose)))
        })?;
    }
    Ok(rows.iter().map(|(component, rows)| (*component, rows.len() as u64)).collect())
}

fn join_summary(map: &JointMap, meeting: &Meeting, run_of: &dyn Fn(u32) -> String) -> JoinSummary {
    let component = |id: u32| map.keyframes().get(id as usize).map(|k| map.submaps().component(k.submap));
    let at_m = |id: u32| map.keyframes().get(id as usize).map(|k| k.world_from_camera.translation_m);
    let is_held = component(meeting.own) == component(meeting.seen);
    JoinSummary {
        run: run_of(meeting.own),
        with: run_of(meeting.seen),
        keyframe: meeting.own,
        with_keyframe: meeting.seen,
        component: component(meeting.own).filter(|_| is_held),
        at_m: at_m(meeting.own),
        with_at_m: at_m(meeting.seen),
        keyframes_agree: meeting.n_confirmed,
        overlap: meeting.overlap,
        in_front: meeting.in_front,
        verdict: if is_held { JoinVerdict::Held } else { JoinVerdict::Refuted },
    }
}

fn run_summaries(
    arrivals: &[Arrival],
    labels: &[String],
    parts: &[RunPart],
    places: &BTreeMap<usize, BTreeMap<u32, u64>>,
) -> Vec<RunSummary> {
    let summary = |(number, part): (usize, &RunPart)| {
        let Arrival { robot, run, .. } = &arrivals[number];
        let mut summary = RunSummary {
            robot: robot.clone(),
            run: run.clone(),
            label: labels[number].clone(),
            ..RunSummary::default()
        };
        match part {
            RunPart::Out(reason) => summary.left_out = Some(reason.clone()),
            RunPart::In(past) => {
                summary.keyframes = past.state.keyframes.len() as u64;
                summary.frames = past.replay.frames.len() as u64;
                summary.frames_untracked = past.replay.n_untracked();
                summary.is_ended = past.state.is_ended;
                summary.frames_by_component = places.get(&number).cloned().unwrap_or_default();
            }
        }
        summary
    };
    parts.iter().enumerate().map(summary).collect()
}

/// `ROBOT_RUN`, numbered where that is taken.
fn labels(arrivals: &[Arrival]) -> Vec<String> {
    let mut labels: Vec<String> = Vec::new();
    for arrival in arrivals {
        let plain = match arrival.robot.as_str() {
            crate::copies::arrivals::DISK => arrival.run.clone(),
            robot => format!("{robot}_{}", arrival.run),
        };
        let numbered = (2..).map(|n| format!("{plain}-{n}"));
        let label = std::iter::once(plain.clone()).chain(numbered).find(|label| !labels.contains(label));
        labels.extend(label);
    }
    labels
}

/// Puts the folder in the place of the map before, in one step, and writes down which one it is.
fn replace(base: &Path, folder: &Path, number: u64) -> Result<(), FleetError> {
    let place = base.join(MAP_FOLDER);
    if place.exists() {
        renameat_with(CWD, folder, CWD, &place, RenameFlags::EXCHANGE)
            .map_err(|error| FleetError::io("replace", &place)(error.into()))?;
        let _ = std::fs::remove_dir_all(folder);
    } else {
        std::fs::rename(folder, &place).map_err(FleetError::io("make", &place))?;
    }
    write_file(&base.join(MAP_NUMBER), |writer| write!(writer, "{number}"))?;
    Ok(())
}

/// The map that is in its place; 0: none.
pub fn map_number(base: &Path) -> u64 {
    let text = std::fs::read_to_string(base.join(MAP_NUMBER)).unwrap_or_default();
    let is_there = base.join(MAP_FOLDER).join(crate::map::summary::SUMMARY_FILE).is_file();
    if is_there { text.trim().parse().unwrap_or(0) } else { 0 }
}

/// Where the map is.
pub fn map_folder(base: &Path) -> PathBuf {
    base.join(MAP_FOLDER)
}
