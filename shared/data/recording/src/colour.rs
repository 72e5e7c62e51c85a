//! How the colour of a recording comes to the pixels of depth: as it is, warped, or not at all.

use crate::camera::{self, RecordedCamera};
use crate::chunks::{Chunks, FoundMessage, Spot};
use crate::error::{MessageError, RecordingError};
use crate::messages::{self, ImageForm, ImageMessage};
use crate::pixels;
use crate::topics::Topics;
use crate::transforms;
use std::sync::Arc;
use tessera_frames::{ColourCamera, ColourWarp, TakenColour, Undistortion, decode};
use tessera_geometry::{Camera, Pose};

/// Pixels by which two cameras of the same images may differ.
const SAME_PX: f64 = 1.0;

/// What is done with the images of the colour topic.
#[derive(Clone, Debug)]
pub(super) enum ColourUse {
    /// Colour is left out, or there is none.
    None,
    /// Colour has the pixels of depth as taken.
    Registered,
    /// Colour of another camera.
    Warped {
        /// The colour camera's own lens, where it is one that the camera model does not have.
        lens: Option<Undistortion>,
        warp: Arc<ColourWarp>,
    },
}

/// What is done, in words for people, and what is wrong with it.
pub(super) struct Choice {
    pub(super) colour: ColourUse,
    pub(super) words: String,
    pub(super) warning: Option<String>,
}

/// The frame of depth and its camera, as they are used.
pub(super) struct Depth<'a> {
    pub(super) camera: &'a Camera,
    /// As recorded; `None` where the recording says nothing of it.
    pub(super) recorded: Option<&'a RecordedCamera>,
    /// The colour camera that a camera file gives beside it.
    pub(super) stated_colour: Option<&'a ColourCamera>,
}

/// Looks at the first colour image, its camera, and where that stands.
pub(super) fn choose(chunks: &Chunks, topics: &Topics, found: &FoundMessage, depth: &Depth<'_>) -> Choice {
    let choice = |colour, words: String| Choice { colour, words, warning: None };
    let (Some(topic), Some(first)) = (&topics.colour, found.colour.first()) else {
        return choice(ColourUse::None, "none".to_owned());
    };
    // One that cannot be read is a frame's problem, not that of all.
    let Ok(size) = size(chunks, first) else {
        return choice(ColourUse::Registered, format!("{topic}, taken as registered to depth"));
    };
    let own = colour_camera(chunks, topics, found, size);
    let standing = |from: &str, to: &str| transforms::colour_from_depth(chunks, found, from, to);
    decide(Images { topic, size, own }, depth, standing)
}

/// The images of a colour topic.
pub(super) struct Images<'a> {
    pub(super) topic: &'a str,
    /// Columns and rows of the first.
    pub(super) size: (u32, u32),
    /// `None`: nothing says it.
    pub(super) own: Option<RecordedCamera>,
}

/// Decides by both cameras and by `colour_from_depth` of their frames, first that of depth.
pub(super) fn decide(
    images: Images<'_>,
    depth: &Depth<'_>,
    colour_from_depth: impl FnOnce(&str, &str) -> Option<Pose>,
) -> Choice {
    let choice = |colour, words: String| Choice { colour, words, warning: None };
    let Images { topic, size, own } = images;
    let depth_size = (depth.camera.width, depth.camera.height);
    if let Some(stated) = depth.stated_colour {
        return of_stated(topic, size, depth.camera, stated);
    }
    if size == depth_size && is_same(depth.recorded, own.as_ref()) {
        return choice(ColourUse::Registered, format!("{topic}, registered to depth"));
    }
    let reason = match warp(depth, own, size, colour_from_depth) {
        Ok(warped) => {
            return choice(
                warped,
                format!("{topic}, {}x{} px, warped to depth by both cameras", size.0, size.1),
            );
        }
        Err(reason) => reason,
    };
    let warning = format!(
        "{topic} is {}x{} px, depth {}x{} px, and {reason}: colour is left out; record aligned depth, or the colour \
         camera's CameraInfo and /tf_static",
        size.0, size.1, depth_size.0, depth_size.1
    );
    Choice { colour: ColourUse::None, words: format!("{topic} left out: {reason}"), warning: Some(warning) }
}

/// Images of the colour camera that a camera file states.
fn of_stated(topic: &str, size: (u32, u32), depth: &Camera, stated: &ColourCamera) -> Choice {
    let expected = (stated.camera.width, stated.camera.height);
    let warp = ColourWarp::new(depth, &stated.camera, stated.colour_from_depth);
    match warp.filter(|_| size == expected) {
        Some(warp) => Choice {
            colour: ColourUse::Warped { lens: None, warp: Arc::new(warp) },
            words: format!("{topic}, {}x{} px, warped to depth by both cameras", size.0, size.1),
            warning: None,
        },
        None => {
            let reason = format!(
                "{}x{} px, where the camera file's [colour] says {}x{}",
                size.0, size.1, expected.0, expected.1
            );
            Choice {
                colour: ColourUse::None,
                words: format!("{topic} left out: {reason}"),
                warning: Some(format!("{topic} is {reason}: colour is left out")),
            }
        }
    }
}

