//! How well places are recognised by their features, and by ferns: recall and precision, and times.
//!
//! `cargo run --release -p tessera-offline --example recognise_places -- SEQUENCE... [--frames N] [--every N] [--gap N] [--simulation 'KEY = VALUE'] [--scale]`
//!
//! Each tenth frame is a place, and each fifth is looked for among the places at least `--gap` frames
//! before it. A place is the right one within 0.5 m and 30 degrees of the frame's true pose, and a
//! wrong one beyond 2 m or 60 degrees: between them it may show a part of the same.
//! `--scale` measures the time of a search among 2,000 and 20,000 places.
#![forbid(unsafe_code)]

use std::error::Error;
use std::time::Instant;
use tessera_evaluation::Trajectory;
use tessera_features::{Feature, PlaceIndex};
use tessera_geometry::{Pose, translation_rotation_norms};
use tessera_numerics::SplitMix64;
use tessera_offline::RawFrame;
use tessera_settings::Settings;
use tessera_slam::{Ferns, PlaceCode, similarity};
use tessera_sources::{SimulationOptions, Source, SourceOptions, SourceSpec};
use tessera_surface::{Reconstructor, SurfaceView, Vertex};

/// Frames from place to place and from search to search.
const PLACE_EVERY: usize = 10;
const SEARCH_EVERY: usize = 5;
/// A place is the right one within these.
const RIGHT_M: f64 = 0.5;
const RIGHT_DEG: f64 = 30.0;
/// A place is a wrong one beyond one of these.
const WRONG_M: f64 = 2.0;
const WRONG_DEG: f64 = 60.0;

/// One frame, as recognition sees it.
struct TrueView {
    features: Vec<Feature>,
    code: PlaceCode,
    world_from_camera: Pose,
}

fn main() -> Result<(), Box<dyn Error>> {
    let (mut sequences, mut frames, mut every, mut gap) = (Vec::new(), None, 1, 150);
    let (mut is_scaled, mut simulation) = (false, SimulationOptions::default());
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--frames" => frames = Some(arguments.next().ok_or("--frames N")?.parse::<u64>()?),
            "--every" => every = arguments.next().ok_or("--every N")?.parse::<u64>()?.max(1),
            "--gap" => gap = arguments.next().ok_or("--gap N")?.parse::<usize>()?,
            "--scale" => is_scaled = true,
            "--simulation" => {
                let table = arguments.next().ok_or("--simulation 'key = value'")?;
                simulation = toml::from_str::<SimulationOptions>(&table)?;
            }
            _ => sequences.push(argument),
        }
    }
    for sequence in &sequences {
        let options = SourceOptions { frames, simulation: simulation.clone(), ..SourceOptions::default() };
        let source = tessera_sources::open(&SourceSpec::parse(sequence), &options)?;
        let views = views(source.as_ref(), every)?;
        println!("{sequence}: {} frames with a true pose", views.len());
        by_features(&views, gap);
        by_ferns(&views, gap);
        if is_scaled {
            scale(&views, 2_000);
            scale(&views, 20_000);
        }
    }
    Ok(())
}

fn views(source: &dyn Source, every: u64) -> Result<Vec<TrueView>, Box<dyn Error>> {
    let settings = Settings::default();
    let truth = source.ground_truth().ok_or("a sequence with ground truth is needed")?;
    let mut extractor = settings.mapping.features.extractor(source.camera(), settings.registration.isa);
    let mut reconstructor = Reconstructor::new(source.camera(), &settings.surface)?;
    let grid = reconstructor.grid();
    let mut vertices = vec![Vertex::default(); grid.len()];
    let ferns = Ferns::default();
    let mut views = Vec::new();
    for index in (0..source.n_frames().unwrap_or(0)).step_by(every as usize) {
        let frame = RawFrame::read(source, index)?;
        let Some(world_from_camera) = true_pose(truth, frame.stamp_nanos) else { continue };
        reconstructor.reconstruct(&frame.depth, frame.colour.as_deref(), &mut vertices);
        let code = ferns.code(&SurfaceView { grid, vertices: &vertices });
        views.push(TrueView {
            features: extractor.extract(frame.colour.as_deref()),
            code,
            world_from_camera,
        });
    }
    Ok(views)
}

fn true_pose(truth: &Trajectory, stamp_nanos: i64) -> Option<Pose> {
    let after = truth.stamps_nanos.partition_point(|stamp| *stamp < stamp_nanos);
    if truth.stamps_nanos.get(after) == Some(&stamp_nanos) {
        return Some(truth.poses[after]);
    }
    let before = after.checked_sub(1)?;
    let (t0, t1) = (truth.stamps_nanos[before], *truth.stamps_nanos.get(after)?);
    let share = (stamp_nanos - t0) as f64 / (t1 - t0) as f64;
    (t1 - t0 < 100_000_000).then(|| truth.poses[before].lerp_slerp(&truth.poses[after], share))
}

/// Metres and degrees between two views.
fn apart(a: &TrueView, b: &TrueView) -> (f64, f64) {
    let (metres, radians) =
        translation_rotation_norms(&(a.world_from_camera.inverse() * b.world_from_camera));
    (metres, radians.to_degrees())
}

fn is_right(a: &TrueView, b: &TrueView) -> bool {
    let (metres, degrees) = apart(a, b);
    metres <= RIGHT_M && degrees <= RIGHT_DEG
}

fn is_wrong(a: &TrueView, b: &TrueView) -> bool {
    let (metres, degrees) = apart(a, b);
    metres > WRONG_M || degrees > WRONG_DEG
}

