//! The file that holds a stage's input: the framing of a journal, with a kind of its own.

use crate::exit::CommandError;
use serde::{Deserialize, Serialize};
use serde_bytes::ByteBuf;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tessera_geometry::{Camera, InertialRotation};
use tessera_journal::{Follower, Journal, JournalError};
use tessera_mapping::{AlignRecord, AppliedCorrection};
use tessera_messages::Stage;
use tessera_offline::Method;
use tessera_settings::Settings;
use tessera_surface::Vertex;

/// What such a file calls itself.
const KIND: &str = "stage input";

/// Stages whose input can be recorded, by name.
pub(crate) struct Stages;

impl Stages {
    const ALL: [Stage; 3] = [Stage::Reconstruct, Stage::Align, Stage::Optimise];

    /// The stage of that name.
    ///
    /// # Errors
    /// Names those that there are.
    pub(crate) fn named(name: &str) -> Result<Stage, CommandError> {
        Self::ALL.into_iter().find(|stage| stage.name() == name).ok_or_else(|| {
            CommandError::Arguments(format!(
                "no stage {name:?} to record, expected one of {}",
                Self::ALL.map(Stage::name).join(", ")
            ))
        })
    }
}

/// What comes first in the file.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Begin {
    /// Name of the stage.
    pub(crate) stage: String,
    /// Every setting, as in a run's `config.toml`.
    pub(crate) config: String,
    /// The camera of the frames.
    pub(crate) camera: Camera,
}

/// One piece of input, with the checksum of what the pipeline made of it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) enum Entry {
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

/// Vertices as bytes.
pub(crate) fn to_bytes(vertices: &[Vertex]) -> ByteBuf {
    ByteBuf::from(bytemuck::cast_slice::<_, u8>(vertices).to_vec())
}

/// Vertices from bytes, checked for their number.
///
/// # Errors
/// Names the number of bytes found and expected.
pub(crate) fn to_vertices(bytes: &[u8], n_vertices: usize) -> Result<Vec<Vertex>, CommandError> {
    let expected = n_vertices * size_of::<Vertex>();
    if bytes.len() != expected {
        return Err(CommandError::Input(format!(
            "a recorded surface has {} bytes, expected {expected}",
            bytes.len()
        )));
    }
    Ok(bytemuck::pod_collect_to_vec(bytes))
}

/// Writes a recording under a temporary name until it is whole.
pub(crate) struct Writer {
    journal: Journal<Entry>,
    temporary: PathBuf,
    path: PathBuf,
}

impl Writer {
    /// Begins a recording.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub(crate) fn create(path: &Path, begin: Begin) -> Result<Self, CommandError> {
        let mut temporary = path.as_os_str().to_owned();
        temporary.push(".new");
        let temporary = PathBuf::from(temporary);
        match std::fs::remove_file(&temporary) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(CommandError::write(path, error));
            }
            _ => {}
        }
        let (journal, _) = Journal::open(&temporary, KIND, Duration::ZERO, |_: Entry| Ok(()))
            .map_err(|error| CommandError::write(path, error))?;
        let mut writer = Self { journal, temporary, path: path.to_owned() };
        writer.add(&Entry::Begin(Box::new(begin)))?;
        Ok(writer)
    }

    /// Adds an entry.
    ///
    /// # Errors
    /// Where the disk is full.
    pub(crate) fn add(&mut self, entry: &Entry) -> Result<(), CommandError> {
        self.journal.append(entry, false).map_err(|error| CommandError::write(&self.path, error))
    }

    /// Ends the recording and gives it its name.
    ///
    /// # Errors
    /// As [`Self::add`].
    pub(crate) fn finish(mut self, n_frames: u64) -> Result<u64, CommandError> {
        self.add(&Entry::End { n_frames })?;
        std::fs::rename(&self.temporary, &self.path)
            .map_err(|error| CommandError::write(&self.path, error))?;
        Ok(self.journal.mark().len_bytes())
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        // Gone already where the recording is whole.
        let _ = std::fs::remove_file(&self.temporary);
    }
}

/// A recording in memory.
pub(crate) struct Recorded {
    pub(crate) stage: Stage,
    pub(crate) settings: Settings,
    pub(crate) camera: Camera,
    pub(crate) entries: Vec<Entry>,
}

impl Recorded {
    /// Reads a whole recording.
    ///
    /// # Errors
    /// Where it is something else, of another version, or cut short.
    pub(crate) fn read(path: &Path) -> Result<Self, CommandError> {
        let bad = |problem: String| CommandError::Input(format!("{}: {problem}", path.display()));
        let foreign = |error: JournalError| CommandError::Input(error.to_string());
        let mut follower = Follower::<Entry>::open(path, KIND).map_err(foreign)?;
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
        Ok(Self { stage, settings, camera: begin.camera, entries })
    }

    /// The settings of the algorithms.
    pub(crate) fn method(&self) -> Method {
        Method {
            surface: self.settings.surface.clone(),
            registration: self.settings.registration.clone(),
            mapping: self.settings.mapping.clone(),
        }
    }
}
