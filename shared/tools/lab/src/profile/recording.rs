//! The file that holds a stage's input: the framing of a journal, with a kind of its own.

use serde::{Deserialize, Serialize};
use serde_bytes::ByteBuf;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tessera_features::{Extractor, Feature};
use tessera_geometry::{Camera, InertialRotation, UpDirection};
use tessera_journal::{Follower, Journal, JournalError, RecordKind, sync_folder_of};
use tessera_messages::{Stage, read_features, vertices_of_features, write_features};
use tessera_offline::Method;
use tessera_outputs::ToolError;
use tessera_settings::Settings;
use tessera_slam::{AlignRecord, AppliedCorrection};
use tessera_surface::Vertex;

/// Its records.
const KIND: RecordKind<Entry> = RecordKind::only("stage input", 18);

/// Stages whose input can be recorded, by name.
pub struct Stages;

impl Stages {
    const ALL: [Stage; 3] = [Stage::Reconstruct, Stage::Align, Stage::Optimise];

    /// The stage of that name.
    ///
    /// # Errors
    /// Names those that there are.
    pub fn named(name: &str) -> Result<Stage, ToolError> {
        Self::ALL.into_iter().find(|stage| stage.name() == name).ok_or_else(|| {
            ToolError::Arguments(format!(
                "no stage {name:?} to record, expected one of {}",
                Self::ALL.map(Stage::name).join(", ")
            ))
        })
    }
}

/// What comes first in the file.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Begin {
    /// Name of the stage.
    pub stage: String,
    /// Every setting, as in a run's `config.toml`.
    pub config: String,
    /// The camera of the frames.
    pub camera: Camera,
    /// Standard deviation of a frame's time, seconds.
    pub stamp_sigma_s: f64,
}

/// One piece of input, with the checksum of what the pipeline made of it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum Entry {
    /// The first entry.
    Begin(Box<Begin>),
    /// A decoded frame (reconstruct).
    Image {
        /// Raw depth, row by row, 16 bits little-endian each.
        depth: ByteBuf,
        /// Red, green, blue, where the frame has colour.
        colour: Option<ByteBuf>,
        /// Of the surface's bytes.
        expected: u32,
    },
    /// A frame's surface (align).
    Surface {
        /// Frame index.
        index: u64,
        /// Sensor time.
        stamp_nanos: i64,
        /// Since the source's first frame, where a gyroscope measured it.
        rotation: Option<InertialRotation>,
        /// The direction against gravity, where an accelerometer measured it.
        up: Option<UpDirection>,
        /// One [`Vertex`] per grid node.
        vertices: ByteBuf,
        /// Of the frame's record, without the place of its surface in a store.
        expected: u32,
    },
    /// A correction, with the index before which it took effect (align).
    Correction(Box<AppliedCorrection>),
    /// The surface of the keyframe that the next record brings (optimise).
    Keyframe(ByteBuf),
    /// A record of the aligner's journal (optimise).
    Record(Box<AlignRecord>),
    /// The pending request was answered here (optimise); the checksum is that of the correction.
    Answer(u32),
    /// The last entry.
    End {
        /// Frames of the source.
        n_frames: u64,
    },
}

/// The extractor of a recording's colour images.
pub(super) fn feature_extractor(recorded: &Recorded) -> Extractor {
    let method = recorded.method();
    method.mapping.features.extractor(&recorded.camera, method.registration.isa)
}

/// A surface and the features of its frame as bytes, as a surface message holds them.
pub(super) fn to_bytes(vertices: &[Vertex], features: &[Feature]) -> ByteBuf {
    let mut payload = vertices.to_vec();
    payload.resize(vertices.len() + vertices_of_features(features.len()), Vertex::default());
    write_features(&mut payload[vertices.len()..], features);
    ByteBuf::from(bytemuck::cast_slice::<_, u8>(&payload).to_vec())
}

/// A surface of `n_vertices` and its features from bytes, checked for their number.
///
/// # Errors
/// Names the number of bytes found and expected.
pub(super) fn from_bytes(bytes: &[u8], n_vertices: usize) -> Result<(Vec<Vertex>, Vec<Feature>), ToolError> {
    let expected = n_vertices * size_of::<Vertex>();
    if bytes.len() < expected || !bytes.len().is_multiple_of(size_of::<Vertex>()) {
        return Err(ToolError::Input(format!(
            "a recorded surface has {} bytes, expected {expected} and its features",
            bytes.len()
        )));
    }
    let mut payload: Vec<Vertex> = bytemuck::pod_collect_to_vec(bytes);
    let features = read_features(&payload, n_vertices);
    payload.truncate(n_vertices);
    Ok((payload, features))
}

