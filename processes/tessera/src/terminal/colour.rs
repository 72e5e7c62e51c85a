//! Colours: on a terminal alone, and not where `NO_COLOR` says otherwise.

use std::io::IsTerminal;

const RESET: &str = "\x1b[0m";
const RED: &str = "\x1b[1;31m";
const GREEN: &str = "\x1b[32m";
const YELLOW: &str = "\x1b[33m";

/// What a line begins with, and its colour.
const MARKS: [(&str, &str); 5] = [
    ("tessera:", RED),
    ("  WARNING", YELLOW),
    ("  warning:", YELLOW),
    ("  promise     kept", GREEN),
    ("  promise     BROKEN", RED),
];

/// Whether this stream is to be coloured (<https://no-color.org>).
pub(crate) fn is_wanted(stream: &impl IsTerminal) -> bool {
    let is_set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    stream.is_terminal() && !is_set("NO_COLOR") && std::env::var_os("TERM").is_none_or(|term| term != "dumb")
}

/// Colours the beginnings of lines that deserve a look.
pub(crate) fn paint(text: &str) -> String {
    let lines: Vec<String> = text.lines().map(paint_line).collect();
    lines.join("\n")
}

fn paint_line(line: &str) -> String {
    let mark = MARKS.iter().find_map(|(mark, colour)| Some((line.strip_prefix(mark)?, mark, colour)));
    match mark {
        Some((rest, mark, colour)) => format!("{colour}{mark}{RESET}{rest}"),
        None => line.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beginnings_are_coloured_and_nothing_else() {
        let text = "room: done\n  warning: tessera: no";
        assert_eq!(paint(text), "room: done\n\x1b[33m  warning:\x1b[0m tessera: no");
    }
}
