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

/// In a steady walk the changes of the motion are hardly larger than what they are known to, so that the estimate comes
/// near the truth slowly; a hand's motion takes it there (docs/accuracy.md).
#[test]
fn the_readout_goes_to_the_true_one_from_what_is_stated() {
    for (true_s, stated_s) in [(0.03, 0.0), (0.0, 0.03)] {
        let ([found_s, sigma_s], applied_s) = estimated(true_s, stated_s);
        let moved = (found_s - stated_s) / (true_s - stated_s);
        println!("{true_s} s for {stated_s} s: {found_s} +- {sigma_s} s, applied {applied_s} s");
        assert!((0.15..1.1).contains(&moved), "{true_s} s for {stated_s} s: {found_s} +- {sigma_s} s");
        assert!((applied_s - found_s).abs() <= 2.6 * sigma_s);
    }
}

#[test]
fn a_readout_that_is_right_stays() {
    for readout_s in [0.0, 0.03] {
        let ([found_s, sigma_s], applied_s) = estimated(readout_s, readout_s);
        println!("{readout_s} s: {found_s} +- {sigma_s} s, applied {applied_s} s");
        assert!((applied_s - readout_s).abs() < 0.003, "{readout_s} s: {found_s} +- {sigma_s} s");
    }
}
