//! A person who walks past close by, and is half of what the camera sees for a second.

mod common;

use common::ate_m;
use tessera_offline::Method;

/// Frames of the building: into a room, past the person, and on.
const PAST: std::ops::Range<u64> = 7980..8150;

#[test]
fn a_person_who_walks_past_does_not_take_the_camera_along() {
    let source = common::small_building();
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
