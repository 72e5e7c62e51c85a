//! The command `tessera`: runs the four processes and says what came of it.
//!
//! A command is one small file under `commands`; the outputs of a run are pure functions of its
//! run directory, under `outputs`.
#![forbid(unsafe_code)]

mod arguments;
mod commands;
mod companion;
mod exit;
mod launch;
mod progress;
mod run_folder;
mod terminal;
mod top;
mod viewer;

use arguments::{Arguments, Command, RunArguments};
use clap::error::ContextKind;
use clap::{CommandFactory, Parser};
use exit::Exit;
use std::process::ExitCode;

/// Reads the command line, carries the command out and returns the exit code.
pub fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return refuse(&error),
    };
    let result = match arguments.command.unwrap_or_else(|| Command::Run(RunArguments::default())) {
        Command::Run(arguments) => commands::run(&arguments),
        Command::Stage(arguments) => match commands::stage(&arguments) {
            Ok(code) => return code,
            Err(error) => Err(error),
        },
        Command::Evaluate(arguments) => commands::evaluate(&arguments),
        Command::Export(arguments) => commands::export(&arguments),
        Command::Report(arguments) => commands::report(&arguments),
        Command::Resume(arguments) => commands::resume(&arguments),
        Command::Verify(arguments) => commands::verify(&arguments),
        Command::Status(arguments) => commands::status(&arguments),
        Command::Calibrate(arguments) => commands::calibrate(&arguments),
        Command::Ablate(arguments) => commands::ablate(&arguments),
        Command::Check(arguments) => commands::check(&arguments),
        Command::Chaos(arguments) => commands::chaos(&arguments),
        Command::Record(arguments) => commands::record(&arguments),
        Command::Profile(arguments) => commands::profile(&arguments),
        Command::Top(arguments) => commands::top(&arguments),
        Command::View(arguments) => commands::view(&arguments),
        Command::Ros2(arguments) => commands::pass_on("ros2", &arguments.arguments),
        Command::Uplink(arguments) => commands::pass_on("uplink", &arguments.arguments),
        Command::Base(arguments) => commands::pass_on("base", &arguments.arguments),
        Command::Clean => commands::clean(),
        Command::Completions { shell } => commands::completions(shell),
        Command::Man { folder } => commands::man(&folder),
    };
    match result {
        Ok(exit) => exit.into(),
        Err(error) => {
            terminal::say_error(&error.to_string());
            error.exit().into()
        }
    }
}

/// The command that a word is by one slip of the fingers: a letter more, less, another, or two in another order.
fn nearest(word: &str) -> Option<String> {
    let commands = Arguments::command();
    let names = commands.get_subcommands().map(|command| command.get_name().to_owned());
    names.into_iter().find(|name| strsim::osa_distance(name, word) == 1)
}

/// Prints help and version where asked for, else what is wrong with the arguments.
fn refuse(error: &clap::Error) -> ExitCode {
    if !error.use_stderr() {
        // A closed pipe (`tessera --help | head -1`) is no failure.
        let _ = error.print();
        return Exit::Done.into();
    }
    let words = "no such command (`tessera run FOLDER` runs a recording):";
    let mut text = error.render().to_string().replace("unrecognized subcommand", words);
    if let Some(near) = error.get(ContextKind::InvalidSubcommand).and_then(|word| nearest(&word.to_string()))
        && error.get(ContextKind::SuggestedSubcommand).is_none()
    {
        text = text.replacen("\n", &format!("; did you mean `tessera {near}`?\n"), 1);
    }
    terminal::say_error(text.strip_prefix("error: ").unwrap_or(&text).trim_end());
    Exit::Arguments.into()
}
