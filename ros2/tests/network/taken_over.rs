//! A program that began a run and dies, or a whole robot that does: it is started again, and the run is still its
//! own.

use crate::common::{Network, Setup, wait_for, wait_for_growth};
use crate::images::room;
use crate::program::signal;
use crate::services::ended;
use std::time::Duration;

/// The process that a program keeps.
fn kept_by(keeper: u32) -> u32 {
    let mut found = None;
    wait_for("a kept program", || {
        found = std::fs::read_dir("/proc").unwrap().flatten().find_map(|process| {
            let pid: u32 = process.file_name().to_str()?.parse().ok()?;
            let status = std::fs::read_to_string(process.path().join("status")).ok()?;
            let is_it =
                status.contains(&format!("PPid:\t{keeper}\n")) && status.starts_with("Name:\ttessera-ros2\n");
            is_it.then_some(pid)
        });
        found.is_some()
    });
    found.unwrap()
}

#[test]
fn a_program_that_dies_is_started_again_and_takes_its_run_over() {
    let Some(network) = Network::new() else { return };
    let (setup, _camera, ros2) = network.running();
    let taken = format!("the run {} goes on: it is taken over", setup.name);
    // It alone: its keeper starts it again.
    signal(kept_by(ros2.id()), "-KILL");
    ros2.await_words("died (signal: 9 (SIGKILL)) and is started again");
    ros2.await_words(&taken);
    setup.wait_for_growth("frames after the program died");
    // A second one beside it would send a second camera's images.
    let (status, words) = network.join_and_run(&setup).wait();
    assert!(status.code() == Some(4) && words.contains("carries the run"), "{status} {words}");
    // Both: the same command started again, as a launch file with `respawn` does.
    let kept = kept_by(ros2.id());
    drop(ros2);
    wait_for("the death of the kept program", || !std::path::Path::new(&format!("/proc/{kept}")).exists());
    let ros2 = network.join_and_run(&setup);
    ros2.await_words(&taken);
    setup.wait_for_growth("frames after both died");
    let reply = network.call("cyclone", "reset");
    assert_eq!(reply["success"], true, "{reply}");
    assert!(ended(&setup.out()).starts_with("\"finished\""), "{}", ended(&setup.out()));
    let next = setup.frames().join("out-2");
    wait_for_growth(&next, "frames of the next run");
    ros2.terminate();
    let words = ros2.finish();
    assert!(ended(&next).starts_with("\"finished\""), "{} {words}", ended(&next));
    assert_eq!(setup.leftovers(), Vec::<String>::new());
}

/// As by Ctrl-Z and `fg`, or where a laptop sleeps: waits of all threads are interrupted.
#[test]
fn a_program_that_was_stopped_and_goes_on_hears_its_camera_again() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(100_000);
    room(setup.frames());
    let run = setup.start();
    let _camera = network.camera(&setup, &[]);
    let ros2 = network.join(&setup, &[]);
    setup.wait_for_growth("the first frames");
    ros2.freeze();
    std::thread::sleep(Duration::from_secs(1));
    ros2.thaw();
    setup.wait_for_growth("frames after the program was stopped");
    ros2.terminate();
    ros2.finish();
    drop(run);
}

/// Of each thread of RustDDS in a process, whether `SIGCHLD` is held from it.
fn signals_held(pid: u32) -> Vec<bool> {
    const SIGCHLD: u64 = 1 << 16;
    let threads = std::fs::read_dir(format!("/proc/{pid}/task")).unwrap().flatten();
    let status = threads.map(|thread| std::fs::read_to_string(thread.path().join("status")).unwrap());
    let held = status.filter(|status| status.starts_with("Name:\tRustDDS")).map(|status| {
        let held = status.lines().find_map(|line| line.strip_prefix("SigBlk:\t")).unwrap();
        u64::from_str_radix(held, 16).unwrap() & SIGCHLD != 0
    });
    held.collect()
}

/// The robot's programs: the keeper, what it keeps, and all processes of its run.
fn of_robot(keeper: u32, out: &std::path::Path) -> Vec<u32> {
    let words = out.display().to_string();
    let of_run = std::fs::read_dir("/proc").unwrap().flatten().filter_map(|process| {
        let pid: u32 = process.file_name().to_str()?.parse().ok()?;
        let line = std::fs::read(process.path().join("cmdline")).ok()?;
        String::from_utf8_lossy(&line).contains(&words).then_some(pid)
    });
    [keeper, kept_by(keeper)].into_iter().chain(of_run).collect()
}

#[test]
fn a_laptop_that_sleeps_goes_on_with_its_run_and_owns_it() {
    let Some(network) = Network::new() else { return };
    let (setup, camera, ros2) = network.running();
    let kept = kept_by(ros2.id());
    assert_eq!(signals_held(kept), [true, true], "the end of a child would end a loop of RustDDS");
    for _ in 0..2 {
        let mut pids = of_robot(ros2.id(), &setup.out());
        pids.push(camera.id());
        pids.iter().for_each(|pid| signal(*pid, "-STOP"));
        std::thread::sleep(Duration::from_secs(3));
        pids.iter().for_each(|pid| signal(*pid, "-CONT"));
        setup.wait_for_growth("frames after a sleep");
    }
    assert_eq!(kept_by(ros2.id()), kept);
    ros2.terminate();
    let words = ros2.finish();
    assert!(ended(&setup.out()).starts_with("\"finished\""), "{} {words}", ended(&setup.out()));
    assert_eq!(setup.leftovers(), Vec::<String>::new());
}

/// Everything of a run in one blow, as when the robot is turned off.
fn turn_off(keeper: u32, out: &std::path::Path) {
    let pids = of_robot(keeper, out);
    let mut command = std::process::Command::new("kill");
    command.arg("-KILL").args(pids.iter().map(u32::to_string)).status().unwrap();
    let is_there = |pid: &u32| {
        let status = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
        !status.is_empty() && !status.contains("State:\tZ")
    };
    wait_for("the end of all processes", || !pids.iter().any(is_there));
}

#[test]
fn a_robot_that_is_turned_off_goes_on_with_its_run_by_the_same_command() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(100_000);
    room(setup.frames());
    let _camera = network.camera(&setup, &[]);
    for time in 0..3 {
        let ros2 = network.join_and_run(&setup);
        if time > 0 {
            ros2.await_words("was cut off: it goes on, by its own settings");
        }
        setup.wait_for_growth("frames of this day");
        turn_off(ros2.id(), &setup.out());
        drop(ros2);
    }
    let ros2 = network.join_and_run(&setup);
    setup.wait_for_growth("frames of the last day");
    ros2.terminate();
    let words = ros2.finish();
    assert!(ended(&setup.out()).starts_with("\"finished\""), "{} {words}", ended(&setup.out()));
    // It came to its end: the same command does not overwrite it.
    let (status, words) = network.join_and_run(&setup).wait();
    assert!(!status.success() && words.contains("holds a run already"), "{status} {words}");
    assert_eq!(setup.leftovers(), Vec::<String>::new());
}
