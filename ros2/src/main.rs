//! `tessera-ros2`: a run in a live ROS 2 network, without ROS.
//!
//! To the run it is a camera's own program and a reader of poses, through the public services; to
//! the network a participant that reads a camera's topics and writes odometry and transforms. It
//! may be killed and started again at any time; the run goes on.
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::indexing_slicing,
        clippy::cast_possible_truncation,
        clippy::arithmetic_side_effects
    )
)]

mod arguments;
mod bridge;
mod camera;
mod carrier;
mod error;
mod joined;
#[expect(
    clippy::indexing_slicing,
    clippy::arithmetic_side_effects,
    clippy::cast_possible_truncation,
    reason = "of the run's own journal, which `tessera-journal` and the replay have checked"
)]
mod map;
mod network;
#[expect(
    clippy::indexing_slicing,
    clippy::arithmetic_side_effects,
    reason = "products of poses and of matrices of fixed sizes; counts of 64 bits"
)]
mod poses;
mod report;
#[expect(
    clippy::indexing_slicing,
    clippy::arithmetic_side_effects,
    reason = "words of the command line, at places that were found in them"
)]
mod ros_arguments;
mod run;
mod services;

use arguments::Ros2Arguments;
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
    let arguments = Ros2Arguments::parse_from(words);
    let done = match run::keeper::is_needed(arguments.run) {
        true => run::keeper::keep(arguments.quiet),
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

fn run(arguments: &Ros2Arguments) -> Result<(), Ros2Error> {
    run::keeper::die_with_keeper();
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
