//! `tessera-ros2`: a run in a live ROS 2 network, without ROS.
//!
//! To the run it is a camera's own program and a reader of poses, through the public services; to
//! the network a participant that reads a camera's topics and writes odometry and transforms. It
//! may be killed and started again at any time; the run goes on.
#![forbid(unsafe_code)]

mod arguments;
mod base;
mod bridge;
mod carrier;
mod cdr;
mod clock;
mod cut_off;
mod dds;
mod error;
mod first;
mod going;
mod gyro;
mod initial_pose;
mod input;
mod joined;
mod keeper;
mod map;
mod network;
mod open;
mod output;
mod owned;
mod pairing;
mod parameters;
mod path;
mod relocalise;
mod remap;
mod report;
mod reset;
mod ros_arguments;
mod ros_time;
mod run;
mod save;
mod sender;
mod topics;
mod trigger;
#[cfg(feature = "zenoh")]
mod zenoh;

use arguments::Arguments;
use clap::Parser;
use error::Ros2Error;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

fn main() -> ExitCode {
    let words = match ros_arguments::as_own(std::env::args_os().collect()) {
        Ok(words) => words,
        Err(why) => {
            eprintln!("tessera-ros2: {why}");
            return ExitCode::from(Ros2Error::Arguments(why).exit_code());
        }
    };
    let arguments = Arguments::parse_from(words);
    let done = match keeper::is_needed(arguments.run) {
        true => keeper::keep(arguments.quiet),
        false => run(&arguments).map(|()| ExitCode::SUCCESS),
    };
    match done {
        Ok(code) => code,
        Err(error) => {
            eprintln!("tessera-ros2: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Ros2Error> {
    keeper::die_with_keeper();
    let is_stopped = stop_flag()?;
    bridge::bridge(arguments, &is_stopped)
}

/// A flag that is set once this program is told to end.
fn stop_flag() -> Result<Arc<AtomicBool>, Ros2Error> {
    let is_stopped = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&is_stopped)).map_err(Ros2Error::Signal)?;
    }
    Ok(is_stopped)
}
