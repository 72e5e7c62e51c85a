//! What a base says of itself, what it refuses, and a bound on the rate.

use crate::disturbed::deflated_bytes;
use crate::processes::{base, copy_of, fleet, free_port, start, status, uplink, wait_for, wait_for_success};
use crate::run::{GrowingRun, assert_same};
use std::time::Duration;

#[test]
fn a_base_says_what_it_has_and_there_is_one_of_a_folder() {
    let dir = tempfile::tempdir().unwrap();
    let (run, folder, port) = (dir.path().join("run"), dir.path().join("base"), free_port());
    let mut growing = GrowingRun::begin(&run, "desk", 3);
    (0..20).for_each(|_| growing.grow());
    let mut first = base(&folder, port, 1);
    let mut robot = uplink(&run, "a", port);
    wait_for("a map", || status(&folder).mapped > 0);
    let second = fleet(&["base", folder.to_str().unwrap(), "--listen", "tcp/127.0.0.1:0"])
        .stderr(std::process::Stdio::piped())
        .output()
        .unwrap();
    let words = String::from_utf8_lossy(&second.stderr).into_owned();
    assert!(!second.status.success() && words.contains("written by another process"), "{words}");
    let said = fleet(&["base", folder.to_str().unwrap(), "status"])
        .stdout(std::process::Stdio::piped())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&said.stdout).into_owned();
    assert!(said.contains("a desk: 20 frames, 3 keyframes") && said.contains("this machine alone"), "{said}");
    robot.kill();
    wait_for("the robot to be away", || !status(&folder).runs[0].is_connected);
    growing.end();
    let _robot = uplink(&run, "a", port);
    wait_for_success(&mut first, "the base");
    assert!(status(&folder).runs[0].is_ended);
    assert_same(&run, &copy_of(&folder, "a"));
}

#[test]
fn a_base_ends_with_the_last_word_of_a_run() {
    let dir = tempfile::tempdir().unwrap();
    let (run, folder, port) = (dir.path().join("run"), dir.path().join("base"), free_port());
    let mut growing = GrowingRun::begin(&run, "desk", 4);
    (0..20).for_each(|_| growing.grow());
    growing.say_how_it_ended("unfinished");
    growing.end_journals();
    let mut bases = base(&folder, port, 1);
    let _robot = uplink(&run, "a", port);
    wait_for("a map of the whole run", || {
        let said = status(&folder);
        said.mapped > 0 && said.runs[0].is_ended
    });
    growing.say_how_it_ended("finished");
    wait_for_success(&mut bases, "the base");
    assert_same(&run, &copy_of(&folder, "a"));
}

#[test]
fn plain_tcp_beyond_this_machine_is_refused() {
    for arguments in
        [["base", "x", "--listen", "tcp/0.0.0.0:7447"], ["uplink", "x", "--to", "tcp/192.0.2.1:7447"]]
    {
        let dir = tempfile::tempdir().unwrap();
        let output = fleet(&arguments).current_dir(dir.path()).stderr(std::process::Stdio::piped()).output();
        let output = output.unwrap();
        assert_eq!(output.status.code(), Some(2));
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(words.contains("expected tls/HOST:PORT"), "{words}");
    }
}

#[test]
fn a_bound_on_the_rate_is_kept_and_everything_comes() {
    let dir = tempfile::tempdir().unwrap();
    let (run, folder, port) = (dir.path().join("run"), dir.path().join("base"), free_port());
    let mut growing = GrowingRun::begin(&run, "desk", 3);
    (0..40).for_each(|_| growing.grow());
    growing.end();
    let n_bytes = deflated_bytes(&run.join("align.journal"));
    let mut bases = base(&folder, port, 1);
    let to = format!("tcp/127.0.0.1:{port}");
    // Two seconds' worth.
    let kbps = (n_bytes * 8 / 2000).to_string();
    let begun = std::time::Instant::now();
    let arguments = ["uplink", run.to_str().unwrap(), "--to", &to, "--robot", "a", "--max-kbps", &kbps];
    let _robot = start(&arguments);
    wait_for_success(&mut bases, "the base");
    assert!(begun.elapsed() >= Duration::from_millis(1500), "{:?}", begun.elapsed());
    assert_same(&run, &copy_of(&folder, "a"));
}