/// What one search found: the score of its best answer, whether that is right, and whether one of
/// the first three is.
struct SearchOutcome {
    score: f64,
    is_right: bool,
    is_wrong: bool,
    is_among_three: bool,
    /// Whether there is a right place at all.
    is_known: bool,
}

fn by_features(views: &[TrueView], gap: usize) {
    let mut index = PlaceIndex::new(Settings::default().registration.isa.arch());
    let (mut searches, mut times_ms) = (Vec::new(), Vec::new());
    for at in (0..views.len()).step_by(SEARCH_EVERY) {
        let Some(last) = at.checked_sub(gap) else { continue };
        let places = (0..=last).step_by(PLACE_EVERY);
        index.hold_only(places.clone().map(|place| place as u32), |place| &views[place as usize].features);
        let started = Instant::now();
        let found = index.find(&views[at].features, 3, 1, |_| true);
        times_ms.push(started.elapsed().as_secs_f64() * 1e3);
        let answers: Vec<(f64, usize)> =
            found.iter().map(|found| (f64::from(found.n_words), found.place as usize)).collect();
        searches.push(search(views, at, places, &answers));
    }
    print_result("features", &mut searches, &mut times_ms);
}

fn by_ferns(views: &[TrueView], gap: usize) {
    let (mut searches, mut times_ms) = (Vec::new(), Vec::new());
    for at in (0..views.len()).step_by(SEARCH_EVERY) {
        let Some(last) = at.checked_sub(gap) else { continue };
        let places = (0..=last).step_by(PLACE_EVERY);
        let started = Instant::now();
        let alike = |place: usize| (similarity(&views[at].code, &views[place].code), place);
        let mut answers: Vec<(f64, usize)> = places.clone().map(alike).collect();
        answers.sort_by(|a, b| b.0.total_cmp(&a.0));
        answers.truncate(3);
        times_ms.push(started.elapsed().as_secs_f64() * 1e3);
        searches.push(search(views, at, places, &answers));
    }
    print_result("ferns", &mut searches, &mut times_ms);
}

fn search(
    views: &[TrueView],
    at: usize,
    mut places: impl Iterator<Item = usize>,
    answers: &[(f64, usize)],
) -> SearchOutcome {
    let right = |place: usize| is_right(&views[place], &views[at]);
    SearchOutcome {
        score: answers.first().map_or(0.0, |best| best.0),
        is_right: answers.first().is_some_and(|best| right(best.1)),
        is_wrong: answers.first().is_some_and(|best| is_wrong(&views[best.1], &views[at])),
        is_among_three: answers.iter().any(|answer| right(answer.1)),
        is_known: places.any(right),
    }
}

fn print_result(name: &str, searches: &mut [SearchOutcome], times_ms: &mut [f64]) {
    let n_known = searches.iter().filter(|search| search.is_known).count();
    let share = |n: usize| 100.0 * n as f64 / n_known.max(1) as f64;
    searches.sort_by(|a, b| b.score.total_cmp(&a.score));
    let sure = searches.iter().take_while(|search| !search.is_wrong);
    let n_sure = sure.filter(|search| search.is_right).count();
    let wrong = searches.iter().find(|search| search.is_wrong).map_or(0.0, |search| search.score);
    let n_right = searches.iter().filter(|search| search.is_right).count();
    let n_three = searches.iter().filter(|search| search.is_among_three).count();
    times_ms.sort_by(f64::total_cmp);
    println!(
        "    {name:8} {} searches, {n_known} of places seen before: {:.0} % found first, {:.0} % among three, \
         {:.0} % before the first wrong answer (at score {wrong:.2}), {:.3} ms",
        searches.len(),
        share(n_right),
        share(n_three),
        share(n_sure),
        times_ms.get(times_ms.len() / 2).unwrap_or(&f64::NAN)
    );
}

/// The time of a search among many places: the views again and again, each time with other bits turned.
fn scale(views: &[TrueView], n_places: u32) {
    let mut random = SplitMix64::new(1);
    let mut places: Vec<Vec<Feature>> = Vec::new();
    for place in 0..n_places as usize {
        let mut features = views[place % views.len()].features.clone();
        for feature in &mut features {
            // Another scene has other words: 80 of 256 bits.
            (0..80).for_each(|_| feature.descriptor[random.below(4)] ^= 1 << random.below(64));
        }
        places.push(features);
    }
    let mut index = PlaceIndex::new(Settings::default().registration.isa.arch());
    let started = Instant::now();
    index.hold_only(0..n_places, |place| &places[place as usize]);
    let made_s = started.elapsed().as_secs_f64();
    let (mut n_right, mut times_ms) = (0, Vec::new());
    for at in (0..n_places as usize).step_by(n_places as usize / 200) {
        let mut features = places[at].clone();
        for feature in &mut features {
            (0..25).for_each(|_| feature.descriptor[random.below(4)] ^= 1 << random.below(64));
        }
        let started = Instant::now();
        let found = index.find(&features, 3, 1, |_| true);
        times_ms.push(started.elapsed().as_secs_f64() * 1e3);
        n_right += usize::from(found.first().is_some_and(|found| found.place as usize == at));
    }
    times_ms.sort_by(f64::total_cmp);
    println!(
        "    {n_places} places: made in {made_s:.2} s, a search {:.2} ms (p90 {:.2}), {n_right} of {} right",
        times_ms[times_ms.len() / 2],
        times_ms[times_ms.len() * 9 / 10],
        times_ms.len()
    );
}
