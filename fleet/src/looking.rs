//! A base looked at from outside: what it says of itself in its folder, once or again and again.
//!
//! Whoever looks reads files alone, and whatever becomes of him, the base does not notice.

use crate::arguments::{Action, LookArguments};
use crate::error::FleetError;
use crate::metrics::metrics;
use crate::report::page_of;
use crate::status::{STATUS_FILE, Status, is_running};
use crate::top::draw;
use crate::traffic::Traffic;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyModifiers};
use std::io::{IsTerminal, Write};
use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tessera_outputs::ToolError;
use tessera_report::{Answer, LivePage, METRICS_PATH, PageServer, answer};

/// Time between two looks at the keyboard.
const POLL: Duration = Duration::from_millis(50);

/// Does what is asked of the base of a folder.
///
/// # Errors
/// Where no base has ever been there, or the terminal or the network of this machine cannot be used.
pub fn look(folder: &Path, action: Action, arguments: &LookArguments) -> Result<(), FleetError> {
    check(action, arguments)?;
    // A folder that is none of a base is told at once, whatever is asked.
    let status = Status::read(folder)?;
    match (action, arguments.metrics) {
        (Action::Status, _) if arguments.json => say(&pretty_json(&status)?),
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

fn pretty_json(status: &Status) -> Result<String, FleetError> {
    serde_json::to_string_pretty(status).map_err(|e| FleetError::Input(e.to_string()))
}

/// Calls `show` at each interval, until the base is over, `show` has enough, or the count is reached.
fn at_intervals(
    folder: &Path,
    arguments: &LookArguments,
    mut show: impl FnMut(&Status, Instant) -> Result<bool, FleetError>,
) -> Result<(), FleetError> {
    let interval = Duration::from_secs_f64(arguments.interval.unwrap_or(1.0));
    let mut n_looks = 0;
    loop {
        let is_last = !is_running(folder);
        n_looks += 1;
        let until = Instant::now() + interval;
        let goes_on = show(&Status::read(folder)?, until)?;
        if !goes_on || is_last || arguments.count.is_some_and(|count| n_looks >= count) {
            return Ok(());
        }
        std::thread::sleep(until.saturating_duration_since(Instant::now()));
    }
}

fn print_looks(folder: &Path, arguments: &LookArguments) -> Result<(), FleetError> {
    at_intervals(folder, arguments, |status, _| {
        say(&serde_json::to_string(status).map_err(|e| FleetError::Input(e.to_string()))?)?;
        Ok(true)
    })
}

fn draw_looks(folder: &Path, arguments: &LookArguments) -> Result<(), FleetError> {
    if !std::io::stdout().is_terminal() {
        let words = "standard output is no terminal, expected --json or a terminal";
        return Err(FleetError::Arguments(words.into()));
    }
    let mut terminal = ratatui::try_init().map_err(cannot("terminal"))?;
    let looked = at_intervals(folder, arguments, |status, until| {
        terminal.draw(|frame| draw(frame, status, is_running(folder))).map_err(cannot("terminal"))?;
        while Instant::now() < until {
            if wants_end() {
                return Ok(false);
            }
            std::thread::sleep(POLL.min(until.saturating_duration_since(Instant::now())));
        }
        Ok(true)
    });
    ratatui::restore();
    looked
}

/// Whether a key was pressed that ends the view.
fn wants_end() -> bool {
    while event::poll(Duration::ZERO).unwrap_or(false) {
        let Ok(Event::Key(key)) = event::read() else { continue };
        let is_interrupt = key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
        if is_interrupt || matches!(key.code, KeyCode::Char('q') | KeyCode::Esc) {
            return true;
        }
    }
    false
}

/// Answers Prometheus, whether or not the base runs: that it does not is a figure too.
fn serve_metrics(folder: &Path, address: SocketAddr) -> Result<(), FleetError> {
    let refused = |error| FleetError::Arguments(format!("--metrics {address}: {error}"));
    let listener = TcpListener::bind(address).map_err(refused)?;
    let bound = listener.local_addr().map_err(refused)?;
    say(&format!("metrics on http://{bound}{METRICS_PATH}, for this machine alone"))?;
    loop {
        let (stream, _) = listener.accept().map_err(cannot("metrics"))?;
        // A client that goes away harms itself alone.
        let _ = answer(stream, METRICS_PATH, || match Status::read(folder) {
            Ok(status) => metrics(&status, is_running(folder)).into(),
            Err(error) => {
                let body = format!("{error}\n").into();
                Answer { status: "503 Service Unavailable", head: String::new(), body }
            }
        });
    }
}

fn serve_page(folder: &Path) -> Result<(), FleetError> {
    let server = PageServer::open()?;
    say(&format!("{} shows the base to browsers on this machine; Ctrl-C ends this", server.url()?))?;
    Err(server.serve(&BasePage(folder.to_owned())).into())
}

/// The report of a base while it goes on.
struct BasePage(PathBuf);

impl LivePage for BasePage {
    fn growing(&self) -> PathBuf {
        self.0.join(STATUS_FILE)
    }

    fn make(&self) -> Result<String, ToolError> {
        let status = Status::read(&self.0).map_err(|error| ToolError::Input(error.to_string()))?;
        Ok(page_of(&self.0, &status, &Traffic::read(&self.0)))
    }
}
