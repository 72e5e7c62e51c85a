//! A camera that waits for the odometry of each image: no image is left without an answer, not even one that the run
//! leaves out.

use crate::common::{Network, Setup};
use crate::images::room;

#[test]
fn a_camera_that_waits_for_each_answer_gets_over_a_jump_of_its_time() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(100_000);
    room(setup.frames());
    let _run = setup.start();
    // Each image is sent once: none may get lost on the way.
    let ros2 = network.join(&setup, &["--reliable", "--no-color"]);
    let camera = network.waiting_camera(&setup, 60.0);
    let lines = camera.await_end();
    ros2.terminate();
    let words = ros2.finish();
    let variances = |jumped: bool| -> Vec<f64> {
        let of = lines.iter().filter(|line| line["jumped"] == jumped);
        of.map(|line| line["variance"].as_f64().unwrap()).collect()
    };
    let (before, behind) = (variances(false), variances(true));
    assert_eq!((before.len(), behind.len()), (6, 8), "{lines:?}");
    let is_known = |variance: &&f64| **variance < 1e5;
    // The first one behind the jump may be misread: the run leaves it out, and believes it with the next.
    assert!(behind[0] >= 1e6, "{lines:?}");
    assert!(behind[1..].iter().filter(is_known).count() >= 5, "{lines:?}\n{words}");
    assert!(words.contains("it is answered with odometry of unknown certainty"), "{words}");
    let log = std::fs::read_to_string(setup.out().join("log.txt")).unwrap();
    assert!(log.contains("unless the next image confirms it"), "{log}");
}
