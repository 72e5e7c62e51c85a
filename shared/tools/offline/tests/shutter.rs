//! The readout is estimated from the frames, where a camera file states none or another.

use tessera_geometry::Camera;
use tessera_offline::{Method, RawFrame, Run};
use tessera_sources::{SceneName, SimulatedSource, SimulationOptions, Source};

/// Frames of the room.
const N_FRAMES: u64 = 120;

/// The readout at the end of a run with its standard deviation and what is applied of it, seconds.
fn estimated(true_s: f64, stated_s: f64) -> ([f64; 2], f64) {
    let options = SimulationOptions { readout_s: Some(true_s), ..SimulationOptions::default() };
    let source = SimulatedSource::open(SceneName::Room, None, None, &options).unwrap();
    let camera = Camera { readout_s: stated_s, ..source.camera().clone() };
    let mut run = Run::new(&camera, &Method::default()).unwrap();
    for index in 0..N_FRAMES {
        run.push(&RawFrame::read(&source, index).unwrap());
    }
    let state = run.colour();
    (state.readout_s(), state.model.readout_s)
}

#[test]
fn a_readout_that_no_file_states_is_found_and_none_is_found_where_there_is_none() {
    for true_s in [0.0, 0.03, -0.02] {
        let ([found_s, sigma_s], applied_s) = estimated(true_s, 0.0);
        println!("{true_s} s: {found_s} +- {sigma_s} s, applied {applied_s} s");
        assert!((found_s - true_s).abs() < 0.003 && sigma_s < 0.003, "{true_s} s: {found_s} +- {sigma_s} s");
        assert!((applied_s - found_s).abs() <= sigma_s);
    }
}

#[test]
fn a_stated_readout_that_is_wrong_is_found_out() {
    let ([found_s, sigma_s], _) = estimated(0.0, 0.03);
    println!("{found_s} +- {sigma_s} s");
    assert!(found_s < 0.005, "{found_s} +- {sigma_s} s");
}
