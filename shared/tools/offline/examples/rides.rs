//! Rides of a lift in buildings of other proportions: whether they are noticed, and what is joined then.
//!
//! `cargo run --release -p tessera-offline --example rides -- [--seeds N] [--first SEED] [--door] [--looks] [key=value]...`
//!
//! A seed is that of the building's proportions, of its textures and of the noise; 0 is the building as the test
//! `lift` walks it. At 10 Hz and 320x240 the camera goes out of the lift into the first room and back into the cabin,
//! rides, goes out on the storey above, the same way back, and round the first room once more.
//! A ride is noticed where a submap begins: so many metres after the front of the cabin, or in it, where what is seen
//! does not tell the storey, be it that the door closes. A join is wrong where it puts the camera more than 1 m or 30
//! degrees from where it truly is to the nearest frame of the other component. Storeys are mixed where frames of two are
//! in one component with a height that is more than 1 m off, but for those in the cabin and up to 3 m after it.
//! `--looks` prints the evidence against the map by frames.
//! With `--door` the door closes and opens again, and the camera goes the first way once more: a submap that begins is
//! a false one.
#![forbid(unsafe_code)]

use rayon::prelude::*;
use std::collections::BTreeMap;
use std::error::Error;
use tessera_geometry::{Camera, Pose, translation_rotation_norms};
use tessera_offline::{ColourState, Method, RawFrame, Records, Run};
use tessera_settings::Settings;
use tessera_slam::{
    AlignRecord, ColourModel, ContradictionRecord, FrameRecord, JoinRecord, PoseHistory, State,
};
use tessera_sources::{SceneName, SimulatedSource, SimulationOptions, Source};

/// A join is wrong beyond these, and a height beyond the first.
const WRONG_M: f64 = 1.0;
const WRONG_DEG: f64 = 30.0;
/// Way after the front of the cabin on which a ride is to be noticed, metres.
const NOTICED_M: f64 = 3.0;
/// A tenth of a second from frame to frame.
const EVERY: usize = 3;
/// Front of the cabin, far enough in the first room and at the end of it, metres along x.
const FRONT_M: f64 = -12.65;
const IN_ROOM_M: f64 = -8.7;
const ROUND_ROOM_M: f64 = -6.0;
/// Way out of the cabin on the storey above, metres.
const OUT_M: f64 = 5.0;
/// Heights of the camera at rest on the ground storey and above, metres; the walk itself moves it by less than 0.1 m.
const AT_REST_M: [f64; 2] = [1.4, 4.4];
const UNSTEADY_M: f64 = 0.1;
/// The camera looks at the door of the lift within this angle, radians: the hand moves it by 1 degree.
const AT_DOOR_RAD: f64 = 0.07;

/// What is walked, and printed.
#[derive(Clone, Copy)]
struct Asked {
    has_looks: bool,
    is_door_alone: bool,
}

/// What became of one run.
struct Outcome {
    noticed: Vec<RideNotice>,
    n_wrong: usize,
    n_mixed: usize,
}

/// When a ride was noticed.
#[derive(Clone, Copy, Debug)]
enum RideNotice {
    /// In the cabin, before it rides.
    Before,
    /// So many metres after the front of the cabin; 0 in it.
    After(f64),
    Missed,
}

