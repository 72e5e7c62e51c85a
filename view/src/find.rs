//! Which run is to be shown, and what is known of it beforehand.

use crate::error::ViewError;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tessera_settings::Settings;
use tessera_stage::{RunFile, RunFiles};
use tessera_transport::registered_runs;

/// Time between two looks for it.
const POLL: Duration = Duration::from_millis(20);

/// A run that can be shown.
pub(crate) struct ViewedRun {
    pub(crate) files: RunFiles,
    pub(crate) file: RunFile,
    pub(crate) settings: Settings,
}

impl ViewedRun {
    fn read(dir: &Path) -> Result<Self, ViewError> {
        let files = RunFiles::new(dir);
        let path = files.config();
        let text = std::fs::read_to_string(&path)
            .map_err(|error| ViewError::File { path: path.clone(), problem: error.to_string() })?;
        let settings = Settings::from_run(&text, &path.display().to_string())?;
        Ok(Self { file: RunFile::read_recorded(&files)?, files, settings })
    }

    /// Whether its supervisor lives.
    pub(crate) fn is_alive(&self) -> Result<bool, ViewError> {
        let runs = registered_runs()?;
        Ok(runs.iter().any(|run| run.is_alive && run.entry.identity == self.file.identity))
    }
}

/// The run of that name or folder.
pub(crate) fn find(name_or_folder: &str) -> Result<ViewedRun, ViewError> {
    let registered = registered_runs()?.into_iter().find(|run| run.entry.name == name_or_folder);
    let candidates = [Path::new("runs").join(name_or_folder), PathBuf::from(name_or_folder)];
    let mut candidates = candidates.into_iter().chain(registered.map(|run| run.entry.run_dir));
    match candidates.find(|dir| dir.join("config.toml").is_file()) {
        Some(dir) => ViewedRun::read(&dir),
        None => Err(ViewError::NoRun { name: name_or_folder.to_owned() }),
    }
}

/// The run of a supervisor that has just begun or is about to.
pub(crate) fn of_supervisor(pid: u32, is_stopped: &AtomicBool) -> Result<ViewedRun, ViewError> {
    // A run may wait for its camera as long as it likes.
    let supervisor = PathBuf::from(format!("/proc/{pid}"));
    while supervisor.exists() && !is_stopped.load(Ordering::Relaxed) {
        for run in registered_runs()?.iter().filter(|run| run.is_alive && run.entry.pid == pid) {
            // Its files are being written: the next look finds them.
            if let Ok(found) = ViewedRun::read(&run.entry.run_dir)
                && found.file.identity == run.entry.identity
            {
                return Ok(found);
            }
        }
        std::thread::sleep(POLL);
    }
    Err(ViewError::NotBegun { pid })
}
