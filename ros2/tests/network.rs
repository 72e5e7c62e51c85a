//! `tessera-ros2` between a real run and programs of others: cyclonedds carries, rosbags reads and
//! writes. All traffic stays on loopback, and each test has a domain of its own.

#[path = "network/answers.rs"]
mod answers;
#[path = "network/common.rs"]
mod common;
#[path = "network/discovery.rs"]
mod discovery;
#[path = "network/faults.rs"]
mod faults;
#[path = "network/grid.rs"]
mod grid;
#[path = "network/gyro.rs"]
mod gyro;
#[path = "network/images.rs"]
mod images;
#[path = "network/initial_pose.rs"]
mod initial_pose;
#[path = "network/map.rs"]
mod map;
#[path = "network/measured.rs"]
mod measured;
#[path = "network/names.rs"]
mod names;
#[path = "network/parameters.rs"]
mod parameters;
#[path = "network/program.rs"]
mod program;
#[path = "../../tests/requirements.rs"]
mod requirements;
#[cfg(feature = "zenoh")]
#[path = "network/router.rs"]
mod router;
#[path = "network/services.rs"]
mod services;
#[path = "network/simulated_time.rs"]
mod simulated_time;
#[path = "network/taken_over.rs"]
mod taken_over;
#[path = "network/twist.rs"]
mod twist;
#[cfg(feature = "zenoh")]
#[path = "network/zenoh.rs"]
mod zenoh;
#[cfg(feature = "zenoh")]
#[path = "network/zenoh_tls.rs"]
mod zenoh_tls;