/// The frames that are seen, as indices of the source, and their true poses.
struct RidesWalk {
    indices: Vec<u64>,
    truth: Vec<Pose>,
    /// Where in them the camera enters the cabin before each ride, and where that begins.
    rides: Vec<[usize; 2]>,
    /// Way since the front of the cabin after the last ride, metres; none before the first one.
    since_m: Vec<Option<f64>>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let (mut n_seeds, mut first, mut overrides) = (10, 1, Vec::new());
    let mut asked = Asked { has_looks: false, is_door_alone: false };
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut number =
            || arguments.next().ok_or(format!("{argument} N"))?.parse::<u64>().map_err(|e| e.to_string());
        match argument.as_str() {
            "--seeds" => n_seeds = number()?,
            "--first" => first = number()?,
            "--looks" => asked.has_looks = true,
            "--door" => asked.is_door_alone = true,
            a if a.contains('=') => overrides.push(argument),
            other => {
                return Err(
                    format!("{other}: expected --seeds, --first, --door, --looks or key=value").into()
                );
            }
        }
    }
    let (mut n_noticed, mut n_before, mut n_rides, mut n_wrong, mut n_mixed) = (0, 0, 0, 0, 0);
    for seed in first..first + n_seeds {
        let outcome = run(seed, asked, &overrides)?;
        n_rides += outcome.noticed.len();
        let is_in_time = |notice: &&RideNotice| match notice {
            RideNotice::Before => true,
            RideNotice::After(way_m) => *way_m <= NOTICED_M,
            RideNotice::Missed => false,
        };
        n_noticed += outcome.noticed.iter().filter(is_in_time).count();
        n_before += outcome.noticed.iter().filter(|notice| matches!(notice, RideNotice::Before)).count();
        n_wrong += outcome.n_wrong;
        n_mixed += usize::from(outcome.n_mixed > 0);
    }
    println!(
        "{n_seeds} seeds: {n_noticed} of {n_rides} rides noticed within {NOTICED_M} m ({n_before} before they began), \
         {n_wrong} wrong joins, {n_mixed} seeds with mixed storeys"
    );
    Ok(())
}

/// The building of a seed, seen by a camera of 320x240 pixels.
fn building(seed: u64) -> Result<SimulatedSource, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("camera.toml");
    let camera = Camera::pinhole((320, 240), [262.5, 262.5, 159.5, 119.5], 5000.0);
    std::fs::write(&file, toml::to_string(&camera)?)?;
    let options = SimulationOptions { seed: seed.max(1), proportions: seed, ..SimulationOptions::default() };
    Ok(SimulatedSource::open(SceneName::Building, file.to_str(), None, &options)?)
}

fn run(seed: u64, asked: Asked, overrides: &[String]) -> Result<Outcome, Box<dyn Error>> {
    let source = building(seed)?;
    let walk =
        RidesWalk::new(&source, asked.is_door_alone).ok_or("the way through the building has no ride")?;
    let settings = Settings::load(None, overrides)?;
    let (surface, registration, mapping) = (settings.surface, settings.registration, settings.mapping);
    let mut run = Run::new(source.camera(), &Method { surface, registration, mapping })?;
    let numbered: Vec<(usize, u64)> = (0..).step_by(EVERY).zip(walk.indices.iter().copied()).collect();
    for some in numbered.chunks(32) {
        let read = |&(k, index): &(usize, u64)| -> Result<RawFrame, tessera_sources::SourceError> {
            let stamp_nanos = 1_000_000_000 + k as i64 * 33_333_333;
            Ok(RawFrame { stamp_nanos, ..RawFrame::read(&source, index)? })
        };
        let frames: Vec<RawFrame> = some.par_iter().map(read).collect::<Result<_, _>>()?;
        frames.iter().for_each(|frame| drop(run.push(frame)));
    }
    let records = run.finish();
    let frames: Vec<&FrameRecord> = records.frames().collect();
    if asked.has_looks {
        print_looks(&walk, &frames);
    }
    let (n_joins, n_wrong) = joins(&walk, &records);
    let noticed = walk.noticed(&frames);
    let n_mixed = n_mixed(&walk, &records);
    let n_first = walk.rides.first().map_or(frames.len(), |[enters, _]| *enters);
    let n_early = frames[..n_first].iter().filter(|frame| frame.submap > 0).count();
    println!(
        "seed {seed}: rides noticed {noticed:.2?}; {n_joins} joins, {n_wrong} wrong; {n_mixed} of {} frames mixed; {} \
         submaps in {} components; {n_early} frames in another submap on the first way, {} untracked",
        frames.len(),
        records.submaps().n(),
        records.submaps().n_components(),
        records.n_untracked(),
    );
    Ok(Outcome { noticed, n_wrong, n_mixed })
}

