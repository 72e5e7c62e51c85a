//! Terminal manners: 80 columns, colour for people alone, and what `--quiet` and `--json` promise.

use crate::common::room;
use crate::requirements::missing;
use std::path::Path;
use std::process::{Command, Output, Stdio};

const WIDTH: usize = 80;
const COMMANDS: [&str; 18] = [
    "run",
    "resume",
    "export",
    "report",
    "evaluate",
    "status",
    "top",
    "view",
    "stage",
    "check",
    "calibrate",
    "chaos",
    "ablate",
    "record",
    "profile",
    "clean",
    "completions",
    "man",
];

fn tessera(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tessera")).args(arguments).output().unwrap()
}

/// What a terminal of 80 columns is sent by a command; `None`, with the reason printed, where
/// there is no `script` (util-linux) to make one.
fn on_a_terminal(command: &Command, environment: &[(&str, &str)]) -> Option<String> {
    let quote = |word: &std::ffi::OsStr| format!("'{}'", word.to_str().unwrap());
    let words: Vec<String> =
        std::iter::once(command.get_program()).chain(command.get_args()).map(quote).collect();
    let line = format!("stty cols {WIDTH} rows 24; exec {}", words.join(" "));
    let output = Command::new("script")
        .args(["-qec", &line, "/dev/null"])
        .env_remove("NO_COLOR")
        .env("TERM", "xterm-256color")
        .envs(environment.iter().copied())
        .stdin(Stdio::null())
        .output();
    match output {
        Ok(output) => Some(String::from_utf8(output.stdout).unwrap()),
        Err(error) => {
            missing("terminal", format_args!("no `script` of util-linux: {error}"));
            None
        }
    }
}

/// The lines that a terminal shows, without its control sequences.
fn lines(text: &str) -> Vec<String> {
    let mut plain = String::new();
    let mut rest = text.chars().peekable();
    while let Some(c) = rest.next() {
        if c == '\x1b' && rest.next_if_eq(&'[').is_some() {
            while rest.next().is_some_and(|c| !c.is_ascii_alphabetic()) {}
        } else {
            plain.push(c);
        }
    }
    plain.split(['\n', '\r']).map(|line| line.trim_end().to_owned()).collect()
}

/// Fails where a line is too long that could have been broken.
fn assert_fits(text: &str, what: &str) {
    for line in lines(text) {
        let is_breakable = line.trim().contains(' ');
        assert!(line.chars().count() <= WIDTH || !is_breakable, "{what}: {line}");
    }
}

/// Whether a colour is set anywhere.
fn is_coloured(text: &str) -> bool {
    text.split("\x1b[").skip(1).any(|rest| {
        let numbers: String = rest.chars().take_while(|c| c.is_ascii_digit() || *c == ';').collect();
        rest[numbers.len()..].starts_with('m') && numbers.split(';').any(|n| n.len() == 2 && n != "22")
    })
}

#[test]
fn help_fits_and_has_no_colour_for_programs() {
    for command in COMMANDS {
        for flag in ["--help", "-h"] {
            let output = tessera(&[command, flag]);
            assert!(output.status.success(), "{command}");
            let text = String::from_utf8(output.stdout).unwrap();
            assert!(!text.contains('\x1b'), "{command} {flag}");
            assert_fits(&text, &format!("{command} {flag}"));
        }
    }
    let help = String::from_utf8(tessera(&["--help"]).stdout).unwrap();
    assert_fits(&help, "--help");
    for command in COMMANDS {
        assert!(help.lines().any(|line| line.trim_start().starts_with(&format!("{command} "))), "{command}");
    }
}

