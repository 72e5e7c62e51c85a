//! The map of an earlier run, copied into the folder of a run that starts in it.
//!
//! Copied, not linked: the earlier run stays as it is whatever becomes of this one.

use crate::failure::SupervisorError;
use crate::failure::directory;
use rustix::fs::{CWD, RenameFlags, renameat_with};
use std::path::Path;
use std::time::Duration;
use tessera_features::Feature;
use tessera_geometry::Camera;
use tessera_journal::{Follower, Journal, Store, fingerprint, lock_file};
use tessera_settings::Settings;
use tessera_slam::{AlignRecord, KeyframeSurfaces, MapRecord, TrackerState, WorldUp};
use tessera_stage::{ALIGN_JOURNAL, MapIdentity, RunFile, RunFiles, StoredKeyframes, store_slot};
use tessera_surface::Vertex;
use tessera_transport::living_runs;

/// The map of an earlier run in memory, for a run in the calling process.
pub struct LoadedMap {
    /// Its keyframes and submaps, and where the run starts in it, where that is known.
    pub record: MapRecord,
    /// Surface of each keyframe.
    pub surfaces: Vec<Vec<Vertex>>,
    /// Features of each keyframe.
    pub features: Vec<Vec<Feature>>,
    /// The cameras that saw it, by session, where one is another than that of the run that starts in it.
    pub cameras: Vec<Camera>,
    /// Which way is up in it: for the settings of the run that starts in it.
    pub world_up: WorldUp,
}

/// Reads the map that `settings` name into memory; `None` where they name none.
///
/// # Errors
/// There is no map in that folder, its run is going on, its surfaces have another shape or are damaged.
pub fn load_map(camera: &Camera, settings: &Settings) -> Result<Option<LoadedMap>, SupervisorError> {
    let Some(MapOnDisk { files, mut keyframes, record, cameras, world_up }) =
        MapOnDisk::open(camera, settings)?
    else {
        return Ok(None);
    };
    let wrong = |e: &dyn std::fmt::Display| directory("read the map of", &files.dir, e);
    let ids = || record.keyframes.iter().map(|keyframe| keyframe.id);
    let surfaces =
        ids().map(|id| keyframes.load(id)).collect::<Result<Vec<_>, _>>().map_err(|e| wrong(&e))?;
    let features = ids().map(|id| keyframes.features(id).to_vec()).collect();
    keyframes.check().map_err(|e| wrong(&e))?;
    Ok(Some(LoadedMap { record, surfaces, features, cameras, world_up }))
}

/// An earlier run whose map can be used by a run with this camera and these settings.
pub(crate) struct MapOnDisk {
    files: RunFiles,
    keyframes: StoredKeyframes,
    record: MapRecord,
    cameras: Vec<Camera>,
    world_up: WorldUp,
}

impl MapOnDisk {
    /// Reads the map that `settings` name; `None` where they name none.
    ///
    /// # Errors
    /// Where there is no map in that folder, its run is going on, or its surfaces have another shape.
    pub(crate) fn open(camera: &Camera, settings: &Settings) -> Result<Option<Self>, SupervisorError> {
        let folder = Path::new(&settings.run.map);
        if settings.run.map.is_empty() {
            return Ok(None);
        }
        let refuse = |reason: String| SupervisorError::Map { dir: folder.into(), reason };
        if !settings.mapping.relocalise.enabled {
            return Err(refuse("needs mapping.relocalise.enabled = true, it is false".into()));
        }
        let files = RunFiles::new(folder);
        if !files.run_file().is_file() {
            return Err(refuse("is no folder of a run: it has no run.json".into()));
        }
        let run = RunFile::read_recorded(&files)?;
        refuse_if_going_on(&files, &run).map_err(&refuse)?;
        let text =
            std::fs::read_to_string(files.config()).map_err(|e| directory("read", &files.config(), &e))?;
        let old = Settings::from_run(&text, &files.config().display().to_string())
            .map_err(|e| refuse(e.to_string()))?;
        check_alike((&run.camera, &old), (camera, settings)).map_err(&refuse)?;
        let grid = run.layout(&old).grid;
        let mut keyframes =
            StoredKeyframes::open(&files.store(), grid).map_err(|e| directory("map", &files.store(), &e))?;
        let mut state = TrackerState::default();
        let journal = files.align_journal();
        let unusable = |e: &dyn std::fmt::Display| directory("read", &journal, e);
        let mut records = Follower::<AlignRecord>::open(&journal, ALIGN_JOURNAL).map_err(|e| unusable(&e))?;
        while let Some(record) = records.next().map_err(|e| unusable(&e))? {
            keyframes.take(&record)?;
            state.apply(&record);
        }
        let torn = records.bytes_left().map_err(|e| unusable(&e))?;
        if torn > 0 {
            return Err(refuse(format!(
                "is damaged: {torn} bytes at the end of align.journal are no records; put it right with: tessera resume {}",
                folder.display()
            )));
        }
        if state.keyframes.is_empty() {
            return Err(refuse("has no keyframe yet".into()));
        }
        let cameras = cameras(&run, &state, camera);
        let start = settings.run.start().map_err(&refuse)?;
        let record = MapRecord { keyframes: state.keyframes, submaps: state.submaps, start };
        Ok(Some(Self { files, keyframes, record, cameras, world_up: old.mapping.world_up }))
    }