impl RidesWalk {
    /// The way, from the height and the place of the true poses; `None` without a ride.
    fn new(source: &SimulatedSource, is_door_alone: bool) -> Option<Self> {
        let all = &source.ground_truth()?.poses;
        let at = |k: usize| all[k].translation.vector;
        let first = |from: usize, is: &dyn Fn(usize) -> bool| (from..all.len()).find(|k| is(*k));
        let in_room = first(0, &|k| at(k).x > IN_ROOM_M)?;
        let round_room = first(in_room, &|k| at(k).x > ROUND_ROOM_M)?;
        let rides = first(0, &|k| at(k).z > AT_REST_M[0] + UNSTEADY_M)?;
        let is_turning = |k: &usize| {
            let view = all[*k].rotation * nalgebra::Vector3::z();
            view.y.atan2(view.x).abs() > AT_DOOR_RAD
        };
        let turned = (0..rides).rev().find(is_turning)? + 1;
        let arrived = first(rides, &|k| at(k).z > AT_REST_M[1] - UNSTEADY_M)?;
        let at_front = first(arrived, &|k| at(k).x > FRONT_M)?;
        let mut way_m = 0.0;
        let out = (at_front + EVERY..all.len()).step_by(EVERY).find(|k| {
            way_m += (at(*k) - at(*k - EVERY)).norm();
            way_m > OUT_M
        })?;
        let way_out = (0..in_room).chain((0..in_room).rev());
        let [shown, again] =
            if is_door_alone { [turned..rides, 0..in_room] } else { [turned..out, 0..round_room] };
        let there = way_out.chain(shown.clone());
        let indices =
            there.chain(shown.rev()).chain(again).step_by(EVERY).map(|k| k as u64).collect::<Vec<_>>();
        let truth: Vec<Pose> = indices.iter().map(|k| all[*k as usize]).collect();
        let (rides, since_m) = since_rides(&truth);
        Some(Self { indices, truth, rides, since_m })
    }

    /// When each ride was noticed: the first frame of another submap than the one in which the cabin was entered.
    fn noticed(&self, frames: &[&FrameRecord]) -> Vec<RideNotice> {
        let ends = self.rides.iter().skip(1).map(|[enters, _]| *enters).chain([frames.len()]);
        let of = |(&[enters, begins], end): (&[usize; 2], usize)| {
            let is_noticed = |k: &usize| frames[*k].submap != frames[enters].submap;
            match (enters..end).find(is_noticed) {
                None => RideNotice::Missed,
                Some(k) if k < begins => RideNotice::Before,
                Some(k) => self.since_m[k].map_or(RideNotice::Missed, RideNotice::After),
            }
        };
        self.rides.iter().zip(ends).map(of).collect()
    }
}

/// Where the cabin is entered and rides begin, and for each frame the way since the front of the cabin after the last
/// one, metres.
fn since_rides(truth: &[Pose]) -> (Vec<[usize; 2]>, Vec<Option<f64>>) {
    let at = |k: usize| truth[k].translation.vector;
    let [low_m, high_m] = [AT_REST_M[0] + UNSTEADY_M, AT_REST_M[1] - UNSTEADY_M];
    let is_carried = |k: usize| (low_m..high_m).contains(&at(k).z);
    let (mut rides, mut since_m) = (Vec::new(), Vec::new());
    let mut since = None;
    for k in 0..truth.len() {
        if is_carried(k) && (k == 0 || !is_carried(k - 1)) {
            let enters = (0..k).rev().find(|before| at(*before).x > FRONT_M).map_or(0, |before| before + 1);
            rides.push([enters, k]);
            since = Some(0.0);
        }
        since = since.map(|way_m: f64| match k {
            _ if at(k).x < FRONT_M && way_m == 0.0 => 0.0,
            0 => way_m,
            _ => way_m + (at(k) - at(k - 1)).norm(),
        });
        since_m.push(since);
    }
    (rides, since_m)
}

/// Joins, and those of them that are wrong, which are printed.
fn joins(walk: &RidesWalk, records: &Records) -> (usize, usize) {
    let (mut history, mut frames) = (PoseHistory::default(), Vec::<&FrameRecord>::new());
    let (mut n_joins, mut n_wrong) = (0, 0);
    for record in &records.records {
        let AlignRecord::Frame(frame) = record else {
            history.apply(record);
            continue;
        };
        let before: Vec<u32> = frames.iter().map(|frame| history.component_of_frame(frame)).collect();
        history.apply(record);
        frames.push(frame);
        let Some(join) = frame.change.join else { continue };
        n_joins += 1;
        let told = off(walk, &history, (&frames, &before), &join);
        let is_wrong = told.is_none_or(|(m, deg)| m > WRONG_M || deg > WRONG_DEG);
        n_wrong += usize::from(is_wrong);
        if is_wrong {
            println!("    frame {} of the run: {told:?} (m, deg) off: {}", frame.index, frame.reason());
        }
    }
    (n_joins, n_wrong)
}

