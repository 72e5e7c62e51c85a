//! A recording in a file: messages of ROS 2, ROS 1 or of Foxglove's schemas in MCAP, in a bag of ROS 1
//! or in a bag of ROS 2 in SQLite.
//!
//! Opening looks for the times of the images: of chunks that are not compressed it reads the heads
//! of their messages, other chunks run through their decompression, several at once, and none is in
//! memory. After that a frame costs the reading of the chunks that it stands in. The file is read
//! and never mapped: one that shrinks meanwhile is an error, not a signal.
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::indexing_slicing,
        clippy::cast_possible_truncation,
        clippy::arithmetic_side_effects
    )
)]

mod camera;
mod cameras;
mod chunks;
mod colour;
mod compression;
mod container;
mod error;
mod foxglove;
mod imu;
mod instruments;
mod librealsense;
mod live;
mod messages;
mod pixels;
mod raw_forms;
pub mod ros;
mod ros1;
mod rvl;
mod topics;
mod transforms;

use cameras::Cameras;
use chunks::{Chunks, FoundMessage, Spot};
use colour::ColourUse;
pub use error::{MessageError, RecordingError};
pub use imu::ImuMessage;
pub use live::{Change, ImageType, LiveCamera, LiveImage, LiveTopic};
use std::path::{Path, PathBuf};
use tessera_frames::imu::ImuRecording;
use tessera_frames::pairing::{pair, uncoloured};
use tessera_frames::timeline::{ImageOrder, RecordedImage, timelines};
use tessera_frames::{CameraFile, SourceError};
use tessera_frames::{FrameBuffers, FrameInfo, Pairing, RayLengths, Source, TakenColour};
use tessera_geometry::{Camera, InertialRotation};
use topics::Topics;
pub use topics::{ChosenTopics, choose_topics};
pub use transforms::FrameTree;

/// Units of depth that comes in metres, where no camera says otherwise: 0.2 mm, up to 13.1 m.
const UNITS_OF_METRES: f64 = 5000.0;

/// What to take from a recording; what is absent is chosen by name, and the camera read from it.
#[derive(Clone, Copy, Default)]
pub struct RecordingOptions<'a> {
    /// A built-in camera or a camera file.
    pub camera: Option<&'a str>,
    /// Topic of depth.
    pub depth_topic: Option<&'a str>,
    /// Topic of colour.
    pub color_topic: Option<&'a str>,
    /// Leave colour out.
    pub is_without_colour: bool,
    /// The first file of the same recording: topics and cameras are as there.
    pub first: Option<&'a RecordingSource>,
}

/// Frames of a file, in the order of the times of depth.
pub struct RecordingSource {
    path: PathBuf,
    chunks: Chunks,
    topics: Topics,
    cameras: Cameras,
    depth: Vec<Spot>,
    /// All colour images, and for each depth image the place of its own.
    colour: Vec<Spot>,
    partners: Vec<Option<usize>>,
    pairing: Pairing,
    warnings: Vec<String>,
    /// Where depth images hold distances along the ray.
    rays: Option<RayLengths>,
    imu: ImuRecording,
    /// For each depth image, where a gyroscope measured it.
    rotations: Vec<InertialRotation>,
}

