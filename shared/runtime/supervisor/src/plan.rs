//! Plan of a run, and the run directory in which every process finds it.

use crate::failure::{SupervisorError, directory};
use crate::recorded::{OpenedFiles, Opener, PATIENCE};
use crate::saved_map::MapOnDisk;
use std::fs::{DirBuilder, File};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tessera_geometry::Camera;
use tessera_journal::{Durability, JournalError, end_holder, lock_file, write_atomically};
use tessera_messages::Stage;
use tessera_settings::{Fsync, Settings};
use tessera_stage::{Checkpoint, RunFile, RunFiles, StageError, start_log};
use tessera_transport::{Layout, RunClaim, check_space};

/// Folder of the traces in the run's folder, while the run lasts.
const TRACE_FOLDER: &str = "trace";
/// What is to be run.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Name of the run.
    pub name: String,
    /// Its folder; made where it is missing.
    pub run_dir: PathBuf,
    /// Every setting.
    pub settings: Settings,
    /// Camera of the source.
    pub camera: Camera,
    /// Standard deviation of a frame's time, seconds; 0 where exposures are stamped.
    pub stamp_sigma_s: f64,
    /// Frames of the source.
    pub n_frames: Option<u64>,
    /// Frames a second of images without times, where `--fps` was given.
    pub fps: Option<f64>,
    /// What looks wrong with the source.
    pub doubts: Vec<String>,
    /// What was assumed of the source, left out or mended.
    pub warnings: Vec<String>,
    /// The stages are started from outside.
    pub hold: bool,
    /// Go on with the run that is there.
    pub resume: bool,
    /// Where a file of the run is damaged, go on without what lies behind, and keep a copy.
    pub drop_damaged: bool,
    /// The program that becomes the stages: `std::env::current_exe()`.
    pub executable: PathBuf,
    /// For tests: kill points of the first life of a stage, as `point:index,…`; `None`: there are none, and
    /// stages that are started from outside have none either.
    pub kill_points: Option<Vec<(Stage, String)>>,
    /// Every process writes down what it does and when, below the run's folder.
    pub is_traced: bool,
}

/// A run directory that is ours alone.
pub struct PreparedRun {
    pub claim: RunClaim,
    pub files: RunFiles,
    pub layout: Layout,
    /// Bytes of shared memory that the run may take.
    pub need_bytes: u64,
    /// Locked: two runs never write into one folder, whatever their names.
    _folder: File,
}

impl Plan {
    /// Where the processes write their traces, if they are to.
    pub fn trace_folder(&self) -> Option<PathBuf> {
        self.is_traced.then(|| self.run_dir.join(TRACE_FOLDER))
    }

    /// What the run states of itself, but for the map that it begins in.
    fn run_file(&self, claim: &RunClaim, before: Option<RunFile>) -> RunFile {
        RunFile {
            name: self.name.clone(),
            version: env!("CARGO_PKG_VERSION").into(),
            identity: claim.entry.identity.clone(),
            camera: self.camera.clone(),
            stamp_sigma_s: self.stamp_sigma_s,
            n_frames: self.n_frames,
            fps: self.fps,
            doubts: self.doubts.clone(),
            warnings: self.warnings.clone(),
            map: None,
            map_cameras: Vec::new(),
            faults: self.kill_points.is_some(),
            began_as: match before {
                Some(before) => before.began_as,
                None => Some(claim.entry.identity.prefix.clone()),
            },
        }
    }

