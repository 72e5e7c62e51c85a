//! A base looked at from outside: what it says of itself in its folder, once or again and again.
//!
//! A viewer reads files alone, and the base does not notice what becomes of it.

mod figures;
mod serve;
mod table;
mod top;

use crate::arguments::{Action, LookArguments};
use crate::base::status::{Status, is_running};
use crate::error::FleetError;
use serve::{serve_metrics, serve_page};
use std::io::Write;
use std::path::Path;
use top::{draw_looks, print_looks};

/// Does what is asked of the base of a folder.
///
/// # Errors
/// Where no base has ever been there, or the terminal or the network of this machine cannot be used.
pub fn look(folder: &Path, action: Action, arguments: &LookArguments) -> Result<(), FleetError> {
    check(action, arguments)?;
    // A folder that is none of a base is told at once, whatever is asked.
    let status = Status::read(folder)?;
    match (action, arguments.metrics) {
        (Action::Status, _) if arguments.json => say(&serde_json::to_string_pretty(&status)?),
        (Action::Status, _) => say(&status.text(is_running(folder))),
        (Action::View, _) => serve_page(folder),
        (Action::Top, Some(address)) => serve_metrics(folder, address),
        (Action::Top, None) if arguments.json => print_looks(folder, arguments),
        (Action::Top, None) => draw_looks(folder, arguments),
    }
}

/// Refuses options of another action than the one that is asked for.
fn check(action: Action, arguments: &LookArguments) -> Result<(), FleetError> {
    let is_top = action == Action::Top;
    let given = [
        ("--json", arguments.json, action != Action::View),
        ("--metrics", arguments.metrics.is_some(), is_top),
        ("--interval", arguments.interval.is_some(), is_top),
        ("--count", arguments.count.is_some(), is_top),
    ];
    match given.iter().find(|(_, is_given, is_known)| *is_given && !is_known) {
        None => Ok(()),
        Some((option, ..)) => Err(FleetError::Arguments(format!(
            "{option} cannot be used with {}, see tessera base --help",
            action.name()
        ))),
    }
}

fn cannot(what: &'static str) -> impl Fn(std::io::Error) -> FleetError {
    move |error| FleetError::Network(format!("{what}: {error}"))
}

/// Prints; a reader that has gone away has seen enough.
fn say(text: &str) -> Result<(), FleetError> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{}", text.trim_end()).and_then(|()| out.flush()) {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => std::process::exit(0),
        written => written.map_err(cannot("standard output")),
    }
}
