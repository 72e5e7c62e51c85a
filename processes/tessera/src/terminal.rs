//! What people read: one line for an error, plain text for the rest.

use std::io::Write;

/// Prints an error once, as every error of Tessera is printed.
pub(crate) fn say_error(message: &str) {
    // Nowhere to tell it if standard error is closed.
    let _ = writeln!(std::io::stderr().lock(), "tessera: {message}");
}

/// Prints text to standard output; a reader that went away is no failure.
pub(crate) fn say(text: &str) {
    let _ = writeln!(std::io::stdout().lock(), "{}", text.trim_end());
}
