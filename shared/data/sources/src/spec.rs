//! Naming a source in one word, and opening it.

use crate::folder::is_zip;
use crate::klg::{self, KlgSource};
use crate::partial::PartialSource;
use crate::sens::{self, SensSource};
use crate::{FolderSource, RecordingOptions, RecordingSource, Source, SourceError};
use crate::{bag, unread};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::{Path, PathBuf};
use tessera_frames::large;
use tessera_simulation::{SceneName, SimulatedSource, SimulationOptions};

/// Name of the source whose frames a camera's own program sends.
const EXTERNAL: &str = "external";

/// Topic of colour that stands for: leave colour out.
pub const COLOUR_NONE: &str = "none";

/// Which source; written into the run directory so that a restarted process opens the same.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SourceSpec {
    /// A simulated scene.
    Scene(SceneName),
    /// A folder of images or of a bag, or whatever else has that name.
    Folder(PathBuf),
    /// An MCAP file; bags are known by their content.
    Recording(PathBuf),
    /// A camera's own program sends the frames: nothing that could be read at any index.
    External,
}

/// Options of a source, beside its name.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SourceOptions {
    /// A built-in camera or a camera file; without it the folder's own, or the scene's default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<String>,
    /// Leave out this many frames at the beginning.
    pub skip: u64,
    /// Use at most this many frames; a scene goes on for as many as are asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frames: Option<u64>,
    /// Topic of depth in an MCAP file or a bag; without it the one whose name says so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth_topic: Option<String>,
    /// Topic of colour in an MCAP file or a bag; without it the one whose name says so. [`COLOUR_NONE`]: colour
    /// is left out, of folders too.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub color_topic: Option<String>,
    /// Frames a second where a folder's images have no times; without it 30.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fps: Option<f64>,
    /// For simulated scenes alone.
    pub simulation: SimulationOptions,
}

impl SourceSpec {
    /// Reads a source name: a scene, `external`, a file whose name ends in `.mcap`, or else a folder. Write `./room` for a folder named room.
    ///
    /// A folder is made absolute, so that the name stays good in another working directory.
    pub fn parse(text: &str) -> Self {
        match SceneName::parse(text) {
            Some(scene) => Self::Scene(scene),
            None if text == EXTERNAL => Self::External,
            None => {
                let path = std::path::absolute(text).unwrap_or_else(|_| PathBuf::from(text));
                let is_mcap = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("mcap"));
                if is_mcap && !path.is_dir() { Self::Recording(path) } else { Self::Folder(path) }
            }
        }
    }
}

impl fmt::Display for SourceSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scene(scene) => f.write_str(scene.name()),
            Self::External => f.write_str(EXTERNAL),
            Self::Recording(file) => write!(f, "{}", file.display()),
            Self::Folder(folder) => write!(f, "{}", folder.display()),
        }
    }
}

/// Opens a source.
///
/// # Errors
/// Names what is wrong and where.
pub fn open(spec: &SourceSpec, options: &SourceOptions) -> Result<Box<dyn Source>, SourceError> {
    let camera = options.camera.as_deref();
    let frames = options.frames.map(|frames| frames.saturating_add(options.skip));
    let source: Box<dyn Source> = match spec {
        SourceSpec::Scene(scene) => {
            Box::new(SimulatedSource::open(*scene, camera, frames, &options.simulation)?)
        }
        SourceSpec::Recording(file) => open_file(file, options, frames)?,
        SourceSpec::External => return Err(SourceError::External),
        SourceSpec::Folder(path) if path.is_file() => open_file(path, options, frames)?,
        SourceSpec::Folder(folder) => match bag::files(folder)? {
            Some(files) => bag::open(folder, &files, &recording_options(options), frames)?,
            None if sens::inside(folder).is_some_and(|_| !crate::folder::is_known(folder)) => {
                let file = sens::inside(folder).unwrap_or_else(|| folder.clone());
                Box::new(SensSource::open(&file, options, frames)?)
            }
            None => {
                let options = SourceOptions { frames, ..options.clone() };
                Box::new(FolderSource::open_with(folder, &options)?)
            }
        },
    };
    let is_whole = options.skip == 0 && large::reduction(source.camera()) == 1;
    Ok(if is_whole { source } else { Box::new(PartialSource::new(source, options.skip)?) })
}

/// A file: an MCAP file or a bag, or for what it is.
fn open_file(
    path: &Path,
    options: &SourceOptions,
    frames: Option<u64>,
) -> Result<Box<dyn Source>, SourceError> {
    if sens::is(path) {
        return Ok(Box::new(SensSource::open(path, options, frames)?));
    }
    if klg::is(path) {
        return Ok(Box::new(KlgSource::open(path, options, frames)?));
    }
    if unread::begins(path, is_zip)
        && let Some(source) = FolderSource::open_zip(path, &SourceOptions { frames, ..options.clone() })?
    {
        return Ok(Box::new(source));
    }
    match unread::file(path) {
        Some(error) => Err(error),
        None => Ok(Box::new(RecordingSource::open(path, &recording_options(options), frames)?)),
    }
}

fn recording_options(options: &SourceOptions) -> RecordingOptions<'_> {
    let colour = options.color_topic.as_deref();
    RecordingOptions {
        camera: options.camera.as_deref(),
        depth_topic: options.depth_topic.as_deref(),
        color_topic: colour.filter(|topic| *topic != COLOUR_NONE),
        is_without_colour: colour == Some(COLOUR_NONE),
        first: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_scenes_and_everything_else_is_a_folder() {
        assert_eq!(SourceSpec::parse("room"), SourceSpec::Scene(SceneName::Room));
        assert_eq!(SourceSpec::parse("house"), SourceSpec::Scene(SceneName::House));
        assert_eq!(SourceSpec::parse("external"), SourceSpec::External);
        let SourceSpec::Folder(folder) = SourceSpec::parse("./room") else { panic!("a folder was meant") };
        assert!(folder.is_absolute() && folder.ends_with("room"));
    }

    #[test]
    fn spec_and_options_survive_a_file() {
        #[derive(Debug, PartialEq, Serialize, Deserialize)]
        struct Both {
            source: SourceSpec,
            options: SourceOptions,
        }
        for source in
            [SourceSpec::Scene(SceneName::Wall), SourceSpec::Folder("/a/b".into()), SourceSpec::External]
        {
            let options = SourceOptions { frames: Some(7), ..SourceOptions::default() };
            let both = Both { source, options };
            let text = toml::to_string(&both).unwrap();
            assert_eq!(toml::from_str::<Both>(&text).unwrap(), both, "{text}");
        }
    }
}
