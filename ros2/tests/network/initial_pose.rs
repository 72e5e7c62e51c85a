//! A pose that somebody gives has the run look for its place anew, and what it finds is told beside it.

use crate::common::{Network, Setup};
use crate::images::room;

#[test]
fn an_initial_pose_has_the_run_look_for_its_place() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(100_000);
    room(setup.frames());
    let camera = network.camera(&setup, &["--initial"]);
    let ros2 = network.join_and_run(&setup);
    ros2.await_words("/initialpose: the run looks for its place anew, in the whole map");
    ros2.await_words("degrees from what was given");
    ros2.terminate();
    let words = ros2.finish();
    drop(camera);
    assert!(words.contains("/initialpose: the run is at x"), "{words}");
}
