//! Time that is that of `/clock`, as with `use_sim_time` of ROS.

use crate::common::{Network, Setup, wait_for};
use crate::images::room;
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
    // The clock goes on while the run ends, which takes its time on a busy machine.
    let n_meanwhile = stamps.iter().filter(|stamp| **stamp <= last).count();
    assert!(n_last >= 2 && n_meanwhile as f64 <= seconds + 4.0, "{stamps:?} {seconds} {words}");
    // The last one is told at the run's end, whatever the time.
    assert!(stamps[..n_last].windows(2).all(|pair| pair[1] - pair[0] >= 1_000_000_000), "{stamps:?}");
    let bounds = first - 60_000_000_000..=last + 60_000_000_000;
    assert!(stamps.iter().all(|stamp| bounds.contains(stamp)), "{stamps:?} {bounds:?}");
    // Images and the clock have one time, so that an age is known.
    let age = told.iter().filter_map(|line| line["status"][0]["values"]["age ms"].as_str()).next_back();
    let age: f64 = age.expect("an age").parse().unwrap();
    assert!((-100.0..10_000.0).contains(&age), "{age}");
}

/// As `ros2 bag play --clock --loop`: at the end of the bag clock and images begin anew.
#[test]
fn a_clock_that_jumps_back_is_followed() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(100_000);
    room(setup.frames());
    let listener = network.listen(&[]);
    let ros2 = network.join_and_run_with(&setup, &["--use-sim-time"]);
    let _camera = network.camera(&setup, &["--clock", "--jump", "--rate", "20"]);
    wait_for("diagnostics by the clock", || listener.n_of("/diagnostics") >= 2 && listener.n_odometry() > 5);
    std::fs::write(setup.frames().join("jump"), "").unwrap();
    let before = (listener.n_of("/diagnostics"), listener.n_of("/tessera/path"));
    // More than one: the time after the jump goes on, and does not wait for that before it.
    wait_for("diagnostics after the jump", || listener.n_of("/diagnostics") >= before.0 + 4);
    wait_for("a path after the jump", || listener.n_of("/tessera/path") >= before.1 + 3);
    ros2.terminate();
    let words = ros2.finish();
    let lines = listener.finish();
    let stamps = |topic: &str| -> Vec<i64> {
        let of = lines.iter().filter(|line| line["topic"] == topic);
        of.map(|line| line["stamp"].as_i64().unwrap()).collect()
    };
    for topic in ["/diagnostics", "/tessera/odom"] {
        let stamps = stamps(topic);
        let n_jumps = stamps.windows(2).filter(|pair| pair[1] < pair[0] - 900_000_000_000).count();
        assert_eq!(n_jumps, 1, "{topic} {stamps:?} {words}");
    }
    let values = |line: &Value| line["status"][0]["values"].clone();
    let last = lines.iter().rev().filter(|line| line["topic"] == "/diagnostics").map(values).next().unwrap();
    // Images are as old by the new time as they were by the old one.
    let age: f64 = last["age ms"].as_str().expect("an age").parse().unwrap();
    assert!((-100.0..10_000.0).contains(&age), "{last}");
    assert_eq!(last["jumps of the clock"], "1", "{last}");
    // The images that waited for colour when the time jumped are the only ones without.
    let n_without = last["images without colour"].as_str().map_or(0, |n| n.parse::<u32>().unwrap());
    assert!(n_without <= 3, "{last}");
}
