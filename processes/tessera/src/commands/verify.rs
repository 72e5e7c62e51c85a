//! `tessera verify`: what is whole of a run's folder.

use crate::arguments::VerifyArguments;
use crate::exit::{CommandError, Exit};
use crate::run_folder;
use crate::terminal::say_report;
use std::fmt::Write;
use tessera_outputs::{FileState, Verified};

/// Reads everything of a run and prints what is whole.
pub(crate) fn verify(arguments: &VerifyArguments) -> Result<Exit, CommandError> {
    let folder = run_folder::find(&arguments.run)?;
    let verified = tessera_outputs::verify(&folder)?;
    say_report(arguments.json, &verified, || for_people(&verified))?;
    Ok(if verified.is_whole { Exit::Done } else { Exit::Input })
}

fn for_people(verified: &Verified) -> String {
    let mut text = String::new();
    for file in &verified.files {
        let state = match file.state {
            FileState::Whole => "whole",
            FileState::Torn => "torn end",
            FileState::Damaged => "DAMAGED",
            FileState::Absent => "ABSENT",
        };
        // Writing to a String cannot fail, here and below.
        let _ = writeln!(text, "{:<20} {state:<9} {}", file.name, file.detail);
    }
    let whole = if verified.is_whole { "nothing that was recorded is lost" } else { "the run is not whole" };
    let _ = write!(text, "{whole}");
    text
}
