//! Look after look at a base: lines of JSON, or a terminal.

use super::table::draw;
use super::{cannot, say};
use crate::arguments::LookArguments;
use crate::base::status::{Status, is_running};
use crate::error::FleetError;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyModifiers};
use std::io::IsTerminal;
use std::path::Path;
use std::time::{Duration, Instant};

/// Time between two looks at the keyboard.
const POLL: Duration = Duration::from_millis(50);

/// Calls `show` at each interval, until the base is over, `show` has enough, or the count is reached.
fn at_intervals(
    folder: &Path,
    arguments: &LookArguments,
    mut show: impl FnMut(&Status, Instant) -> Result<bool, FleetError>,
) -> Result<(), FleetError> {
    let interval = Duration::from_secs_f64(arguments.interval.unwrap_or(1.0));
    let mut n_looks = 0_u64;
    loop {
        let is_last = !is_running(folder);
        n_looks = n_looks.saturating_add(1);
        let now = Instant::now();
        let until = now.checked_add(interval).unwrap_or(now);
        let goes_on = show(&Status::read(folder)?, until)?;
        if !goes_on || is_last || arguments.count.is_some_and(|count| n_looks >= count) {
            return Ok(());
        }
        std::thread::sleep(until.saturating_duration_since(Instant::now()));
    }
}

/// Prints a line of JSON for each look.
pub(super) fn print_looks(folder: &Path, arguments: &LookArguments) -> Result<(), FleetError> {
    at_intervals(folder, arguments, |status, _| {
        say(&serde_json::to_string(status)?)?;
        Ok(true)
    })
}

/// Draws each look on the terminal, until a key ends it.
pub(super) fn draw_looks(folder: &Path, arguments: &LookArguments) -> Result<(), FleetError> {
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
    looked?;
    // What was drawn is gone, and of a base that is over there is no more to come.
    if is_running(folder) { Ok(()) } else { say(&Status::read(folder)?.text(false)) }
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
