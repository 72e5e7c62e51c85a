//! Words that the program says to its users, collected.

use crate::common::Run;
use std::process::Command;

/// What users were told, and when.
#[derive(Default)]
pub(super) struct Told(pub(super) Vec<(String, String)>);

impl Told {
    /// Lines may be broken anywhere.
    pub(super) fn add(&mut self, when: &str, text: String) {
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        self.0.push((when.to_owned(), text));
    }

    /// Runs the command and keeps what it says.
    pub(super) fn by(&mut self, arguments: &[&str]) {
        let output = Command::new(env!("CARGO_BIN_EXE_tessera")).args(arguments).output().unwrap();
        assert!(!output.status.success(), "{arguments:?} went well");
        self.add(&arguments.join(" "), String::from_utf8(output.stderr).unwrap());
    }

    pub(super) fn by_run(&mut self, run: &Run) {
        let output = run.command().output().unwrap();
        self.add("a run", String::from_utf8_lossy(&output.stderr).into_owned());
        self.add("its log", run.log());
    }
}
