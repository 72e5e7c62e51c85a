//! Where runs lie: `runs/NAME` below the current folder, or wherever `--out` said.

use crate::exit::CommandError;
use std::path::{Path, PathBuf};

/// Folder of all runs that have no `--out`.
pub(crate) const RUNS: &str = "runs";

/// The folder of a run by its name or by its path.
///
/// # Errors
/// Where there is neither; names the runs there are.
pub(crate) fn find(name_or_folder: &str) -> Result<PathBuf, CommandError> {
    let by_name = Path::new(RUNS).join(name_or_folder);
    let candidates = [by_name, PathBuf::from(name_or_folder)];
    if let Some(folder) = candidates.into_iter().find(|folder| folder.join("config.toml").is_file()) {
        return Ok(folder);
    }
    let names = names();
    let there_are = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
    Err(CommandError::Arguments(format!(
        "no run {name_or_folder:?}: expected the folder of a run or a name in {RUNS}/, where there are: {there_are}"
    )))
}

/// Names of the runs in `runs/`, in order.
pub(crate) fn names() -> Vec<String> {
    let entries = std::fs::read_dir(RUNS).into_iter().flatten().flatten();
    let runs = entries.filter(|entry| entry.path().join("config.toml").is_file());
    let mut names: Vec<String> = runs.filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.sort();
    names
}
