//! A camera that loses its place for good and finds it again, killed all along: the submaps that it
//! makes, and their join, keep their bytes.

use crate::common::{FORGETFUL, carried_by_a_lift, lost_and_found};

#[test]
fn a_lost_camera_s_submaps_are_joined_and_kills_change_no_byte() {
    let whole = lost_and_found();
    assert!(whole.finish().success());
    let summary: serde_json::Value = serde_json::from_slice(&whole.output("summary.json")).unwrap();
    for (key, expected) in [("submaps", 2), ("submaps_joined", 1), ("submaps_apart", 0), ("frames_apart", 0)]
    {
        assert_eq!(summary[key], expected, "{key}: {}", summary["verdict"]);
    }
    let states = String::from_utf8(whole.output("states.csv")).unwrap();
    let frame_of = |words: &str| -> usize {
        let place = states.lines().position(|line| line.contains(words));
        place.unwrap_or_else(|| panic!("no {words}: {states}")) - 1
    };
    let (begins, joined) = (frame_of("submap 1 begins"), frame_of("submap 1 is joined to 0"));
    // With the frame, between the two, in each step of the join, and in the optimisation behind it.
    let plan = format!(
        "align=journaled:{begins}+,stored:{begins}+,checkpointed:{}+,computed:{joined}+,journaled:{joined}+,\
         published:{}+;optimise=solving:0,journaled:0+",
        begins + 5,
        joined + 1
    );
    let killed = lost_and_found().with(&["--set", "flow.checkpoint_kb=1"]).with_faults(&plan);
    assert!(killed.finish().success(), "{plan}");
    assert!(killed.n_deaths() >= 6, "{plan}\n{}", killed.log());
    killed.assert_same_bytes(&whole, &plan);
    let forgetful = lost_and_found().with(&["--set", FORGETFUL]);
    assert!(forgetful.finish().success());
    forgetful.assert_same_bytes(&whole, "all state forgotten after each frame");
}

#[test]
fn a_ride_in_a_lift_is_noticed_and_kills_change_no_byte() {
    let whole = carried_by_a_lift();
    assert!(whole.finish().success());
    let summary: serde_json::Value = serde_json::from_slice(&whole.output("summary.json")).unwrap();
    assert!(summary["submaps"].as_u64() >= Some(2) && summary["submaps_joined"] == 0, "{summary}");
    let states = String::from_utf8(whole.output("states.csv")).unwrap();
    let noticed = states.lines().position(|line| line.contains("views of long ago contradict the map"));
    let noticed = noticed.unwrap_or_else(|| panic!("not noticed: {states}")) - 1;
    // Before the frame, with it, and behind it.
    let plan = format!(
        "align=computed:{}+,computed:{noticed}+,journaled:{noticed}+,checkpointed:{}+,published:{}+",
        noticed - 4,
        noticed + 1,
        noticed + 5
    );
    let killed = carried_by_a_lift().with(&["--set", "flow.checkpoint_kb=1"]).with_faults(&plan);
    assert!(killed.finish().success(), "{plan}");
    assert!(killed.n_deaths() >= 4, "{plan}\n{}", killed.log());
    killed.assert_same_bytes(&whole, &plan);
}