    /// The cameras that saw the map, by session, where one is another than that of the run that starts in it.
    pub(crate) fn cameras(&self) -> &[Camera] {
        &self.cameras
    }

    /// Axes of the map's world, in which the run goes on whatever its own settings say.
    pub(crate) fn world_up(&self) -> WorldUp {
        self.world_up
    }

    /// Copies the surfaces into an empty store and makes the map the first record of a journal.
    ///
    /// # Errors
    /// Where something cannot be written, or the map is not the one `expected`.
    pub(crate) fn plant(
        mut self,
        store: &mut Store,
        journal: &mut Journal<AlignRecord>,
        expected: Option<MapIdentity>,
    ) -> Result<MapIdentity, SupervisorError> {
        let wrong = |e: &dyn std::fmt::Display| directory("copy the map of", &self.files.dir, e);
        for keyframe in &mut self.record.keyframes {
            let stored = self.keyframes.stored(keyframe.id).map_err(|e| wrong(&e))?;
            let slot = match stored {
                Some(bytes) => store.append(&bytes, false),
                None => store.append_given_up(),
            };
            keyframe.slot = store_slot(&slot.map_err(|e| wrong(&e))?);
        }
        let n_keyframes = u32::try_from(self.record.keyframes.len()).unwrap_or(u32::MAX);
        let record = AlignRecord::Map(Box::new(self.record));
        let identity = MapIdentity { n_keyframes, crc: fingerprint(&record).map_err(|e| wrong(&e))? };
        if let Some(expected) = expected.filter(|expected| *expected != identity) {
            return Err(SupervisorError::Map {
                dir: self.files.dir,
                reason: format!(
                    "has changed since this run began in it: {n_keyframes} keyframes with checksum {:08x}, expected {} with {:08x}",
                    identity.crc, expected.n_keyframes, expected.crc
                ),
            });
        }
        store.sync().map_err(|e| wrong(&e))?;
        journal.append(&record, true).map_err(|e| wrong(&e))?;
        tracing::info!("starts in the map of {}: {n_keyframes} keyframes", self.files.dir.display());
        Ok(identity)
    }
}

/// Lets the folder of a finished run and that of the map it started in change places, in one step:
/// the map's folder then holds the extended map, the run's folder the map as it was.
///
/// # Errors
/// Where the run of the map's folder is going on, or the folders lie on different file systems.
pub fn update_map(map: &Path, run_dir: &Path) -> Result<(), SupervisorError> {
    let files = RunFiles::new(map);
    let run = RunFile::read_recorded(&files)?;
    refuse_if_going_on(&files, &run).map_err(|reason| SupervisorError::Map { dir: map.into(), reason })?;
    renameat_with(CWD, map, CWD, run_dir, RenameFlags::EXCHANGE)
        .map_err(|e| directory("exchange with the map's folder", run_dir, &e))
}

/// A run that is going on still changes its map.
fn refuse_if_going_on(files: &RunFiles, run: &RunFile) -> Result<(), String> {
    let same = |other: &Path| match (std::fs::canonicalize(other), std::fs::canonicalize(&files.dir)) {
        (Ok(other), Ok(ours)) => other == ours,
        _ => false,
    };
    let alive = living_runs().unwrap_or_default().into_iter().find(|run| same(&run.run_dir));
    if let Some(alive) = alive {
        return Err(format!(
            "belongs to a run that is going on: {} (pid {}); wait for its end or stop it",
            alive.name, alive.pid
        ));
    }
    // Another user's runs are not in the registry: their writers' locks tell.
    let path = files.align_journal();
    let Ok(file) = std::fs::File::open(&path) else { return Ok(()) };
    lock_file(&file, &path, Duration::ZERO)
        .map_err(|e| format!("belongs to a run that is going on, {}: {e}", run.name))
}

/// The cameras of the runs that made a map, by session; nothing where all are like `own`.
fn cameras(run: &RunFile, state: &TrackerState, own: &Camera) -> Vec<Camera> {
    let n_sessions =
        state.keyframes.iter().map(|k| (k.session as usize).saturating_add(1)).max().unwrap_or(0);
    let of = |session: usize| run.map_cameras.get(session).unwrap_or(&run.camera).clone();
    let all: Vec<Camera> = (0..n_sessions.min(state.keyframes.len())).map(of).collect();
    let lens = |c: &Camera| ([c.fx, c.fy, c.cx, c.cy, c.depth_offset_m], c.distortion);
    if all.iter().all(|camera| lens(camera) == lens(own)) { Vec::new() } else { all }
}

/// Surfaces of one map have one shape, and rows that were read out alike.
fn check_alike(
    (old_camera, old): (&Camera, &Settings),
    (camera, settings): (&Camera, &Settings),
) -> Result<(), String> {
    let words = |camera: &Camera| {
        let Camera { width, height, readout_s, .. } = camera;
        format!("{width}x{height} px, readout {readout_s} s")
    };
    let grid = |s: &Settings| format!("surface.step {} and variant {:?}", s.surface.step, s.surface.variant);
    let pairs = [("kind of camera", words(old_camera), words(camera)), ("grid", grid(old), grid(settings))];
    for (what, found, expected) in pairs {
        if found != expected {
            return Err(format!("was made with another {what}: {found}, this run has {expected}"));
        }
    }
    Ok(())
}
