//! Time that is that of `/clock`, as with `use_sim_time` of ROS.

use crate::common::{Network, Setup, room};
use serde_json::Value;

#[test]
fn what_is_told_every_second_is_told_by_the_clock() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(150);
    room(setup.frames());
    let listener = network.listen(&[]);
    let run = setup.start();
    let ros2 = network.join(&setup, &["--use-sim-time"]);
    ros2.await_words("no /clock comes: no path and no diagnostics");
    let _camera = network.camera(&setup, &["--clock", "--rate", "15"]);
    setup.finish(run);
    let words = ros2.finish();
    let lines = listener.finish();
    let of = |topic: &str| -> Vec<&Value> { lines.iter().filter(|line| line["topic"] == topic).collect() };
    let odometry = of("/tessera/odom");
    let stamp = |line: &Value| line["stamp"].as_i64().unwrap();
    let (first, last) = (stamp(odometry[0]), stamp(odometry[odometry.len() - 1]));
    let told = of("/diagnostics");
    let stamps: Vec<i64> = told.iter().map(|line| stamp(line)).collect();
    // The camera's images are 33 ms apart and come every 67 ms: a second of theirs takes two.
    let (n_last, seconds) = (stamps.len() - 1, (last - first) as f64 * 1e-9);
    assert!(n_last >= 2 && n_last as f64 <= seconds + 4.0, "{stamps:?} {seconds} {words}");
    // The last one is told at the run's end, whatever the time.
    assert!(stamps[..n_last].windows(2).all(|pair| pair[1] - pair[0] >= 1_000_000_000), "{stamps:?}");
    let bounds = first - 60_000_000_000..=last + 60_000_000_000;
    assert!(stamps.iter().all(|stamp| bounds.contains(stamp)), "{stamps:?} {bounds:?}");
    // Images and the clock have one time, so that an age is known.
    let age = told.iter().filter_map(|line| line["status"][0]["values"]["age ms"].as_str()).next_back();
    let age: f64 = age.expect("an age").parse().unwrap();
    assert!((-100.0..10_000.0).contains(&age), "{age}");
}