impl RecordingSource {
    /// Opens a recording: finds its topics, its cameras and the times of all images.
    ///
    /// The camera is `options.camera` if given, else that of the recording. Depth in metres is
    /// counted in the camera's units, or in 5000 a metre where the recording gives the camera.
    ///
    /// # Errors
    /// Names the file, and the byte, topic or message where it is wrong.
    pub fn open(
        path: &Path,
        options: &RecordingOptions<'_>,
        frames: Option<u64>,
    ) -> Result<Self, SourceError> {
        let wrong = |source| SourceError::Recording { path: path.to_owned(), source: Box::new(source) };
        let given = options.camera.map(CameraFile::named).transpose()?;
        let file = container::open(path).map_err(wrong)?;
        let mut warnings: Vec<String> =
            file.cut().iter().map(|cut| format!("{cut}: read up to its last whole record")).collect();
        let chunks = Chunks::new(file);
        let (topics, mut found) = images_of(&chunks, options).map_err(wrong)?;
        if let Some(torn) = found.torn.take() {
            warnings.push(format!("{torn}: read up to there"));
        }
        let colour_name = topics.colour.clone().unwrap_or_default();
        let times =
            timelines(&recorded(&found.depth), &recorded(&found.colour), [&topics.depth, &colour_name]);
        warnings.extend(times.sentences.iter().cloned());
        let is_as_stamped = times.sentences.is_empty();
        found.depth = ordered(&found.depth, &times.depth);
        found.colour = ordered(&found.colour, &times.colour);
        if found.depth.is_empty() {
            return Err(wrong(RecordingError::Empty { topic: topics.depth.clone() }));
        }
        let is_distance = given.as_ref().is_some_and(|file| file.is_distance);
        warnings.extend(given.as_ref().and_then(|file| file.assumed.clone()));
        let n_before = warnings.len();
        let cameras = match options.first {
            Some(first) => first.cameras.clone(),
            None => Cameras::read(&chunks, &topics, &found, given.zip(options.camera), &mut warnings)
                .map_err(wrong)?,
        };
        let is_stated = warnings.len() > n_before;
        let imu = cameras.instruments.recording(&topics, &found, is_as_stamped);
        if options.first.is_none() {
            warnings.extend(cameras.instruments.left_out(&found));
        }
        let is_used = !matches!(cameras.colour, ColourUse::None);
        let (mut depth, colour) = (found.depth, if is_used { found.colour } else { Vec::new() });
        let times = |spots: &[Spot]| spots.iter().map(|spot| spot.stamp_nanos).collect::<Vec<i64>>();
        let (depth_times, colour_times) = (times(&depth), times(&colour));
        let mut pairs = pair(&depth_times, &colour_times);
        let kept = frames.map_or(depth.len(), |n| usize::try_from(n).unwrap_or(usize::MAX).min(depth.len()));
        depth.truncate(kept);
        pairs.truncate(kept);
        let depth_times = depth_times.get(..kept).unwrap_or_default();
        if !is_stated && !options.is_without_colour && options.first.is_none() {
            let reason = topics.colour.is_none().then_some("the recording has no colour topic");
            warnings.extend(uncoloured(depth_times, &colour_times, &pairs.partners, reason));
        }
        let rays = is_distance.then(|| RayLengths::new(&cameras.depth));
        let pairing = pairs.summarise(depth_times, &colour_times);
        depth.iter_mut().zip(pairs.taken_nanos).for_each(|(spot, taken)| spot.stamp_nanos = taken);
        let rotations = imu.rotations(&times(&depth));
        Ok(Self {
            path: path.to_owned(),
            chunks,
            topics,
            cameras,
            depth,
            colour,
            partners: pairs.partners,
            pairing,
            warnings,
            rays,
            imu,
            rotations,
        })
    }

    /// Variance of the rotation by the gyroscope from the first frame to the last one, radians^2.
    pub fn last_variance_rad2(&self) -> f64 {
        self.rotations.last().map_or(0.0, |rotation| rotation.variance_rad2)
    }

    /// The images of a frame, each with its place among those of its kind: depth, and colour where it has a partner.
    fn images(&self, index: u64) -> Result<(SpotAt<'_>, Option<SpotAt<'_>>), SourceError> {
        let last = (self.depth.len() as u64).saturating_sub(1);
        let placed = usize::try_from(index).ok().and_then(|at| Some((at, self.depth.get(at)?)));
        let (at, depth) = placed.ok_or(SourceError::NoFrame { frame: index, last })?;
        let partner = self.partners.get(at).copied().flatten();
        Ok(((at, depth), partner.and_then(|of| Some((of, self.colour.get(of)?)))))
    }

    /// Reads one image, and puts it where it belongs by `decode`.
    fn image<T>(
        &self,
        topic: &str,
        (at, spot): SpotAt<'_>,
        decode: impl FnOnce(&messages::ImageMessage<'_>) -> Result<T, MessageError>,
    ) -> Result<T, SourceError> {
        let wrong = |source| SourceError::Recording { path: self.path.clone(), source: Box::new(source) };
        let data = self.chunks.read(spot).map_err(wrong)?;
        messages::image(spot.kind, &data).and_then(|image| decode(&image)).map_err(|problem| {
            wrong(RecordingError::Message { topic: topic.to_owned(), number: at.saturating_add(1), problem })
        })
    }
}

/// The topics that matter and their messages: by name, and where that finds no images of depth, by what
/// the topics hold.
fn images_of(
    chunks: &Chunks,
    options: &RecordingOptions<'_>,
) -> Result<(Topics, FoundMessage), RecordingError> {
    let (channels, damage) = chunks.file().channels();
    if let Some(first) = options.first {
        let found = chunks::find(chunks.file(), &channels, &first.topics)?;
        return Ok((first.topics.clone(), found));
    }
    let (depth, colour) = (options.depth_topic, options.color_topic);
    let by_name = topics::choose(&channels, depth, colour);
    let named =
        by_name.as_ref().ok().map(|topics| chunks::find(chunks.file(), &channels, topics)).transpose()?;
    let is_good = named.as_ref().zip(by_name.as_ref().ok()).is_some_and(|(found, topics)| {
        let has_depth = found.depth.first().is_some_and(|spot| holds_depth(chunks, spot) != Some(false));
        has_depth && (topics.colour.is_none() || !found.colour.is_empty())
    });
    let (mut topics, mut found) = match (by_name, named) {
        (Ok(topics), Some(found)) if is_good => (topics, found),
        (by_name, named) => {
            let first = chunks::first_images(chunks.file(), &channels);
            let contents =
                first.into_iter().map(|(topic, spot)| (topic, holds_depth(chunks, &spot) == Some(true)));
            match (topics::choose_by_content(&channels, depth, colour, &contents.collect()), by_name, named) {
                (Ok(topics), ..) => {
                    let found = chunks::find(chunks.file(), &channels, &topics)?;
                    (topics, found)
                }
                (Err(_), Ok(topics), Some(found)) => (topics, found),
                // Where something is damaged, what is missing may be in there.
                (Err(missing), Ok(_), None) | (Err(_), Err(missing), _) => {
                    return Err(damage.unwrap_or(missing));
                }
            }
        }
    };
    if options.is_without_colour {
        topics.colour = None;
        found.colour.clear();
    }
    Ok((topics, found))
}

/// Whether the image of a message is depth by its encoding; `None`: it cannot be read.
fn holds_depth(chunks: &Chunks, spot: &Spot) -> Option<bool> {
    let data = chunks.read(spot).ok()?;
    let image = messages::image(spot.kind, &data).ok()?;
    Some(pixels::is_depth(&image))
}

/// A message and its place among those of its topic.
type SpotAt<'a> = (usize, &'a Spot);