use common::{Network, Setup};
use images::{base_from_camera, pose, room};
use nalgebra::Isometry3;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// The rows of `trajectory_online.txt` in that folder: microseconds and `world_from_camera`.
fn online(out: &Path) -> BTreeMap<i64, Isometry3<f64>> {
    let text = std::fs::read_to_string(out.join("trajectory_online.txt")).unwrap();
    let row = |line: &str| {
        let words: Vec<&str> = line.split_whitespace().collect();
        let numbers: Vec<f64> = words[1..].iter().map(|word| word.parse().unwrap()).collect();
        ((words[0].parse::<f64>().unwrap() * 1e6).round() as i64, pose(&numbers))
    };
    text.lines().filter(|line| !line.starts_with('#')).map(row).collect()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

/// Stamps are compared by microseconds: a file has no more digits.
fn micros(stamp: &Value) -> i64 {
    (stamp.as_i64().unwrap() + 500) / 1000
}

fn difference(a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
    (a.translation.vector - b.translation.vector).norm() + a.rotation.angle_to(&b.rotation)
}

/// Whether a message of `/tf` has the pose that one of these rows has.
fn is_of_run(line: &Value, rows: &BTreeMap<i64, Isometry3<f64>>) -> bool {
    let [map, odom] = &line["transforms"].as_array().unwrap()[..] else { panic!("{line}") };
    let [map_from_odom, odom_from_base] = [map, odom].map(|link| pose(&numbers(&link["pose"])));
    let base = base_from_camera();
    let world_from_camera = base.inverse() * map_from_odom * odom_from_base * base;
    let row = rows.get(&micros(&odom["stamp"]));
    row.is_some_and(|row| difference(&world_from_camera, row) < 5e-6)
}

#[test]
fn frames_come_in_and_poses_go_out_as_others_read_them() {
    let Some(network) = Network::new() else { return };
    let words = exchange(&network);
    assert!(words.contains("DDS domain") && words.contains("this machine alone"), "{words}");
}

/// Frames come in and poses go out, as programs of others read them; what the program says.
fn exchange(network: &Network) -> String {
    let (setup, words, lines) = network.played(40, &[]);
    assert!(words.contains("base_link is where /tf_static has it"), "{words}");
    let unmatched = "/tessera/odom: the writer is volatile, the reader wants transient local";
    assert!(words.contains(unmatched), "{words}");
    let of = |topic: &str| -> Vec<&Value> { lines.iter().filter(|line| line["topic"] == topic).collect() };
    // Every byte is one that rosbags writes too.
    for line in lines.iter().filter(|line| line["topic"] != "ready") {
        assert_eq!(line["same"], true, "{line}");
    }
    let written = online(&setup.out());
    let (mut odometry, mut n_moving) = (BTreeMap::new(), 0);
    for line in of("/tessera/odom") {
        assert_eq!((&line["frame"], &line["child"]), (&"odom".into(), &"base_link".into()));
        let covariance = numbers(&line["covariance"]);
        assert!(covariance.len() == 36 && (0..6).all(|k| covariance[7 * k] > 0.0), "{line}");
        let of_twist = numbers(&line["of_twist"]);
        assert!(of_twist.len() == 36 && (0..6).all(|k| of_twist[7 * k] > 0.0), "{line}");
        n_moving += usize::from((0..6).all(|k| of_twist[7 * k] < 100.0));
        odometry.insert(micros(&line["stamp"]), pose(&numbers(&line["pose"])));
    }
    assert!(n_moving >= 8, "{n_moving} poses have a velocity with a covariance");
    let (mut n_compared, mut in_map) = (0, BTreeMap::new());
    for line in of("/tf") {
        let [map, odom] = &line["transforms"].as_array().unwrap()[..] else { panic!("{line}") };
        assert_eq!((&map["parent"], &map["child"]), (&"map".into(), &"odom".into()));
        assert_eq!((&odom["parent"], &odom["child"]), (&"odom".into(), &"base_link".into()));
        // The same pose on both topics, and that of the run's own file once the frames are undone.
        if let Some(odometry) = odometry.get(&micros(&odom["stamp"])) {
            assert!(difference(odometry, &pose(&numbers(&odom["pose"]))) < 1e-12);
        }
        assert!(is_of_run(line, &written), "{line} is no pose of {:?}", written.keys());
        let [map, odom] = [map, odom].map(|link| (micros(&link["stamp"]), pose(&numbers(&link["pose"]))));
        in_map.insert(odom.0, map.1 * odom.1);
        n_compared += 1;
    }
    let mut n_in_map = 0;
    for line in of("/tessera/pose") {
        assert_eq!(line["frame"], "map");
        let covariance = numbers(&line["covariance"]);
        assert!(covariance.len() == 36 && (0..6).all(|k| covariance[7 * k] > 0.0), "{line}");
        if let Some(map_from_base) = in_map.get(&micros(&line["stamp"])) {
            assert!(difference(map_from_base, &pose(&numbers(&line["pose"]))) < 1e-12, "{line}");
            n_in_map += 1;
        }
    }
    assert!(n_in_map >= 10, "{n_in_map} poses in the map");
    assert!(n_compared >= 10 && odometry.len() >= 10, "{n_compared} {}", odometry.len());
    let path = of("/tessera/path").pop().expect("a path");
    assert!(path["frame"] == "map" && path["poses"].as_array().unwrap().len() >= 2, "{path}");
    let diagnostics = of("/diagnostics").pop().expect("diagnostics");
    let status = &diagnostics["status"][0];
    assert_eq!(status["name"], format!("tessera: {}", setup.name));
    assert!(status["values"]["poses"].as_str().unwrap().parse::<u64>().unwrap() >= 10, "{status}");
    assert!(status["values"]["latency ms"].is_string(), "{status}");
    // What is said while the run goes on is in the end what the run says of itself.
    let verdict = status["values"]["verdict"].as_str().expect("a verdict");
    let summary: Value =
        serde_json::from_str(&std::fs::read_to_string(setup.out().join("summary.json")).unwrap()).unwrap();
    let grade = summary["verdict"]["grade"].as_str().unwrap();
    assert!(verdict.starts_with(grade), "{verdict}, {}", summary["verdict"]);
    for reason in summary["verdict"]["reasons"].as_array().unwrap() {
        assert!(verdict.contains(reason["found"].as_str().unwrap()), "{verdict}, {reason}");
    }
    words
}

#[test]
fn what_is_wrong_is_told_and_counted_and_stops_nothing() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(250);
    room(setup.frames());
    let listener = network.listen(&[]);
    let run = setup.start();
    let ros2 = network.join(&setup, &[]);
    let _camera = network.camera(&setup, &["--faults", "--rate", "20"]);
    setup.wait_for_growth("the first frames");
    std::fs::write(setup.frames().join("faults"), "").unwrap();
    setup.finish(run);
    let words = ros2.finish();
    for told in [
        "/camera/depth/image_rect_raw: no sensor_msgs/msg/Image",
        "80x120 px, expected 160x120",
        "the CameraInfo is 160x120 px, fx 170.625, expected 160x120 px, fx 131.25",
        "images are left out until it is back",
        "the clock jumped back by 99",
    ] {
        assert!(words.contains(told), "no {told:?} in\n{words}");
    }
    let lines = listener.finish();
    let diagnostics: Vec<&Value> = lines.iter().filter(|line| line["topic"] == "/diagnostics").collect();
    let values = &diagnostics.last().unwrap()["status"][0]["values"];
    let count = |key: &str| values[key].as_str().map_or(0, |text| text.parse::<u64>().unwrap());
    // Three of each, as far as best effort brought them.
    for key in ["malformed messages", "unusable images"] {
        assert!((1..=3).contains(&count(key)), "{values}");
    }
    assert_eq!((count("changes of the camera"), count("jumps of the clock")), (1, 1), "{values}");
    assert!((1..=5).contains(&count("images of another camera")), "{values}");
    // Poses go out at the camera's own times, also behind the jump.
    let stamps: Vec<i64> = lines
        .iter()
        .filter(|line| line["topic"] == "/tessera/odom")
        .map(|line| line["stamp"].as_i64().unwrap())
        .collect();
    let jump = stamps.windows(2).filter(|pair| pair[1] < pair[0] - 900_000_000_000).count();
    assert_eq!(jump, 1, "{stamps:?}");
    // In the run time goes on.
    let written: Vec<i64> = online(&setup.out()).into_keys().collect();
    let span = written.last().unwrap() - written[0];
    assert!(written.len() >= 20 && span < 100_000_000, "{written:?}");
}

