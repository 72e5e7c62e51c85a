//! A program that cannot go on as it is begins anew in its own process.

use crate::error::Ros2Error;
use crate::report::Report;
use std::os::unix::process::CommandExt;
use std::process::Command;

/// Begins this program anew, with the same arguments and variables. As after a kill, the run goes on meanwhile and is
/// joined, or taken over where this program began it.
///
/// Returns only where the system refuses it.
pub(crate) fn begin_anew(report: &Report) -> Ros2Error {
    report.say(
        "DDS has ended, as after a stop of this process or a sleep of the machine: this program begins anew",
    );
    let refused = |error: std::io::Error| Ros2Error::Run(format!("cannot start this program again: {error}"));
    match std::env::current_exe() {
        Ok(program) => refused(Command::new(program).args(std::env::args_os().skip(1)).exec()),
        Err(error) => refused(error),
    }
}