/// Images as they were recorded, with their times of recording where they have any.
fn recorded(spots: &[Spot]) -> Vec<RecordedImage> {
    let of = |spot: &Spot| RecordedImage {
        stamp_nanos: spot.stamp_nanos,
        log_nanos: (spot.log_nanos > 0).then_some(spot.log_nanos),
        ordinal: spot.ordinal,
    };
    spots.iter().map(of).collect()
}

fn ordered(spots: &[Spot], timeline: &ImageOrder) -> Vec<Spot> {
    let spot = |(at, stamp): (&usize, &i64)| Some(Spot { stamp_nanos: *stamp, ..*spots.get(*at)? });
    timeline.order.iter().zip(&timeline.stamps_nanos).filter_map(spot).collect()
}

impl Source for RecordingSource {
    fn camera(&self) -> &Camera {
        &self.cameras.depth
    }

    fn n_frames(&self) -> Option<u64> {
        Some(self.depth.len() as u64)
    }

    fn stamp_nanos(&self, index: u64) -> Option<i64> {
        self.depth.get(usize::try_from(index).ok()?).map(|spot| spot.stamp_nanos)
    }

    fn read(&self, index: u64, buffers: &mut FrameBuffers<'_>) -> Result<FrameInfo, SourceError> {
        let Cameras { depth: camera, lens, .. } = &self.cameras;
        buffers.check(camera)?;
        let (depth, colour) = self.images(index)?;
        let size = (camera.width, camera.height);
        self.image(&self.topics.depth, depth, |image| {
            pixels::depth(image, size, camera.units_per_metre, buffers.depth)
        })?;
        if let Some(lens) = lens {
            lens.straighten(1, buffers.depth);
        }
        if let Some(rays) = &self.rays {
            rays.to_depth(buffers.depth);
        }
        match (colour, &self.topics.colour) {
            (Some(colour), Some(topic)) => self
                .image(topic, colour, |image| {
                    self.cameras.colour.read(image, size, lens.as_ref(), buffers.depth, buffers.colour)
                })
                .map_err(|error| SourceError::Colour(Box::new(error)))?,
            _ => buffers.colour.fill(0),
        }
        let ((at, spot), has_colour) = (depth, colour.is_some());
        let rotation = self.rotations.get(at).copied();
        let up = self.imu.up_at(spot.stamp_nanos);
        Ok(FrameInfo { stamp_nanos: spot.stamp_nanos, has_colour, rotation, up })
    }

    fn inspect(&self, index: u64) -> Result<(), SourceError> {
        let (depth, colour) = self.images(index)?;
        let size = (self.cameras.depth.width, self.cameras.depth.height);
        self.image(&self.topics.depth, depth, |image| pixels::inspect(image, "depth", Some(size)))?;
        match (colour, &self.topics.colour) {
            (Some(colour), Some(topic)) => self
                .image(topic, colour, |image| pixels::inspect(image, "colour", None))
                .map_err(|error| SourceError::Colour(Box::new(error))),
            _ => Ok(()),
        }
    }

    fn colour_as_taken(&self, index: u64) -> Result<Option<TakenColour>, SourceError> {
        match (self.images(index)?.1, &self.topics.colour) {
            (Some(colour), Some(topic)) => {
                self.image(topic, colour, |image| self.cameras.colour.as_taken(image))
            }
            _ => Ok(None),
        }
    }

    fn pairing(&self) -> Pairing {
        self.pairing
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }

    fn description(&self) -> Vec<(&'static str, String)> {
        let mut description = vec![
            ("layout", self.chunks.name().to_owned()),
            ("depth", self.topics.depth.clone()),
            ("colour", self.cameras.colour_words.clone()),
            ("camera", self.cameras.from.clone()),
        ];
        let imu = self.imu.words().map(|words| ("imu", format!("{words} of {}", self.topics.imu.join(", "))));
        description.extend(imu);
        description
    }
}

#[cfg(test)]
mod tests;
