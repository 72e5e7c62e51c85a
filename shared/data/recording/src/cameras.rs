//! How depth and colour of a recording are seen: by the camera that was given, or by its own.

use crate::camera;
use crate::chunks::{Chunks, FoundMessage};
use crate::colour::{self, ColourUse};
use crate::error::RecordingError;
use crate::instruments::Instruments;
use crate::topics::Topics;
use tessera_frames::{CameraFile, Undistortion};
use tessera_geometry::Camera;

/// How depth and colour are seen.
#[derive(Clone)]
pub(super) struct Cameras {
    pub(super) depth: Camera,
    /// Where the camera is from, for people.
    pub(super) from: String,
    /// A lens that is taken out of depth.
    pub(super) lens: Option<Undistortion>,
    pub(super) colour: ColourUse,
    /// What is done with colour, for people.
    pub(super) colour_words: String,
    pub(super) instruments: Instruments,
}

impl Cameras {
    /// The cameras of a recording, or the one given for depth.
    pub(super) fn read(
        chunks: &Chunks,
        topics: &Topics,
        found: &FoundMessage,
        given: Option<(CameraFile, &str)>,
        warnings: &mut Vec<String>,
    ) -> Result<Self, RecordingError> {
        let first =
            found.depth.first().ok_or_else(|| RecordingError::Empty { topic: topics.depth.clone() })?;
        let recorded = camera::of_depth(chunks, topics, (found.camera.as_ref(), found.units.as_ref()), first);
        let stated = given.as_ref().and_then(|(file, _)| file.colour.clone());
        let (mut depth, from, lens, recorded) = match given {
            Some((file, name)) => {
                let lens = file.lens.map(|lens| Undistortion::new(&lens, &file.camera));
                (file.camera, name.to_owned(), lens, recorded.ok())
            }
            None => {
                let recorded = recorded?;
                let camera = recorded.camera.clone();
                let mut from = topics.camera.clone().unwrap_or_default();
                if let Some(lens) = &recorded.lens {
                    from.push_str(", ");
                    from.push_str(lens.words());
                }
                let lens = recorded.lens.map(|lens| Undistortion::new(&lens, &camera));
                (camera, from, lens, Some(recorded))
            }
        };
        // Once it is warped.
        depth.colour_registered |= stated.is_some();
        let seen =
            colour::Depth { camera: &depth, recorded: recorded.as_ref(), stated_colour: stated.as_ref() };
        let choice = colour::choose(chunks, topics, found, &seen);
        warnings.extend(choice.warning);
        let frame = recorded.map_or(String::new(), |recorded| recorded.frame);
        let instruments = Instruments::find(chunks, found, &frame);
        Ok(Self { depth, from, lens, colour: choice.colour, colour_words: choice.words, instruments })
    }
}
