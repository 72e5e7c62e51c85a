//! Pairs of views with known answers, and the weights of the evidence of one place that they give.
//!
//! `cargo run --release -p tessera-offline --example same_place -- pairs SEQUENCE [--camera FILE] [--simulation 'KEY = VALUE'] [--from N]... [--frames N] [--every N]`
//! prints a line for each pair: the sequence, whether both show one place, and the quantities.
//! `cargo run --release -p tessera-offline --example same_place -- fit FITTED_ON CHECKED_ON`
//! fits the table to the pairs of one file and checks it on those of another.
//!
//! A pair is aligned from a start that may be wrong, and labelled by its optimum: the same place within 0.1 m and
//! 5 degrees of the true relative pose, another one beyond 0.3 m or 15 degrees, and left out between.
#![forbid(unsafe_code)]

mod fit;
mod views;

use std::error::Error;
use tessera_geometry::{Pose, Twist, Vector6, exp, translation_rotation_norms};
use tessera_numerics::SplitMix64;
use tessera_slam::{PlaceEvidence, PlaceProbe, similarity};
use views::{TrueViews, ViewsOptions};

/// The same place within these, another one beyond those, metres and degrees.
const SAME: (f64, f64) = (0.1, 5.0);
const OTHER: (f64, f64) = (0.3, 15.0);
/// TrueViews whose centres and axes are within these may overlap, metres and degrees.
const NEAR: (f64, f64) = (1.5, 50.0);
/// Near views, views that look alike elsewhere, and views at random, for each query.
const N_NEAR: usize = 5;
const N_ALIKE: usize = 4;
const N_RANDOM: usize = 3;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.split_first() {
        Some((command, rest)) if command == "pairs" => pairs(&ViewsOptions::parse(rest)?),
        Some((command, [fitted_on, checked_on])) if command == "fit" => fit::run(fitted_on, checked_on),
        _ => Err("expected: pairs SEQUENCE ..., or fit FITTED_ON CHECKED_ON".into()),
    }
}

fn pairs(asked: &ViewsOptions) -> Result<(), Box<dyn Error>> {
    let views = TrueViews::of(asked)?;
    let mut probe = PlaceProbe::new(&views.context, &views.keyframes, &views);
    let mut random = SplitMix64::new(1);
    for query in 0..views.keyframes.len() {
        // A view just before or behind, as a tracked frame has.
        let beside = if query > 0 { query - 1 } else { 1.min(views.keyframes.len() - 1) };
        let share = probe.agreeing_share(query, beside);
        for (target, start) in starts(&views, &mut probe, query, &mut random) {
            let (at, evidence) = probe.measure((query, share), target, &start);
            if let Some(is_same) = label(&views.truly(query, target), &at) {
                print(&asked.sequence, is_same, &evidence);
            }
        }
    }
    Ok(())
}

fn label(truth: &Pose, at: &Pose) -> Option<bool> {
    let (metres, radians) = translation_rotation_norms(&(truth.inverse() * at));
    let is_within = |(m, deg): (f64, f64)| metres <= m && radians.to_degrees() <= deg;
    match (is_within(SAME), is_within(OTHER)) {
        (true, _) => Some(true),
        (false, true) => None,
        (false, false) => Some(false),
    }
}

fn print(sequence: &str, is_same: bool, evidence: &PlaceEvidence) {
    let numbers: Vec<String> = evidence.quantities().iter().map(|q| format!("{q:.5}")).collect();
    let has_features = u8::from(evidence.n_agreeing.is_some());
    println!("{sequence},{},{has_features},{}", u8::from(is_same), numbers.join(","));
}

/// Targets of a query, each with the start of an alignment.
fn starts(
    views: &TrueViews,
    probe: &mut PlaceProbe<'_>,
    query: usize,
    random: &mut SplitMix64,
) -> Vec<(usize, Pose)> {
    let others = (0..views.keyframes.len()).filter(|k| *k != query);
    let (near, far): (Vec<usize>, Vec<usize>) = others.partition(|k| {
        let (metres, radians) = translation_rotation_norms(&views.truly(query, *k));
        metres <= NEAR.0 && radians.to_degrees() <= NEAR.1
    });
    let mut found = Vec::new();
    for &target in near.iter().step_by(near.len().div_ceil(N_NEAR).max(1)) {
        let truth = views.truly(query, target);
        found.push((target, truth * moved(random, [0.0, 0.05], [0.0, 3.0])));
        found.push((target, truth * moved(random, [0.3, 1.5], [5.0, 60.0])));
        found.push((target, Pose::identity()));
    }
    let place = |k: usize| views.keyframes[k].place.as_slice();
    let mut alike = far.clone();
    alike.sort_by(|a, b| {
        let like = |k: usize| similarity(place(query), place(k));
        like(*b).total_cmp(&like(*a)).then(a.cmp(b))
    });
    alike.truncate(N_ALIKE);
    let at_random = (0..N_RANDOM).filter_map(|_| {
        let place = (random.next_u64() % far.len().max(1) as u64) as usize;
        far.get(place).copied()
    });
    for target in alike.into_iter().chain(at_random) {
        found.push((target, Pose::identity()));
        found.extend(probe.by_features(query, target).map(|pose| (target, pose)));
    }
    found
}

/// A motion of a random direction, and of a length in metres and a turn in degrees within these.
fn moved(random: &mut SplitMix64, metres: [f64; 2], degrees: [f64; 2]) -> Pose {
    let mut unit = || random.next_u64() as f64 / u64::MAX as f64;
    let mut direction = || {
        let [x, y, z] = [(); 3].map(|()| 2.0 * unit() - 1.0);
        let norm = (x * x + y * y + z * z).sqrt().max(1e-6);
        [x / norm, y / norm, z / norm]
    };
    let (shift, axis) = (direction(), direction());
    let between = |[low, high]: [f64; 2], share: f64| low + (high - low) * share;
    let (length_m, turn_rad) = (between(metres, unit()), between(degrees, unit()).to_radians());
    let [x, y, z] = shift.map(|s| s * length_m);
    let [a, b, c] = axis.map(|s| s * turn_rad);
    Pose::translation(x, y, z) * exp(&Twist::from_vector(&Vector6::new(0.0, 0.0, 0.0, a, b, c)))
}
