//! `tessera-view`: a run in Rerun, live or into a file.
//!
//! One more reader: of the run directory, of the recording, and of the poses that a run publishes
//! for any viewer. It subscribes to no frames and no surfaces, and writes nothing of the run's.
#![forbid(unsafe_code)]

mod arguments;
mod blueprint;
mod camera;
mod error;
mod feed;
mod find;
mod latency;
mod map;
mod output;
mod scene;
mod track;

use arguments::RerunArguments;
use clap::Parser;
use error::ViewError;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

fn main() -> ExitCode {
    let arguments = RerunArguments::parse();
    match view(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("tessera-view: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

fn view(arguments: &RerunArguments) -> Result<(), ViewError> {
    let is_stopped = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&is_stopped)).map_err(ViewError::signal)?;
    }
    let run = match arguments.of_supervisor {
        Some(pid) => find::of_supervisor(pid, &is_stopped)?,
        None => find::find(&arguments.run)?,
    };
    let recording = output::open(arguments, &run)?;
    feed::feed(&run, arguments, &recording, &is_stopped)?;
    recording.flush_blocking().map_err(ViewError::output)
}
