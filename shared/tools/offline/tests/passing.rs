//! A person who walks past close by, and is half of what the camera sees for a second.

mod common;

use common::ate_m;
use tessera_geometry::Camera;
use tessera_offline::Method;
use tessera_sources::{SceneName, SimulatedSource, SimulationOptions};

/// Frames of the building: into a room, past the person, and on.
const PAST: std::ops::Range<u64> = 7980..8150;

#[test]
fn a_person_who_walks_past_takes_nobody_along() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("camera.toml");
    let camera = Camera::pinhole((320, 240), [262.5, 262.5, 159.5, 119.5], 5000.0);
    std::fs::write(&file, toml::to_string(&camera).unwrap()).unwrap();
    let options = SimulationOptions::default();
    let source =
        SimulatedSource::open(SceneName::Building, Some(file.to_str().unwrap()), None, &options).unwrap();
    let indices: Vec<u64> = PAST.collect();
    let frames = common::frames(&source, &indices);
    let error_m = |is_left_out: bool| {
        let mut method = Method::default();
        method.mapping.window.at_rest_only = is_left_out;
        let records = common::run(&source, &method, &frames);
        assert_eq!(records.n_untracked(), 0);
        ate_m(&source, &indices, &records.last())
    };
    let (without, with) = (error_m(true), error_m(false));
    assert!(without < 0.03, "{without} m where what moves is left out");
    assert!(with > 0.1, "{with} m: the person is no test");
}