#[test]
fn the_camera_and_the_program_may_be_killed_and_the_run_goes_on() {
    let Some(network) = Network::new() else { return };
    kill(&network);
}

fn kill(network: &Network) {
    let setup = Setup::new(120);
    room(setup.frames());
    let run = setup.start();
    let camera = network.camera(&setup, &[]);
    let ros2 = network.join(&setup, &["--no-tf"]);
    setup.wait_for_growth("the first frames");
    // The driver dies; another one sends images of later times.
    drop(camera);
    let camera = network.camera(&setup, &["--start", "200"]);
    setup.wait_for_growth("frames of the second driver");
    // The program dies; its successor joins the run that goes on.
    drop(ros2);
    let ros2 = network.join(&setup, &["--no-tf"]);
    setup.wait_for_growth("frames of the second program");
    setup.finish(run);
    let words = ros2.finish();
    drop(camera);
    assert!(words.contains("joined the run"), "{words}");
    assert!(online(&setup.out()).len() >= 20);
    assert_eq!(setup.leftovers(), Vec::<String>::new());
}

#[test]
fn compressed_images_are_decoded_and_run_starts_the_run() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(12);
    room(setup.frames());
    let camera = network.camera(&setup, &["--compressed"]);
    let ros2 = network.join_and_run(&setup);
    let words = ros2.finish();
    drop(camera);
    assert!(words.contains("/camera/depth/image_rect_raw/compressedDepth"), "{words}");
    assert!(words.contains("colour: /camera/color/image_raw/compressed, registered to depth"), "{words}");
    assert!(online(&setup.out()).len() >= 8, "{words}");
}

#[test]
fn a_run_that_was_started_ends_with_the_program() {
    let Some(network) = Network::new() else { return };
    let (setup, _camera, ros2) = network.running();
    ros2.terminate();
    let words = ros2.finish();
    assert!(!online(&setup.out()).is_empty(), "{words}");
    assert_eq!(setup.leftovers(), Vec::<String>::new());
}

#[test]
fn types_have_the_hashes_that_others_compute() {
    let Some(python) = common::python() else { return };
    let text = std::fs::read_to_string(common::root().join("ros2/src/carrier.rs")).unwrap();
    let (_, table) = text.split_once("\ntypes! {\n").unwrap();
    let (table, _) = table.split_once("\n}").unwrap();
    let mut arguments = Vec::new();
    for line in table.lines() {
        let words: Vec<&str> = line.split('"').collect();
        arguments.extend([words[1].to_owned(), format!("RIHS01_{}", words[3])]);
    }
    let (_, service) = text.split_once("name: \"std_srvs/srv/Trigger\",").unwrap();
    arguments.extend(["std_srvs/srv/Trigger".to_owned(), service.split('"').nth(1).unwrap().to_owned()]);
    let text = std::fs::read_to_string(common::root().join("ros2/src/services/parameters/wire.rs")).unwrap();
    let (_, table) = text.split_once("\nservices! {\n").unwrap();
    for line in table.split_once("\n}").unwrap().0.lines() {
        let words: Vec<&str> = line.split('"').collect();
        arguments.extend([format!("rcl_interfaces/srv/{}", words[1]), format!("RIHS01_{}", words[3])]);
    }
    assert_eq!(arguments.len(), 42);
    let script = common::root().join("ros2/tests/python/hashes.py");
    let output = Command::new(python).arg(script).args(&arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(String::from_utf8_lossy(&output.stdout).trim(), "21");
}

#[test]
fn what_cannot_be_is_told_before_anything_begins() {
    let told = |arguments: &[&str], variable: (&str, &str)| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tessera-ros2"));
        let output = command.args(arguments).env(variable.0, variable.1).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let (code, words) = told(&["x"], ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF"));
    assert!(code == Some(2) && words.contains("no topic would be found"), "{words}");
    let (code, words) = told(&["x"], ("ROS_DOMAIN_ID", "300"));
    assert!(code == Some(2) && words.contains("expected 0 to 232"), "{words}");
    let zenoh = ["x", "--carrier", "zenoh"];
    let far = ("ZENOH_CONFIG_OVERRIDE", "connect/endpoints=[\"tcp/192.0.2.1:7447\"]");
    let expected = if cfg!(feature = "zenoh") { "--network all opens it" } else { "--features zenoh" };
    let (code, words) = told(&zenoh, far);
    assert!(code == Some(2) && words.contains(expected), "{words}");
    let domain = common::Domain::claim();
    let (code, words) = told(&["x", "--camera", "no/such.toml", "--domain", &domain.number], ("A", ""));
    assert!(code == Some(3) && words.contains("no/such.toml"), "{words}");
    let (code, words) = told(&["a/b", "--domain", &domain.number], ("A", ""));
    assert!(code == Some(4) && words.contains("is not usable"), "{words}");
}
