//! The run that is joined.

pub(crate) mod again;
pub(crate) mod clock;
pub(crate) mod cut_off;
pub(crate) mod keeper;
pub(crate) mod owned;

use crate::error::Ros2Error;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;
use tessera_geometry::Camera;
use tessera_outputs::{ToolError, read_settings};
use tessera_settings::Settings;
use tessera_slam::WorldUp;
use tessera_stage::{RunFile, RunFiles};
use tessera_transport::{Guest, RunEntry, check_name, living_runs};

/// Under this name the program joins a run.
pub(crate) const GUEST: &str = "ros2";

/// Where `tessera run` makes the folders of its runs.
const RUNS: &str = "runs";

/// A run that goes on.
pub(crate) struct JoinedRun {
    pub(crate) entry: RunEntry,
    pub(crate) guest: Guest,
}

impl JoinedRun {
    /// Joins the run of that name; `None` where there is none (yet).
    pub(crate) fn join(name: &str) -> Result<Option<Self>, Ros2Error> {
        check_name(name)?;
        let Some(entry) = living_runs()?.into_iter().find(|run| run.name == name) else { return Ok(None) };
        match Guest::open(&entry.identity, GUEST) {
            Ok(guest) => Ok(Some(Self { entry, guest })),
            // It was cut off, and its successor has not yet replaced the entry.
            Err(_) if !entry.is_alive()? => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// Whether it still goes on, and is not another one of the same name.
    pub(crate) fn is_current(&self) -> Result<bool, Ros2Error> {
        Ok(self.entry.is_alive()?)
    }

    /// The camera that its images must have; `None` where it has had no image yet, or `--camera` of
    /// `tessera run` decides.
    ///
    /// # Errors
    /// Where its files cannot be read.
    pub(crate) fn camera(&self) -> Result<Option<Camera>, Ros2Error> {
        let known = known(&self.entry)?;
        Ok(known.and_then(|(run, settings)| settings.run.camera.is_empty().then_some(run.camera)))
    }

    /// Axes of its world; `None` where it has had no image yet.
    ///
    /// # Errors
    /// Where its files cannot be read.
    pub(crate) fn world_up(&self) -> Result<Option<WorldUp>, Ros2Error> {
        Ok(known(&self.entry)?.map(|(_, settings)| settings.mapping.world_up))
    }
}

/// What a run wrote of itself; `None` where it has had no image yet.
///
/// # Errors
/// Where its files cannot be read.
pub(crate) fn known(entry: &RunEntry) -> Result<Option<(RunFile, Settings)>, ToolError> {
    let files = RunFiles::new(&entry.run_dir);
    if !files.run_file().is_file() {
        return Ok(None);
    }
    let run = RunFile::read(&files)?;
    // Another one is that of a run which used the folder before.
    let is_its = run.identity == entry.identity;
    is_its.then(|| Ok((run, read_settings(&files)?))).transpose()
}

/// The command: the program that started this one, or that beside it or on `PATH`.
pub(crate) fn tessera() -> Command {
    Command::new(std::env::var_os("TESSERA_PROGRAM").unwrap_or_else(|| {
        let beside = std::env::current_exe().unwrap_or_default().with_file_name("tessera");
        if beside.is_file() { beside.into_os_string() } else { OsString::from("tessera") }
    }))
}

/// The next run after one in `run_dir`: its name, and the arguments of `tessera run` for it. A number
/// behind `name` is the first whose folder is free, and a folder that was asked for gets it too.
pub(crate) fn next_run(name: &str, run_dir: &Path, arguments: &[String]) -> (String, Vec<String>) {
    let given = out_of(arguments);
    let folder = |number: u64| match given {
        Some((_, out)) => PathBuf::from(format!("{}-{number}", out.trim_end_matches('/'))),
        None => run_dir.with_file_name(format!("{name}-{number}")),
    };
    let number = (2..).find(|number| !folder(*number).exists()).unwrap_or(2);
    let mut arguments = arguments.to_vec();
    if let Some(out) = given.and_then(|(place, _)| arguments.get_mut(place)) {
        *out = match out.starts_with("--out=") {
            true => format!("--out={}", folder(number).display()),
            false => folder(number).display().to_string(),
        };
    }
    (format!("{name}-{number}"), arguments)
}

/// The folder of a run of that name, or of the one that a reset gave that number.
pub(crate) fn folder_of(name: &str, arguments: &[String], number: Option<u64>) -> PathBuf {
    let folder = match out_of(arguments) {
        Some((_, out)) => out.trim_end_matches('/').to_owned(),
        None => format!("{RUNS}/{name}"),
    };
    PathBuf::from(number.map_or(folder.clone(), |number| format!("{folder}-{number}")))
}

/// Where `--out` is among the arguments, and what it says.
fn out_of(arguments: &[String]) -> Option<(usize, &str)> {
    for (place, word) in arguments.iter().enumerate() {
        if word == "--out" {
            return arguments.iter().map(String::as_str).enumerate().nth(place.saturating_add(1));
        }
        if let Some(out) = word.strip_prefix("--out=") {
            return Some((place, out));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_run_has_a_name_and_a_folder_of_its_own() {
        let dir = tempfile::tempdir().unwrap();
        let words = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>();
        let run_dir = dir.path().join("desk");
        let plain = words(&["--config", "fast"]);
        assert_eq!(next_run("desk", &run_dir, &plain), ("desk-2".to_owned(), plain.clone()));
        std::fs::create_dir(dir.path().join("desk-2")).unwrap();
        assert_eq!(next_run("desk", &run_dir, &plain), ("desk-3".to_owned(), plain));
        let out = dir.path().join("there").display().to_string();
        for (given, expected) in [
            (words(&["--out", &out, "--quiet"]), words(&["--out", &format!("{out}-2"), "--quiet"])),
            (words(&["--quiet", &format!("--out={out}/")]), words(&["--quiet", &format!("--out={out}-2")])),
        ] {
            assert_eq!(next_run("desk", &run_dir, &given), ("desk-2".to_owned(), expected));
        }
    }
}