/// How far a join puts the camera from where it truly is to the nearest frame of the other component, metres and
/// degrees. `before`: the component of each earlier frame before the join.
fn off(
    walk: &RidesWalk,
    history: &PoseHistory,
    (frames, before): (&[&FrameRecord], &[u32]),
    join: &JoinRecord,
) -> Option<(f64, f64)> {
    let pose = |k: usize| history.final_pose(&frames[k].into());
    let now = frames.len() - 1;
    let own = before[now - 1];
    let other = if own == join.kept { join.moved } else { join.kept };
    let apart_m = |k: &usize| (pose(*k).translation.vector - pose(now).translation.vector).norm();
    let of_other = (0..now).filter(|k| before[*k] == other);
    let nearest = of_other.min_by(|a, b| apart_m(a).total_cmp(&apart_m(b)))?;
    let [found, truly] = [[pose(nearest), pose(now)], [walk.truth[nearest], walk.truth[now]]]
        .map(|[seen, own]| seen.inverse() * own);
    let (metres, radians) = translation_rotation_norms(&(truly.inverse() * found));
    Some((metres, radians.to_degrees()))
}

/// Frames whose height is wrong to the first frame of their component, which is of another storey.
fn n_mixed(walk: &RidesWalk, records: &Records) -> usize {
    let poses = records.last().poses;
    let is_of_map = |k: &usize| {
        let is_outside = walk.truth[*k].translation.x > FRONT_M;
        is_outside && walk.since_m[*k].is_none_or(|way_m| way_m > NOTICED_M)
    };
    let mut first_of = BTreeMap::new();
    let components = records.components();
    let tracked: Vec<bool> = records.frames().map(|frame| frame.state == State::Tracking).collect();
    (0..poses.len())
        .filter(is_of_map)
        .filter(|k| {
            let first = *first_of.entry(components[*k]).or_insert(*k);
            let found = walk.truth[first] * (poses[first].inverse() * poses[*k]);
            let true_m = walk.truth[*k].translation.z;
            let is_other_storey = (true_m - walk.truth[first].translation.z).abs() > WRONG_M;
            tracked[*k] && is_other_storey && (found.translation.z - true_m).abs() > WRONG_M
        })
        .count()
}

/// Frames whose look changed the evidence against the map, or that changed the map itself.
fn print_looks(walk: &RidesWalk, frames: &[&FrameRecord]) {
    let (mut before, mut colour) = (None, ColourState::default());
    let published = |k: usize| Pose::from(&frames[k].pose.world_from_camera);
    let world_from_map = walk.truth[0] * published(0).inverse();
    for (k, frame) in frames.iter().enumerate() {
        let known = frame.change.contradiction;
        let was_trusted = colour.is_trusted();
        let seen = frames[..=k].iter().map(|frame| frame.evidence.of_camera());
        colour = ColourState::of_records(ColourModel::default(), seen);
        if colour.is_trusted() != was_trusted {
            let trust = if was_trusted { "no longer trusted" } else { "trusted again" };
            println!("    frame {k}: colour is {trust}");
        }
        let is_told = known != before || frame.change.join.is_some() || frame.change.split.is_some();
        if is_told {
            let looks = known.map(|known| {
                let ContradictionRecord { first, seen, n_looks, .. } = known;
                format!("{:.2} nats since keyframe {first}, {n_looks} looks at {seen}", known.sum_nats())
            });
            let found = (world_from_map * published(k)).translation.vector;
            let off_m = found - walk.truth[k].translation.vector;
            println!(
                "    frame {k} of submap {}, {:.2?} m off, true height {:.2} m, {:.2?} m after the cabin: {}; {}",
                frame.submap,
                off_m.as_slice(),
                walk.truth[k].translation.z,
                walk.since_m[k].unwrap_or(f64::NAN),
                looks.unwrap_or_else(|| "nothing against the map".into()),
                frame.reason()
            );
        }
        before = known;
    }
}
