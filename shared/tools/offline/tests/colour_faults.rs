//! Colour that is wrong costs nothing: the method notices and goes by depth alone.

mod common;

use common::{ate_m, frames, run, scene};
use tessera_offline::{Method, RawFrame};
use tessera_sources::{SceneName, SimulatedSource, SimulationOptions};

const N_FRAMES: u64 = 90;

/// Error of the online poses over the first frames of the room with these colour images, metres.
fn error_m(source: &SimulatedSource, frames: &[RawFrame], colour: impl Fn(usize) -> Option<Vec<u8>>) -> f64 {
    let spoilt: Vec<RawFrame> =
        frames.iter().enumerate().map(|(k, frame)| RawFrame { colour: colour(k), ..frame.clone() }).collect();
    let records = run(source, &Method::default(), &spoilt);
    assert_eq!(records.n_untracked(), 0);
    let indices: Vec<u64> = (0..N_FRAMES).collect();
    ate_m(source, &indices, &records.online())
}

#[test]
fn planted_faults_of_colour_cost_no_accuracy() {
    let source = scene(SceneName::Room, &SimulationOptions::default());
    let frames = frames(&source, &(0..N_FRAMES).collect::<Vec<u64>>());
    let image = |k: usize| frames[k].colour.clone();
    let n = frames.len();
    let without_m = error_m(&source, &frames, |_| None);
    let faults: [(&str, f64); 4] = [
        ("frozen", error_m(&source, &frames, |_| image(0))),
        ("of another time", error_m(&source, &frames, |k| image((k * 37 + n / 2) % n))),
        ("dark", error_m(&source, &frames, |k| image(k).map(|i| i.iter().map(|b| b / 64).collect()))),
        ("black", error_m(&source, &frames, |k| image(k).map(|i| vec![0; i.len()]))),
    ];
    for (fault, with_m) in faults {
        // One run differs from another by a millimetre whatever its colour is.
        assert!(with_m < 1.05 * without_m + 0.001, "{fault}: {with_m} m, {without_m} m without colour");
    }
}
