//! `run.json`: what every process of a run must agree on, written once by the supervisor.

use crate::error::StageError;
use crate::names::RunFiles;
use serde::{Deserialize, Serialize};
use tessera_geometry::Camera;
use tessera_journal::{Durability, write_atomically};
use tessera_messages::FrameShape;
use tessera_settings::Settings;
use tessera_surface::Grid;
use tessera_transport::{Layout, RunIdentity};

/// Surfaces of past frames that the aligner may hold beside the new one.
pub const RECENT_SURFACES: u32 = 4;

/// What every process of a run must agree on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunFile {
    /// Name of the run.
    pub name: String,
    /// Version of the program that started it.
    pub version: String,
    /// Its shared memory.
    pub identity: RunIdentity,
    /// The camera of its frames.
    pub camera: Camera,
    /// Standard deviation of a frame's time, seconds; 0 where exposures are stamped.
    #[serde(default)]
    pub stamp_sigma_s: f64,
    /// Frames that the source will give; `None`: no end in sight.
    pub n_frames: Option<u64>,
    /// Frames a second that `--fps` gave to images without times.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fps: Option<f64>,
    /// What looked wrong with the source before the run.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub doubts: Vec<String>,
    /// What was assumed of the source, left out or mended before the run.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// The map that it starts in, if any: enough to know it again.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<MapIdentity>,
    /// The cameras of the runs that made that map, by session, where one is another than this run's.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub map_cameras: Vec<Camera>,
    /// Whether its stages may be made to fail on purpose, as `--faults` asked.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub faults: bool,
    /// Prefix of its shared memory when it began: a run that is resumed keeps it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub began_as: Option<String>,
}

/// Which map a run starts in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MapIdentity {
    /// Keyframes in it.
    pub n_keyframes: u32,
    /// Checksum of the record that the run's journal begins with.
    pub crc: u32,
}

/// What names a run in its `run.json`.
#[derive(Deserialize)]
struct RunBeginning {
    name: String,
    began_as: Option<String>,
}

/// The identity of a run among all, which it keeps when it is resumed: FNV-1a over its name and the random
/// name that it began with; over all of a `run.json` that has none.
pub fn identity_of(run_file: &[u8]) -> u64 {
    let beginning = serde_json::from_slice::<RunBeginning>(run_file).ok();
    let named = beginning.and_then(|run| Some(format!("{}/{}", run.name, run.began_as?)));
    named
        .as_deref()
        .map_or(run_file, str::as_bytes)
        .iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

impl RunFile {
    /// Reads the file of a run that this program goes on with, or looks into while it goes on: refuses that of
    /// another version.
    ///
    /// # Errors
    /// Names the file and what is wrong with it.
    pub fn read(files: &RunFiles) -> Result<Self, StageError> {
        let run = Self::read_recorded(files)?;
        let own = env!("CARGO_PKG_VERSION");
        if run.version != own {
            return Err(StageError::Version { own: own.into(), run: run.version });
        }
        Ok(run)
    }

    /// Reads the file of a run for what was recorded, whichever version of the program it was: what has come
    /// since is absent there, and its records have versions of their own.
    ///
    /// # Errors
    /// Names the file and what is wrong with it.
    pub fn read_recorded(files: &RunFiles) -> Result<Self, StageError> {
        let path = files.run_file();
        let wrong = |problem: String| StageError::RunFile { path: path.clone(), problem };
        let text = std::fs::read_to_string(&path).map_err(|e| wrong(format!("cannot read: {e}")))?;
        let run: RunFile = serde_json::from_str(&text).map_err(|e| wrong(format!("is no run file: {e}")))?;
        for camera in run.map_cameras.iter().chain([&run.camera]) {
            camera.check().map_err(|e| wrong(e.to_string()))?;
        }
        Ok(run)
    }

    /// Writes the file whole or not at all, and to disk.
    ///
    /// # Errors
    /// Where the run directory cannot be written.
    pub fn write(&self, files: &RunFiles) -> Result<(), StageError> {
        let path = files.run_file();
        let wrong = |problem: String| StageError::RunFile { path: path.clone(), problem };
        let text = serde_json::to_string_pretty(self).map_err(|e| wrong(e.to_string()))?;
        write_atomically(&path, Durability::RunState, |writer| writer.write_all(text.as_bytes()))
            .map_err(|e| wrong(format!("cannot write: {e}")))
    }

    /// The sizes of all services.
    pub fn layout(&self, settings: &Settings) -> Layout {
        let step = settings.surface.step as usize;
        let (width, height) = (self.camera.width, self.camera.height);
        Layout {
            frame: FrameShape { width, height },
            grid: Grid {
                width: (width as usize).div_ceil(step),
                height: (height as usize).div_ceil(step),
                step,
            },
            window: settings.flow.window,
            recent: RECENT_SURFACES,
            ahead: settings.flow.window,
            live: settings.run.live,
            external: settings.is_external(),
        }
    }
}