fn colour_camera(
    chunks: &Chunks,
    topics: &Topics,
    found: &FoundMessage,
    size: (u32, u32),
) -> Option<RecordedCamera> {
    let (spot, topic) = found.colour_camera.as_ref().zip(topics.colour_camera.as_ref())?;
    camera::of_colour(chunks, spot, (topics.colour.as_deref()?, size), topic).ok()
}

/// Whether images of the same size are of one camera, as far as is known.
fn is_same(depth: Option<&RecordedCamera>, colour: Option<&RecordedCamera>) -> bool {
    let (Some(depth), Some(colour)) = (depth, colour) else { return true };
    let (a, b) = (&depth.camera, &colour.camera);
    let is_near = |a: f64, b: f64| (a - b).abs() < SAME_PX;
    depth.frame == colour.frame
        || (is_near(a.fx, b.fx) && is_near(a.fy, b.fy) && is_near(a.cx, b.cx) && is_near(a.cy, b.cy))
}

fn warp(
    depth: &Depth<'_>,
    own: Option<RecordedCamera>,
    size: (u32, u32),
    colour_from_depth: impl FnOnce(&str, &str) -> Option<Pose>,
) -> Result<ColourUse, String> {
    let RecordedCamera { camera, lens, frame } = own.ok_or("nothing says what the colour camera is")?;
    if (camera.width, camera.height) != size {
        return Err(format!("its CameraInfo says {}x{} px", camera.width, camera.height));
    }
    let depth_frame = depth.recorded.map_or("", |recorded| recorded.frame.as_str());
    let colour_from_depth = colour_from_depth(depth_frame, &frame)
        .ok_or_else(|| format!("no /tf_static says where '{frame}' is from '{depth_frame}'"))?;
    let warp = ColourWarp::new(depth.camera, &camera, colour_from_depth)
        .ok_or("the numbers of its CameraInfo cannot be")?;
    let lens = lens.map(|lens| Undistortion::new(&lens, &camera));
    Ok(ColourUse::Warped { lens, warp: Arc::new(warp) })
}

/// Columns and rows of an image.
fn size(chunks: &Chunks, spot: &Spot) -> Result<(u32, u32), RecordingError> {
    let data = chunks.read(spot)?;
    let wrong = |problem| RecordingError::Message { topic: String::new(), number: 1, problem };
    let image = messages::image(spot.kind, &data).map_err(wrong)?;
    size_of(&image).map_err(wrong)
}

/// Columns and rows of a colour image.
pub(super) fn size_of(image: &ImageMessage<'_>) -> Result<(u32, u32), MessageError> {
    match &image.form {
        ImageForm::Raw { width, height, .. } => Ok((*width, *height)),
        ImageForm::File { .. } => Ok(decode::size(&image.data)?),
    }
}

impl ColourUse {
    /// Brings a colour image to the pixels of depth. `depth_lens` was taken out of depth.
    pub(super) fn read(
        &self,
        image: &ImageMessage<'_>,
        size: (u32, u32),
        depth_lens: Option<&Undistortion>,
        depth_raw: &[u16],
        rgb: &mut [u8],
    ) -> Result<(), MessageError> {
        match (self, depth_lens) {
            (Self::None, _) => rgb.fill(0),
            (Self::Registered, lens) => {
                pixels::colour(image, size, rgb)?;
                if let Some(lens) = lens {
                    lens.straighten(3, rgb);
                }
            }
            (Self::Warped { lens, warp }, _) => {
                warp.apply(depth_raw, &taken(image, lens.as_ref(), warp.size)?, rgb);
            }
        }
        Ok(())
    }

    /// A colour image that is to be warped, as it was taken but for its lens; `None` where it has the pixels of
    /// depth.
    pub(super) fn as_taken(&self, image: &ImageMessage<'_>) -> Result<Option<TakenColour>, MessageError> {
        let Self::Warped { lens, warp } = self else { return Ok(None) };
        let rgb = taken(image, lens.as_ref(), warp.size)?;
        Ok(Some(TakenColour { camera: warp.colour_camera(), rgb, file: None }))
    }
}

/// An image of a colour camera, its own lens taken out.
fn taken(
    image: &ImageMessage<'_>,
    lens: Option<&Undistortion>,
    (width, height): (u32, u32),
) -> Result<Vec<u8>, MessageError> {
    let mut taken = vec![0; (width as usize).saturating_mul(height as usize).saturating_mul(3)];
    pixels::colour(image, (width, height), &mut taken)?;
    if let Some(lens) = lens {
        lens.straighten(3, &mut taken);
    }
    Ok(taken)
}