#[test]
fn a_run_on_a_terminal_fits_and_is_coloured_only_where_wanted() {
    let run = room();
    let mut command = run.command();
    let words: Vec<_> = command.get_args().filter(|word| *word != "--quiet").map(Into::into).collect();
    command = Command::new(command.get_program());
    command.args::<_, std::ffi::OsString>(words);
    let Some(text) = on_a_terminal(&command, &[]) else { return };
    assert!(text.contains("final       ATE") && text.contains("keyframes"), "{text}");
    assert!(text.contains("\x1b[") && text.contains("=>"), "a bar is drawn: {text:?}");
    assert_fits(&text, "run");

    // The name is taken: an error.
    let coloured = on_a_terminal(&command, &[]).unwrap();
    assert!(coloured.contains("\x1b[1;31mtessera:\x1b[0m"), "{coloured:?}");
    assert_fits(&coloured, "error");
    for environment in [("NO_COLOR", "1"), ("TERM", "dumb")] {
        let text = on_a_terminal(&command, &[environment]).unwrap();
        assert!(text.contains("tessera: ") && !is_coloured(&text), "{environment:?}: {text:?}");
    }
    let coloured = on_a_terminal(Command::new(env!("CARGO_BIN_EXE_tessera")).arg("--help"), &[]).unwrap();
    let plain =
        on_a_terminal(Command::new(env!("CARGO_BIN_EXE_tessera")).arg("--help"), &[("NO_COLOR", "1")]);
    assert_eq!(lines(&coloured), lines(&plain.clone().unwrap()));
    assert!(!is_coloured(&plain.unwrap()));
}

#[test]
fn without_a_terminal_there_is_no_control_sequence() {
    let run = room().frames(10);
    let words: Vec<std::ffi::OsString> =
        run.command().get_args().filter(|word| *word != "--quiet").map(Into::into).collect();
    let output = Command::new(env!("CARGO_BIN_EXE_tessera")).args(&words).output().unwrap();
    assert!(output.status.success());
    let [out, err] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert!(!out.contains('\x1b') && !err.contains('\x1b'), "{out}{err}");
    assert_fits(&out, "summary");
    // An error stays in one line, for a search in it.
    let output = Command::new(env!("CARGO_BIN_EXE_tessera")).args(&words).output().unwrap();
    let err = String::from_utf8(output.stderr).unwrap();
    assert_eq!(err.lines().count(), 1, "{err}");
    assert!(err.len() > WIDTH && err.starts_with("tessera: "), "{err}");
}

#[test]
fn what_commands_print_for_people_fits() {
    let run = room().frames(12);
    assert!(run.finish().success());
    let out = run.out();
    let [out, trajectory, truth] =
        [out.clone(), out.join("trajectory.txt"), out.join("groundtruth.txt")].map(|path| text(&path));
    let commands: [&[&str]; 7] = [
        &["status", &out],
        &["export", &out],
        &["check", "room"],
        &["check", "house"],
        &["evaluate", &trajectory, &truth, "--time-offset", "auto", "--scale"],
        &["evaluate", &trajectory, &trajectory],
        &["chaos", "room", "--frames", "20", "--kills", "1", "--interval-ms", "50", "--quiet"],
    ];
    for command in commands {
        let output = tessera(command);
        assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(!text.contains('\x1b'), "{command:?}");
        assert_fits(&text, command[0]);
    }
}

#[test]
fn quiet_says_nothing_and_json_nothing_else() {
    let run = room().frames(10);
    let output = run.command().output().unwrap();
    assert!(output.status.success(), "{}", run.log());
    assert!(output.stdout.is_empty() && output.stderr.is_empty(), "{output:?}");
    let out = text(&run.out());
    let kitti = text(&run.dir.path().join("poses.txt"));
    let commands: [&[&str]; 5] = [
        &["export", &out, "--json"],
        &["export", &out, "--kitti", &kitti, "--json"],
        &["status", &out, "--json"],
        &["check", "room", "--json"],
        &["status", "--json"],
    ];
    for command in commands {
        let output = tessera(command);
        assert!(output.status.success() && output.stderr.is_empty(), "{command:?}: {output:?}");
        let json: Result<serde_json::Value, _> = serde_json::from_slice(&output.stdout);
        assert!(json.is_ok(), "{command:?}: {}", String::from_utf8_lossy(&output.stdout));
    }
    for command in [&["export", &out, "--quiet"][..], &["report", &out, "--quiet"]] {
        let output = tessera(command);
        assert!(
            output.status.success() && output.stdout.is_empty() && output.stderr.is_empty(),
            "{output:?}"
        );
    }
}

fn text(path: &Path) -> String {
    path.display().to_string()
}