    /// Takes the name, unless it is taken already (`claim`), checks the room in shared memory and
    /// writes what every process reads.
    pub fn prepare(&self, claim: Option<RunClaim>) -> Result<PreparedRun, SupervisorError> {
        let files = RunFiles::new(&self.run_dir);
        let is_there = files.run_file().exists();
        if is_there && !self.resume {
            return Err(SupervisorError::RunExists { dir: self.run_dir.clone(), name: self.name.clone() });
        }
        // Refused before anything is made.
        let map = if is_there { None } else { MapOnDisk::open(&self.camera, &self.settings)? };
        let before = if is_there { Some(RunFile::read(&files)?) } else { None };
        let expected = before.as_ref().and_then(|run| run.map);
        let map_cameras = match (&map, &before) {
            (Some(map), _) => map.cameras().to_vec(),
            (None, Some(before)) => before.map_cameras.clone(),
            (None, None) => Vec::new(),
        };
        let claim = claim.map_or_else(|| RunClaim::take(&self.name, &self.run_dir), Ok)?;
        let mut run = RunFile { map: expected, map_cameras, ..self.run_file(&claim, before) };
        let layout = run.layout(&self.settings);
        let need_bytes = check_space(&layout)?;
        let folder = locked_folder(&self.run_dir)?;
        if !is_there && files.run_file().exists() {
            // Another run has come and gone since the look above.
            return Err(SupervisorError::RunExists { dir: self.run_dir.clone(), name: self.name.clone() });
        }
        let mut settings = self.settings.clone();
        if let Some(map) = &map {
            settings.mapping.world_up = map.world_up();
        }
        write_config(&files, &settings)?;
        start_log(&files.log(), "supervisor").map_err(|e| directory("write", &files.log(), &e))?;
        end_stages_left(&files)?;
        // Their readers want them to be there, and whole.
        let opener = Opener::new(self, &files, is_there);
        let OpenedFiles { mut store, mut journal, n_records } = opener.open_aligned(&layout)?;
        if !is_there && n_records > 0 {
            return Err(SupervisorError::Leftover { dir: self.run_dir.clone() });
        }
        if n_records == 0 {
            // Also where a run's journal was lost whole: it begins again as it began.
            let map =
                map.map_or_else(|| MapOnDisk::open(&self.camera, &self.settings), |map| Ok(Some(map)))?;
            if let Some(map) = map {
                run.map = Some(map.plant(&mut store, &mut journal, expected)?);
            }
        }
        let mut optimised = opener.open_optimised()?;
        let unsynced = |error: JournalError| SupervisorError::Stage(StageError::Journal(error));
        if self.settings.flow.fsync.of_run(self.settings.run.live) != Fsync::Never {
            // What was read as whole is on disk before anything is built on it.
            store.sync().map_err(unsynced)?;
            journal.sync().and_then(|()| optimised.sync()).map_err(unsynced)?;
        } else if !is_there {
            // Before run.json, which states that they are there.
            store.sync().map_err(unsynced)?;
            journal.sync_unnoted().and_then(|()| optimised.sync_unnoted()).map_err(unsynced)?;
        }
        drop((journal, store, optimised));
        // Whole journals were read above: what a crash of the machine did to them is mended, and a
        // short cut through them says nothing new.
        Checkpoint::remove(&files.align_checkpoint());
        Checkpoint::remove(&files.optimise_checkpoint());
        let _ = std::fs::remove_file(files.live_clock());
        let _ = std::fs::remove_file(files.camera_session());
        run.write(&files)?;
        Ok(PreparedRun { claim, files, layout, need_bytes, _folder: folder })
    }
}

/// Makes the folder of a run where it is missing, and locks it.
fn locked_folder(run_dir: &Path) -> Result<File, SupervisorError> {
    DirBuilder::new()
        .recursive(true)
        .mode(0o700)
        .create(run_dir)
        .map_err(|e| directory("make", run_dir, &e))?;
    let folder = File::open(run_dir).map_err(|e| directory("open", run_dir, &e))?;
    let in_use = |_| SupervisorError::FolderInUse { dir: run_dir.to_owned() };
    lock_file(&folder, run_dir, Duration::ZERO).map_err(in_use)?;
    Ok(folder)
}

/// Writes the settings of a run, where its folder has not the same already.
fn write_config(files: &RunFiles, settings: &Settings) -> Result<(), SupervisorError> {
    let wrong = |e: &dyn std::fmt::Display| directory("write", &files.config(), e);
    let config = settings.to_toml().map_err(|e| wrong(&e))?;
    if std::fs::read(files.config()).ok().as_deref() == Some(config.as_bytes()) {
        return Ok(());
    }
    // Half a configuration would be a configuration too, of defaults.
    write_atomically(&files.config(), Durability::RunState, |writer| writer.write_all(config.as_bytes()))
        .map_err(|e| wrong(&e))
}

/// Stages of an earlier supervisor end by themselves; one that does not, for instance because it
/// is frozen, is ended: it must not write beside its successor.
fn end_stages_left(files: &RunFiles) -> Result<(), SupervisorError> {
    for path in [files.align_journal(), files.optimise_journal(), files.store()] {
        let Ok(file) = File::open(&path) else { continue };
        if lock_file(&file, &path, PATIENCE).is_err() {
            tracing::warn!("{} is still being written: its writer is ended", path.display());
            end_holder(&path).map_err(|e| directory("free", &path, &e))?;
        }
    }
    Ok(())
}
