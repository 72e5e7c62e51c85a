//! Folder of a run: `runs/NAME` below the current folder, or that of `--out`.

use crate::exit::CommandError;
use std::path::{Path, PathBuf};
use tessera_settings::Settings;
use tessera_stage::RunFiles;
use tessera_transport::{RunEntry, registered_runs};

/// Folder of all runs that have no `--out`.
pub(crate) const RUNS: &str = "runs";
/// Of a base of a fleet, in its folder.
const FLEET_JOURNAL: &str = "fleet.journal";

/// The folder of a run by its name or by its path. A name is looked for in `runs/` and among the
/// runs that are going on or died, wherever their folders are.
///
/// # Errors
/// Where there is none; names the runs there are.
pub(crate) fn find(name_or_folder: &str) -> Result<PathBuf, CommandError> {
    let by_name = Path::new(RUNS).join(name_or_folder);
    let registered = registered_runs().unwrap_or_default();
    let registered = registered.into_iter().find(|run| run.entry.name == name_or_folder);
    let candidates = [by_name, PathBuf::from(name_or_folder)];
    let mut candidates = candidates.into_iter().chain(registered.map(|run| run.entry.run_dir));
    if let Some(folder) = candidates.find(|folder| folder.join("config.toml").is_file()) {
        return Ok(folder);
    }
    let names = names();
    if base(name_or_folder).is_some() {
        return Err(CommandError::arguments(format!(
            "{name_or_folder:?} is the folder of a base: its map's clouds and trajectories are in {name_or_folder}/map, its runs beside that; tessera view shows it, tessera export writes it"
        )));
    }
    let there_are = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
    Err(CommandError::arguments(format!(
        "no run {name_or_folder:?}: expected the folder of a run or a name in {RUNS}/, where there are: {there_are}"
    )))
}

/// The settings of a run that goes on: its shared memory is laid out by them, so that a key of another version is an
/// error here.
pub(crate) fn settings_of_living(files: &RunFiles) -> Result<Settings, CommandError> {
    let origin = files.config().display().to_string();
    let text = std::fs::read_to_string(files.config())
        .map_err(|error| CommandError::input(format!("{origin}: {error}")))?;
    Ok(Settings::from_toml(&text, &origin)?)
}

/// Whether a run is the one of that name or folder.
pub(crate) fn is_of(run: &RunEntry, name_or_folder: &str) -> bool {
    run.name == name_or_folder
        || std::path::absolute(name_or_folder).is_ok_and(|folder| folder == run.run_dir)
}

/// The folder of a base, where that is one: it is looked at as a run is.
pub(crate) fn base(folder: &str) -> Option<PathBuf> {
    let folder = PathBuf::from(folder);
    folder.join(FLEET_JOURNAL).is_file().then_some(folder)
}

/// What fresh names of runs of this source begin with: a scene, or the last part of a path.
pub(crate) fn label(source: &str) -> String {
    let last = Path::new(source).file_name().map(|name| name.to_string_lossy().into_owned());
    let keep = |c: char| if c.is_ascii_alphanumeric() || "._-".contains(c) { c } else { '_' };
    let label: String = last.unwrap_or_default().chars().map(keep).take(40).collect();
    let label = label.trim_start_matches(['.', '-']);
    if label.is_empty() { "run".to_owned() } else { label.to_owned() }
}

/// The first folder `LABEL-NUMBER` below `base` that is not there yet.
pub(crate) fn fresh(base: &Path, source: &str) -> PathBuf {
    let label = label(source);
    let mut folders = (1_u64..).map(|number| base.join(format!("{label}-{number}")));
    folders.find(|folder| !folder.exists()).unwrap_or_else(|| base.join(label))
}

/// Names of the runs in `runs/`, in order.
pub(crate) fn names() -> Vec<String> {
    let entries = std::fs::read_dir(RUNS).into_iter().flatten().flatten();
    let runs = entries.filter(|entry| entry.path().join("config.toml").is_file());
    let mut names: Vec<String> = runs.filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.sort();
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_folder_of_a_base_is_known_and_told_apart_from_a_run() {
        let dir = std::env::temp_dir().join(format!("tessera-base-{}", std::process::id()));
        std::fs::create_dir_all(&dir).unwrap();
        let folder = dir.to_str().unwrap();
        assert_eq!(base(folder), None);
        std::fs::write(dir.join(FLEET_JOURNAL), "").unwrap();
        assert_eq!(base(folder), Some(dir.clone()));
        assert!(find(folder).unwrap_err().to_string().contains("is the folder of a base"));
        std::fs::remove_dir_all(dir).unwrap();
    }

    #[test]
    fn labels_are_usable_names() {
        let cases = [
            ("room", "room"),
            ("/data/fr1 desk", "fr1_desk"),
            ("/data/.hidden/", "hidden"),
            ("/", "run"),
            ("/däta", "d_ta"),
        ];
        for (source, expected) in cases {
            assert_eq!(label(source), expected, "{source}");
            tessera_transport::check_name(&label(source)).unwrap();
        }
    }

    #[test]
    fn a_run_that_is_not_there_is_answered_with_where_to_look() {
        let message = find("no-such-run").unwrap_err().to_string();
        assert!(message.starts_with("no run \"no-such-run\": expected the folder of a run"), "{message}");
    }
}
