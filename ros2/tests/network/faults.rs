//! Faults beside the program: readers that stop reading or die, stages that die, a camera that is not quite
//! the one that the run began with.

use crate::common::{Network, Setup, wait_for};
use crate::images::room;
use crate::program::signal;
use serde_json::Value;
use std::path::Path;

/// Stamps of the odometry in what a listener printed.
fn stamps(lines: &[Value]) -> Vec<i64> {
    let odometry = lines.iter().filter(|line| line["topic"] == "/tessera/odom");
    odometry.map(|line| line["stamp"].as_i64().unwrap()).collect()
}

#[test]
fn readers_that_stop_reading_or_die_stop_nothing() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(100_000);
    room(setup.frames());
    let [reader, frozen, killed] = [(); 3].map(|()| network.listen(&["map"]));
    let ros2 = network.join_and_run(&setup);
    let _camera = network.camera(&setup, &[]);
    for listener in [&reader, &frozen, &killed] {
        wait_for("a reader", || listener.n_odometry() > 3);
    }
    // Reliable readers both, whose acknowledgements are awaited.
    frozen.0.freeze();
    drop(killed);
    let before = reader.n_odometry();
    setup.wait_for_growth("frames beside a reader that does not read");
    wait_for("what is published to the other one", || reader.n_odometry() > before + 20);
    ros2.terminate();
    ros2.finish();
    drop(frozen);
    let stamps = stamps(&reader.finish());
    assert!(stamps.len() >= 20 && stamps.windows(2).all(|pair| pair[0] < pair[1]), "{stamps:?}");
    assert_eq!(setup.leftovers(), Vec::<String>::new());
}

/// The process of a stage of the run in that folder.
fn stage(out: &Path, name: &str) -> u32 {
    let mut found = None;
    wait_for(name, || {
        found = std::fs::read_dir("/proc").unwrap().flatten().find_map(|process| {
            let pid = process.file_name().to_str()?.parse().ok()?;
            let words = std::fs::read_to_string(process.path().join("cmdline")).ok()?;
            let words: Vec<&str> = words.split('\0').collect();
            let is_it = words.get(1..3)? == ["stage", name] && words.contains(&out.to_str()?);
            is_it.then_some(pid)
        });
        found.is_some()
    });
    found.unwrap()
}

#[test]
fn each_stage_may_be_killed_and_odometry_goes_on() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(100_000);
    room(setup.frames());
    let listener = network.listen(&[]);
    let ros2 = network.join_and_run(&setup);
    let _camera = network.camera(&setup, &[]);
    setup.wait_for_growth("the first frames");
    for name in ["sensor", "reconstruct", "align", "optimise"] {
        let pid = stage(&setup.out(), name);
        signal(pid, "-KILL");
        wait_for("a successor", || stage(&setup.out(), name) != pid);
        setup.wait_for_growth(&format!("frames after {name} died"));
        let before = listener.n_odometry();
        wait_for("what is published after that", || listener.n_odometry() > before + 10);
    }
    ros2.terminate();
    let words = ros2.finish();
    let stamps = stamps(&listener.finish());
    assert!(stamps.windows(2).all(|pair| pair[0] < pair[1]), "{words} {stamps:?}");
    assert_eq!(setup.leftovers(), Vec::<String>::new());
}

#[test]
fn a_program_that_comes_back_keeps_the_camera_of_the_run() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(100_000);
    room(setup.frames());
    let _run = setup.start();
    let camera = network.camera(&setup, &[]);
    let ros2 = network.join(&setup, &[]);
    setup.wait_for_growth("the first frames");
    drop((camera, ros2));
    // As autofocus changes it: the run goes on with its own numbers.
    let camera = network.camera(&setup, &["--start", "400", "--focal", "1.004"]);
    let ros2 = network.join(&setup, &[]);
    setup.wait_for_growth("frames of the camera that changed a little");
    ros2.terminate();
    let words = ros2.finish();
    assert!(words.contains("the CameraInfo changed a little, fx 131.25 to 131.775"), "{words}");
    drop(camera);
    // Another camera, and then the first one again.
    let ros2 = network.join(&setup, &[]);
    let camera = network.camera(&setup, &["--start", "4000", "--focal", "1.3"]);
    ros2.await_words("the CameraInfo is 160x120 px, fx 170.625, expected 160x120 px, fx 131.25");
    drop(camera);
    let _camera = network.camera(&setup, &["--start", "9000"]);
    setup.wait_for_growth("frames of the camera that is back");
    ros2.terminate();
    ros2.finish();
}

#[test]
fn the_camera_of_a_program_that_was_killed_is_not_heard_in_another_domain() {
    let (Some(network), Some(other)) = (Network::new(), Network::new()) else { return };
    let (setup, beside) = (Setup::new(100_000), Setup::new(100_000));
    room(setup.frames());
    let _run = setup.start();
    let _camera = network.camera(&setup, &[]);
    let ros2 = network.join(&setup, &[]);
    setup.wait_for_growth("the first frames");
    let _other_run = beside.start();
    // The camera was not told, and goes on sending to the ports of the one that is gone.
    drop(ros2);
    let ros2 = other.join(&beside, &[]);
    let alone = "no program is heard in DDS domain";
    wait_for("looks without a camera", || ros2.n_of(alone) >= 2 || ros2.n_of("depth /camera") > 0);
    ros2.terminate();
    let words = ros2.finish();
    assert!(!words.contains("depth /camera"), "{words}");
}