/// Writes a recording under a temporary name until it is whole.
pub(super) struct RecordingWriter {
    journal: Journal<Entry>,
    temporary: PathBuf,
    path: PathBuf,
}

impl RecordingWriter {
    /// Begins a recording.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub(super) fn create(path: &Path, begin: Begin) -> Result<Self, ToolError> {
        let mut temporary = path.as_os_str().to_owned();
        temporary.push(".new");
        let temporary = PathBuf::from(temporary);
        match std::fs::remove_file(&temporary) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(ToolError::write(path, error));
            }
            _ => {}
        }
        let (journal, _) = Journal::open(&temporary, KIND, Duration::ZERO, |_| Ok(()))
            .map_err(|error| ToolError::write(path, error))?;
        let mut writer = Self { journal, temporary, path: path.to_owned() };
        writer.add(&Entry::Begin(Box::new(begin)))?;
        Ok(writer)
    }

    /// Adds an entry.
    ///
    /// # Errors
    /// Where the disk is full.
    pub(super) fn add(&mut self, entry: &Entry) -> Result<(), ToolError> {
        self.journal.append(entry, false).map_err(|error| ToolError::write(&self.path, error))
    }

    /// Ends the recording and gives it its name.
    ///
    /// # Errors
    /// As [`Self::add`].
    pub(super) fn finish(mut self, n_frames: u64) -> Result<u64, ToolError> {
        self.add(&Entry::End { n_frames })?;
        let wrong = |error: &dyn std::fmt::Display| ToolError::write(&self.path, error);
        // Bytes before the name: a power cut must not leave the name of a recording on half of one.
        self.journal.sync_unnoted().map_err(|error| wrong(&error))?;
        std::fs::rename(&self.temporary, &self.path).map_err(|error| wrong(&error))?;
        sync_folder_of(&self.path).map_err(|error| wrong(&error))?;
        Ok(self.journal.mark().len_bytes())
    }
}

impl Drop for RecordingWriter {
    fn drop(&mut self) {
        // Gone already where the recording is whole.
        let _ = std::fs::remove_file(&self.temporary);
    }
}

/// A recording in memory.
pub struct Recorded {
    /// The stage whose input it is.
    pub stage: Stage,
    /// Settings of the recorded run.
    pub settings: Settings,
    /// Camera of the frames.
    pub camera: Camera,
    /// Standard deviation of a frame's time, seconds.
    pub stamp_sigma_s: f64,
    /// The input in order.
    pub entries: Vec<Entry>,
}

impl Recorded {
    /// Reads a whole recording.
    ///
    /// # Errors
    /// Where it is something else, of another version, or cut short.
    pub fn read(path: &Path) -> Result<Self, ToolError> {
        let bad = |problem: String| ToolError::Input(format!("{}: {problem}", path.display()));
        let foreign = |error: JournalError| ToolError::Input(error.to_string());
        let mut follower = Follower::open(path, KIND).map_err(foreign)?;
        let Some(Entry::Begin(begin)) = follower.next().map_err(foreign)? else {
            return Err(bad("does not begin as a recording of `tessera record`".to_owned()));
        };
        let mut entries = Vec::new();
        loop {
            match follower.next().map_err(foreign)? {
                Some(Entry::End { .. }) => break,
                Some(entry) => entries.push(entry),
                None => return Err(bad(format!("is cut short after {} entries", entries.len() + 1))),
            }
        }
        let stage = Stages::named(&begin.stage)?;
        let settings = Settings::from_toml(&begin.config, &path.display().to_string())?;
        begin.camera.check().map_err(|error| bad(error.to_string()))?;
        let Begin { camera, stamp_sigma_s, .. } = *begin;
        Ok(Self { stage, settings, camera, stamp_sigma_s, entries })
    }

    /// The settings of the algorithms.
    pub fn method(&self) -> Method {
        Method {
            surface: self.settings.surface.clone(),
            registration: self.settings.registration.clone(),
            mapping: self.settings.mapping.clone(),
        }
    }
}
