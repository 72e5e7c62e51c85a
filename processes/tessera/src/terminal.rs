//! Output on the terminal: each error once, text of at most 80 columns for the rest.

mod colour;
mod fit;

use crate::exit::{CommandError, Exit};
pub(crate) use fit::{WIDTH, fit};
use serde::Serialize;
use std::io::{IsTerminal, Write};

/// Prints an error once, as every error of Tessera is printed: in one line where a program reads
/// it, in lines that fit where a person does.
pub(crate) fn say_error(message: &str) {
    let stream = std::io::stderr().lock();
    let mut text = format!("tessera: {message}");
    if stream.is_terminal() {
        text = fit(&text);
    }
    print(stream, &text);
}

/// Prints data to standard output as it is; a reader that went away is no failure.
pub(crate) fn say(text: &str) {
    let _ = writeln!(std::io::stdout().lock(), "{}", text.trim_end());
}

/// Prints text for people to standard output, in lines that fit.
pub(crate) fn say_to_people(text: &str) {
    print(std::io::stdout().lock(), &fit(text.trim_end()));
}

/// Prints a report as JSON or, with `text`, for people.
pub(crate) fn say_report(
    as_json: bool,
    report: &impl Serialize,
    text: impl FnOnce() -> String,
) -> Result<Exit, CommandError> {
    if as_json {
        say(&json(report)?);
    } else {
        say_to_people(&text());
    }
    Ok(Exit::Done)
}

/// The JSON of a report.
pub(crate) fn json(report: &impl Serialize) -> Result<String, CommandError> {
    serde_json::to_string_pretty(report).map_err(|error| CommandError::stage(error.to_string()))
}

fn print(mut stream: impl Write + IsTerminal, text: &str) {
    let text = if colour::is_wanted(&stream) { colour::paint(text) } else { text.to_owned() };
    // A reader that went away is no failure, and there is nowhere to tell it.
    let _ = writeln!(stream, "{text}");
}
