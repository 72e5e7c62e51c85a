//! The readout is estimated from the frames, where a camera file states none or another.

use tessera_geometry::Camera;
use tessera_offline::{Method, RawFrame, Run};
use tessera_sources::{SceneName, SimulatedSource, SimulationOptions, Source};

/// Frames of the room, one in four: the motion changes more from one to the next than it is in doubt by.
const FRAMES: std::ops::Range<u64> = 0..90;
const EVERY: u64 = 4;

/// The readout at the end of a run with its standard deviation, and what is applied of it, seconds.
fn estimated(true_s: f64, stated_s: f64) -> ([f64; 2], f64) {
    let options = SimulationOptions { readout_s: Some(true_s), ..SimulationOptions::default() };
    let source = SimulatedSource::open(SceneName::Room, None, None, &options).unwrap();
    let camera = Camera { readout_s: stated_s, ..source.camera().clone() };
    let mut run = Run::new(&camera, &Method::default()).unwrap();
    for index in FRAMES {
        run.push(&RawFrame::read(&source, EVERY * index).unwrap());
    }
    let state = run.colour();
    (state.readout_s(), state.model.readout_s)
}

#[test]
fn a_readout_that_no_file_states_is_found() {
    let ([found_s, sigma_s], applied_s) = estimated(0.03, 0.0);
    println!("0.03 s: {found_s} +- {sigma_s} s, applied {applied_s} s");
    assert!((found_s - 0.03).abs() <= 3.0 * sigma_s && sigma_s < 0.004, "{found_s} +- {sigma_s} s");
    assert!((applied_s - found_s).abs() <= sigma_s, "applied {applied_s} s");
}

/// What a file states is believed to 3 ms: in a steady walk the estimate leaves it slowly.
#[test]
fn a_readout_that_is_stated_wrongly_is_left() {
    let ([found_s, sigma_s], applied_s) = estimated(0.0, 0.03);
    println!("0 s, stated 0.03 s: {found_s} +- {sigma_s} s, applied {applied_s} s");
    assert!(found_s < 0.02, "{found_s} +- {sigma_s} s");
    assert!((applied_s - found_s).abs() <= sigma_s, "applied {applied_s} s");
}

#[test]
fn a_readout_that_is_right_stays() {
    for readout_s in [0.0, 0.03] {
        let ([found_s, sigma_s], applied_s) = estimated(readout_s, readout_s);
        println!("{readout_s} s: {found_s} +- {sigma_s} s, applied {applied_s} s");
        assert!((applied_s - readout_s).abs() < 0.003, "{readout_s} s: {found_s} +- {sigma_s} s");
    }
}
