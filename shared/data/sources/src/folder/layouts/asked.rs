//! What was asked for beside the folder, and the camera that comes of it.

use super::beside::{camera_beside, camera_file_of, hint_above, not_understood};
use super::guess;
use crate::folder::list::ListEntry;
use crate::{COLOUR_NONE, SourceError, SourceOptions};
use std::path::Path;
use tessera_frames::{CameraFile, OtherLens};
use tessera_geometry::Camera;

/// Frames a second where neither the files nor `--fps` say.
pub(super) const USUAL_FPS: f64 = 30.0;
/// Frames a second that are believed.
pub(super) const POSSIBLE_FPS: std::ops::RangeInclusive<f64> = 0.01..=10_000.0;
/// Name of a camera that is guessed.
const GUESS: &str = "guess";

/// What was asked for beside the folder.
#[derive(Clone, Debug)]
pub(in crate::folder) struct Asked {
    camera: Option<(CameraFile, String)>,
    is_guess: bool,
    pub(super) fps: Option<f64>,
    pub(in crate::folder) is_without_colour: bool,
}

/// A camera, and what is to be known of it.
#[derive(Clone, Debug)]
pub(super) struct ChosenCamera {
    pub(super) camera: Camera,
    /// Where it is from, for people.
    pub(super) from: String,
    /// A lens that is to be taken out of the images.
    pub(super) lens: Option<OtherLens>,
    /// Frames a second that its file states.
    pub(super) fps: Option<f64>,
    /// What is assumed of it, in sentences.
    pub(super) assumed: Vec<String>,
    /// What speaks against it.
    pub(super) doubts: Vec<String>,
}

impl ChosenCamera {
    /// One that a file of the recording states.
    pub(super) fn stated(camera: Camera, from: impl Into<String>) -> Self {
        Self { camera, from: from.into(), lens: None, fps: None, assumed: Vec::new(), doubts: Vec::new() }
    }

    /// A built-in one that the recording's name or form speaks for.
    pub(super) fn assumed(camera: Camera, from: impl Into<String>) -> Self {
        let from = from.into();
        let sentence = format!(
            "no camera file: the camera is assumed to be {from} (fx = {}, units_per_metre = {})",
            camera.fx, camera.units_per_metre
        );
        Self { assumed: vec![sentence], ..Self::stated(camera, from) }
    }
}

impl Asked {
    pub(in crate::folder) fn new(options: &SourceOptions) -> Result<Self, SourceError> {
        let is_guess = options.camera.as_deref() == Some(GUESS);
        let given = options.camera.as_deref().filter(|_| !is_guess);
        let camera = given.map(|name| Ok::<_, SourceError>((CameraFile::named(name)?, name.to_owned())));
        if let Some(fps) = options.fps
            && !POSSIBLE_FPS.contains(&fps)
        {
            let rule = "frames a second from 0.01 to 10000";
            return Err(SourceError::Option { name: "--fps", value: fps.to_string(), rule });
        }
        let is_without_colour = options.color_topic.as_deref() == Some(COLOUR_NONE);
        Ok(Self { camera: camera.transpose()?, is_guess, fps: options.fps, is_without_colour })
    }

    /// The camera given, else that of `camera.toml`, else the one that the layout states.
    pub(super) fn camera(
        &self,
        folder: &Path,
        own: impl FnOnce() -> Result<ChosenCamera, SourceError>,
    ) -> Result<ChosenCamera, SourceError> {
        match self.stated(folder)? {
            Some(chosen) => Ok(chosen),
            None => own(),
        }
    }

    /// The camera given, else that of `camera.toml`, else that of a file of another program beside the
    /// images, whose depth is counted in `units` where it does not state them, else what `assumed` says.
    ///
    /// # Errors
    /// Nothing says what the camera is.
    pub(super) fn camera_or_beside(
        &self,
        folder: &Path,
        depth: &[ListEntry],
        units: f64,
        assumed: impl FnOnce() -> Result<Option<ChosenCamera>, SourceError>,
    ) -> Result<ChosenCamera, SourceError> {
        if let Some(chosen) = self.stated(folder)? {
            return Ok(chosen);
        }
        if let Some(chosen) = camera_beside(folder, depth, units)? {
            return Ok(chosen);
        }
        match assumed()? {
            Some(chosen) => Ok(chosen),
            None if self.is_guess => guess::camera(folder, depth, units),
            None => Err(SourceError::NoCamera {
                folder: folder.to_owned(),
                beside: [not_understood(folder), hint_above(folder, depth, units)]
                    .into_iter()
                    .flatten()
                    .collect(),
                template: guess::template(folder, depth, units),
            }),
        }
    }

    fn stated(&self, folder: &Path) -> Result<Option<ChosenCamera>, SourceError> {
        let Some((file, from)) = self.camera_file(folder)? else { return Ok(None) };
        let assumed = file.assumed.into_iter().collect();
        Ok(Some(ChosenCamera { assumed, lens: file.lens, ..ChosenCamera::stated(file.camera, from) }))
    }

    /// The camera file given, else `camera.toml`, with where it is from.
    pub(in crate::folder) fn camera_file(
        &self,
        folder: &Path,
    ) -> Result<Option<(CameraFile, String)>, SourceError> {
        match &self.camera {
            Some(given) => Ok(Some(given.clone())),
            None => camera_file_of(folder),
        }
    }

    /// Frames a second for frames that have only a number, and what is said of it; `stated` by a file of
    /// the recording.
    pub(super) fn rate(&self, stated: Option<f64>) -> (f64, String) {
        match (self.fps, stated.filter(|fps| POSSIBLE_FPS.contains(fps))) {
            (Some(fps), _) => (fps, format!("none: {fps} frames a second, as given by --fps")),
            (None, Some(fps)) => (fps, format!("none: {fps} frames a second, as the camera file states")),
            (None, None) => (USUAL_FPS, format!("none: {USUAL_FPS} frames a second are assumed (--fps)")),
        }
    }
}
