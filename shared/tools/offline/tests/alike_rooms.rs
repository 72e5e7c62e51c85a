//! Rooms of one storey that are the same to a camera: walked through one after the other, none is brought over
//! another one.

mod common;

use common::ate_m;
use tessera_offline::Method;

/// Frames of the building's uppermost storey: three rooms and the corridor between them.
const WAY: std::ops::Range<u64> = 17_000..18_400;
const EVERY: usize = 4;

#[test]
fn a_room_is_not_brought_over_one_that_looks_alike() {
    let source = common::small_building();
    let indices: Vec<u64> = WAY.step_by(EVERY).collect();
    let frames = common::frames(&source, &indices);
    let records = common::run(&source, &Method::default(), &frames);
    assert_eq!(records.n_untracked(), 0);
    let error_m = ate_m(&source, &indices, &records.last());
    assert!(error_m < 0.15, "{error_m} m");
}
