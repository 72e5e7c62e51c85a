//! Colour that is wrong costs nothing: the method notices and goes by depth alone.

mod common;

use common::{ate_m, frames, run, scene};
use tessera_offline::{Method, RawFrame};
use tessera_sources::{SceneName, SimulatedSource, SimulationOptions};

const N_FRAMES: u64 = 90;

/// Error of the online poses over the first frames of a scene with these colour images, metres.
fn error_m(source: &SimulatedSource, frames: &[RawFrame], colour: impl Fn(usize) -> Option<Vec<u8>>) -> f64 {
    let spoilt: Vec<RawFrame> =
        frames.iter().enumerate().map(|(k, frame)| RawFrame { colour: colour(k), ..frame.clone() }).collect();
    let records = run(source, &Method::default(), &spoilt);
    assert_eq!(records.n_untracked(), 0);
    let indices: Vec<u64> = (0..frames.len() as u64).collect();
    ate_m(source, &indices, &records.online())
}

/// Each pixel the mean of those within 6 px in its row: what a turn of 60 degrees a second leaves in 24 ms.
fn blurred(image: &[u8], width: usize) -> Vec<u8> {
    let mut out = Vec::with_capacity(image.len());
    for row in image.chunks_exact(3 * width) {
        for column in 0..width {
            let span = column.saturating_sub(6)..(column + 7).min(width);
            let n = span.len() as u32;
            out.extend(
                (0..3).map(|c| (span.clone().map(|k| u32::from(row[3 * k + c])).sum::<u32>() / n) as u8),
            );
        }
    }
    out
}

#[test]
fn planted_faults_of_colour_cost_no_accuracy() {
    let source = scene(SceneName::Room, &SimulationOptions::default());
    let frames = frames(&source, &(0..N_FRAMES).collect::<Vec<u64>>());
    let image = |k: usize| frames[k].colour.clone();
    let n = frames.len();
    let elsewhere = scene(SceneName::House, &SimulationOptions::default());
    let elsewhere = common::frames(&elsewhere, &(0..N_FRAMES).collect::<Vec<u64>>());
    let width = 640;
    let without_m = error_m(&source, &frames, |_| None);
    let faults: [(&str, f64); 6] = [
        ("frozen", error_m(&source, &frames, |_| image(0))),
        ("of another time", error_m(&source, &frames, |k| image((k * 37 + n / 2) % n))),
        ("of another scene", error_m(&source, &frames, |k| elsewhere[k].colour.clone())),
        ("blurred", error_m(&source, &frames, |k| image(k).map(|i| blurred(&i, width)))),
        ("dark", error_m(&source, &frames, |k| image(k).map(|i| i.iter().map(|b| b / 64).collect()))),
        ("black", error_m(&source, &frames, |k| image(k).map(|i| vec![0; i.len()]))),
    ];
    for (fault, with_m) in faults {
        assert_costs_nothing(fault, with_m, without_m);
    }
}

/// Where the surfaces are weak, colour that leads takes them along.
#[test]
fn colour_of_another_scene_leads_no_weak_surfaces() {
    let source = scene(SceneName::House, &SimulationOptions::default());
    let indices: Vec<u64> = (0..60).collect();
    let own = frames(&source, &indices);
    let other = frames(&scene(SceneName::Room, &SimulationOptions::default()), &indices);
    let without_m = error_m(&source, &own, |_| None);
    let with_m = error_m(&source, &own, |k| other[k].colour.clone());
    assert_costs_nothing("of another scene", with_m, without_m);
}

/// One run differs from another by a millimetre whatever its colour is.
fn assert_costs_nothing(fault: &str, with_m: f64, without_m: f64) {
    assert!(with_m < 1.05 * without_m + 0.001, "{fault}: {with_m} m, {without_m} m without colour");
}
