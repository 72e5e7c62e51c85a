//! One stage as a process: starting it, ending it, and what its end means.

use crate::failure::SupervisorError;
use crate::plan::Plan;
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use tessera_messages::{Beat, Stage};
use tessera_stage::{
    KILL_POINTS_VARIABLE, NOTIFY_VARIABLES, POISON_VARIABLE, RunFiles, STRUCK, StageError, TRACE_VARIABLE,
};

/// Set for a stage whose standard input is the supervisor's life line.
pub const LIFELINE_VARIABLE: &str = "TESSERA_LIFELINE";

/// Starts a stage in its own process group: Ctrl-C reaches the supervisor alone. It leaves the
/// frames of `poison` out.
pub(crate) fn spawn(
    plan: &Plan,
    files: &RunFiles,
    stage: Stage,
    is_first: bool,
    poison: &[u64],
) -> Result<Child, SupervisorError> {
    let failed = |reason: std::io::Error| SupervisorError::Spawn {
        what: format!("{stage} from {}", plan.executable.display()),
        reason: reason.to_string(),
    };
    let log = OpenOptions::new().append(true).create(true).open(files.log()).map_err(failed)?;
    let mut command = Command::new(&plan.executable);
    command
        .args(["stage", stage.name(), "--run-dir"])
        .arg(&files.dir)
        .env(LIFELINE_VARIABLE, "1")
        .env_remove(KILL_POINTS_VARIABLE)
        .env_remove(POISON_VARIABLE)
        .env_remove(TRACE_VARIABLE)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(log)
        .process_group(0);
    for name in NOTIFY_VARIABLES {
        command.env_remove(name);
    }
    if let Some(folder) = plan.trace_folder() {
        command.env(TRACE_VARIABLE, folder);
    }
    if !poison.is_empty() {
        let words: Vec<String> = poison.iter().map(u64::to_string).collect();
        command.env(POISON_VARIABLE, words.join(","));
    }
    let points = kill_points(plan, files, stage, is_first);
    if !points.is_empty() {
        command.env(KILL_POINTS_VARIABLE, points.join(","));
    }
    command.spawn().map_err(failed)
}

/// The beat that a stage which ended by itself has left in its standard output.
pub(crate) fn last_beat(child: &mut Child) -> Option<Beat> {
    let mut pipe = child.stdout.take()?;
    // A process that it started may have the pipe still.
    rustix::fs::fcntl_setfl(&pipe, rustix::fs::OFlags::NONBLOCK).ok()?;
    let mut bytes = Vec::new();
    // Whatever was read before an error is in `bytes`.
    let _ = pipe.read_to_end(&mut bytes);
    Beat::last_of(&bytes).filter(|beat| beat.pid == child.id())
}

/// The kill points of a life: those with a star belong to every life, those with a plus to every
/// life until they have struck, the others to the first.
fn kill_points<'a>(plan: &'a Plan, files: &RunFiles, stage: Stage, is_first: bool) -> Vec<&'a str> {
    let points = plan.kill_points.iter().flatten().filter(|(of, _)| *of == stage);
    let points: Vec<&str> = points.flat_map(|(_, words)| words.split(',')).collect();
    // Also a first life may follow others: those of a supervisor that was killed.
    let struck = match points.iter().any(|word| word.ends_with('+')) {
        true => lines_with(&files.log(), STRUCK),
        false => Vec::new(),
    };
    let has_struck = |word: &str| {
        let word = word.trim_end_matches('+');
        let name = if word.split(':').count() < 3 { format!("{word}:kill") } else { word.to_owned() };
        let (mark, by) = (format!(" {stage}["), format!("{STRUCK} {name} "));
        struck.iter().any(|line| line.contains(&mark) && line.contains(&by))
    };
    let is_due = |word: &&str| match word.chars().last() {
        Some('*') => true,
        Some('+') => !has_struck(word),
        _ => is_first,
    };
    points.into_iter().filter(is_due).collect()
}

/// Lines of a file with these words; the others are not kept, for a log may be long.
fn lines_with(path: &Path, words: &str) -> Vec<String> {
    let Ok(file) = File::open(path) else { return Vec::new() };
    let lines = BufReader::new(file).split(b'\n').map_while(Result::ok);
    let lines = lines.map(|line| String::from_utf8_lossy(&line).into_owned());
    lines.filter(|line| line.contains(words)).collect()
}

/// What the end of a stage means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Meaning {
    /// Its part is done.
    Finished,
    /// It was stopped or killed from outside.
    Killed,
    /// It failed in a way that trying again cannot cure.
    Unusable,
    /// It failed by its own doing.
    Failed,
}

/// What an exit status means.
pub(crate) fn meaning(status: ExitStatus) -> Meaning {
    const FROM_OUTSIDE: [i32; 4] = [
        signal_hook::consts::SIGKILL,
        signal_hook::consts::SIGTERM,
        signal_hook::consts::SIGINT,
        signal_hook::consts::SIGHUP,
    ];
    match (status.code(), status.signal()) {
        (Some(0), _) => Meaning::Finished,
        (Some(code), _) if code == i32::from(tessera_stage::Outcome::STOPPED) => Meaning::Killed,
        (Some(2 | 3), _) => Meaning::Unusable,
        // A successor would read from memory what the disk does not have.
        (Some(code), _) if code == i32::from(StageError::NOT_SYNCED) => Meaning::Unusable,
        (_, Some(signal)) if FROM_OUTSIDE.contains(&signal) => Meaning::Killed,
        _ => Meaning::Failed,
    }
}

/// Whether a process ended itself by `abort`, as it does when memory cannot be had.
pub(crate) fn is_abort(status: ExitStatus) -> bool {
    status.signal() == Some(signal_hook::consts::SIGABRT)
}

/// An exit status in words.
pub(crate) fn describe(status: ExitStatus) -> String {
    match (status.code(), status.signal()) {
        (Some(101), _) => "exit status 101 (a panic: a bug in Tessera)".into(),
        (Some(code), _) => format!("exit status {code}"),
        (None, Some(signal)) => {
            let name = signal_hook::low_level::signal_name(signal).unwrap_or("unknown");
            let hint = match signal {
                signal_hook::consts::SIGBUS => ": shared memory or the disk is full",
                _ => "",
            };
            format!("signal {signal} ({name}){hint}")
        }
        (None, None) => "an unknown status".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statuses_have_meanings_and_words() {
        let exit = |code: i32| ExitStatus::from_raw(code << 8);
        let cases = [
            (exit(0), Meaning::Finished, "exit status 0"),
            (exit(75), Meaning::Killed, "exit status 75"),
            (exit(3), Meaning::Unusable, "exit status 3"),
            (exit(4), Meaning::Failed, "exit status 4"),
            (exit(101), Meaning::Failed, "exit status 101 (a panic: a bug in Tessera)"),
            (ExitStatus::from_raw(9), Meaning::Killed, "signal 9 (SIGKILL)"),
            (ExitStatus::from_raw(11), Meaning::Failed, "signal 11 (SIGSEGV)"),
        ];
        for (status, expected, words) in cases {
            assert_eq!((meaning(status), describe(status).as_str()), (expected, words));
        }
    }
}
