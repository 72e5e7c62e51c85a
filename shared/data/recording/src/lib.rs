//! A recording in an MCAP file: messages of ROS 2 or of Foxglove's schemas.
//!
//! Opening looks for the times of the images: of chunks that are not compressed it reads the heads
//! of their messages, other chunks run through their decompression, several at once, and none is in
//! memory. After that a frame costs the reading of the chunks that it stands in. The file is read
//! and never mapped: one that shrinks meanwhile is an error, not a signal.
#![forbid(unsafe_code)]

mod camera;
mod chunks;
mod compression;
mod content;
mod error;
mod file;
mod foxglove;
mod messages;
mod pixels;
mod rational;
pub mod ros;
mod rvl;
mod topics;

use chunks::{Chunks, Found, Spot};
pub use error::{MessageError, RecordingError};
use file::{Channels, McapFile};
use mcap::records::op;
pub use rational::LensFit;
use std::path::{Path, PathBuf};
use tessera_evaluation::Trajectory;
use tessera_frames::SourceError;
use tessera_frames::cameras::named_camera;
use tessera_frames::pairing::{pair, summarise};
use tessera_frames::{FrameBuffers, FrameInfo, Pairing, Source};
use tessera_geometry::Camera;
use topics::Topics;

/// Units of depth that comes in metres, where no camera says otherwise: 0.2 mm, up to 13.1 m.
const UNITS_OF_METRES: f64 = 5000.0;

/// What to take from a recording; what is absent is chosen by name, and the camera read from it.
#[derive(Clone, Copy, Debug, Default)]
pub struct RecordingOptions<'a> {
    /// A built-in camera or a camera file.
    pub camera: Option<&'a str>,
    /// Topic of depth.
    pub depth_topic: Option<&'a str>,
    /// Topic of colour.
    pub color_topic: Option<&'a str>,
}

/// Frames of an MCAP file, in the order of the times of depth.
pub struct RecordingSource {
    path: PathBuf,
    camera: Camera,
    chunks: Chunks,
    topics: Topics,
    depth: Vec<Spot>,
    /// All colour images, and for each depth image the place of its own.
    colour: Vec<Spot>,
    partners: Vec<Option<usize>>,
    pairing: Pairing,
    warnings: Vec<String>,
}

impl RecordingSource {
    /// Opens a recording: finds its topics, its camera and the times of all images.
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
        let wrong = |source: RecordingError| SourceError::Recording {
            path: path.to_owned(),
            source: Box::new(source),
        };
        let given = options.camera.map(named_camera).transpose()?;
        let file = McapFile::open(path).map_err(wrong)?;
        let mut warnings: Vec<String> =
            file.cut.iter().map(|cut| format!("{cut}: read up to its last whole record")).collect();
        let (channels, damage) = channels(&file);
        let (depth_topic, colour_topic) = (options.depth_topic, options.color_topic);
        let topics = topics::choose(&channels, depth_topic, colour_topic)
            // Where something is damaged, what is missing may be in there.
            .map_err(|missing| wrong(damage.unwrap_or(missing)))?;
        let mut found = chunks::find(&file, &channels, &topics).map_err(wrong)?;
        if let Some(torn) = found.torn.take() {
            warnings.push(format!("{torn}: read up to there"));
        }
        let Found { mut depth, mut colour, camera: camera_at, .. } = found;
        for (spots, topic) in [(&mut depth, Some(&topics.depth)), (&mut colour, topics.colour.as_ref())] {
            let n_repeated = in_order(spots);
            if let Some(topic) = topic.filter(|_| n_repeated > 0) {
                warnings.push(format!("{topic}: {n_repeated} messages repeat a time and are left out"));
            }
        }
        if depth.is_empty() {
            return Err(wrong(RecordingError::Empty { topic: topics.depth.clone() }));
        }
        let times = |spots: &[Spot]| spots.iter().map(|spot| spot.stamp_nanos).collect::<Vec<i64>>();
        let (mut depth_times, colour_times) = (times(&depth), times(&colour));
        let mut partners = pair(&depth_times, &colour_times);
        if let Some(frames) = frames {
            let kept = usize::try_from(frames).unwrap_or(usize::MAX).min(depth.len());
            depth.truncate(kept);
            depth_times.truncate(kept);
            partners.truncate(kept);
        }
        let pairing = summarise(&depth_times, &colour_times, &partners);
        let chunks = Chunks::new(file);
        let camera = match given {
            Some(camera) => camera,
            None => camera::read(&chunks, &topics, camera_at.as_ref(), &depth[0]).map_err(wrong)?,
        };
        let path = path.to_owned();
        Ok(Self { path, camera, chunks, topics, depth, colour, partners, pairing, warnings })
    }

    /// Reads one image, and puts it where it belongs by `decode`.
    fn image(
        &self,
        topic: &str,
        at: usize,
        spot: &Spot,
        decode: impl FnOnce(&messages::ImageMessage<'_>) -> Result<(), MessageError>,
    ) -> Result<(), SourceError> {
        let wrong = |source| SourceError::Recording { path: self.path.clone(), source: Box::new(source) };
        let data = self.chunks.read(spot).map_err(wrong)?;
        messages::image(spot.kind, &data).and_then(|image| decode(&image)).map_err(|problem| {
            wrong(RecordingError::Message { topic: topic.to_owned(), number: at + 1, problem })
        })
    }
}

/// Sorts by time and leaves out what repeats one; answers how many.
fn in_order(spots: &mut Vec<Spot>) -> usize {
    let n = spots.len();
    spots.sort_by_key(|spot| spot.stamp_nanos);
    spots.dedup_by_key(|spot| spot.stamp_nanos);
    n - spots.len()
}

/// All channels: from the summary, or from the whole file where it was cut or has none, then up to
/// what is damaged.
fn channels(file: &McapFile) -> (Channels, Option<RecordingError>) {
    let mut channels = Channels::default();
    let from_summary = file.cut.is_none() && file.summary.iter().any(|place| place.opcode == op::CHANNEL);
    let places = if from_summary { &file.summary } else { &file.data };
    let most = |opcode| if opcode == op::MESSAGE { 0 } else { u64::MAX };
    for place in places {
        let read = file.records(place, most, |opcode, body| {
            channels.take(opcode, body).map_err(|reason| place.damaged(reason))
        });
        if read.is_err() {
            return (channels, read.err());
        }
    }
    (channels, None)
}

impl Source for RecordingSource {
    fn camera(&self) -> &Camera {
        &self.camera
    }

    fn n_frames(&self) -> Option<u64> {
        Some(self.depth.len() as u64)
    }

    fn stamp_nanos(&self, index: u64) -> Option<i64> {
        self.depth.get(usize::try_from(index).ok()?).map(|spot| spot.stamp_nanos)
    }

    fn read(&self, index: u64, buffers: &mut FrameBuffers<'_>) -> Result<FrameInfo, SourceError> {
        buffers.check(&self.camera)?;
        let at = usize::try_from(index).ok().filter(|at| *at < self.depth.len());
        let at = at.ok_or(SourceError::NoFrame { frame: index, last: self.depth.len() as u64 - 1 })?;
        let size = (self.camera.width, self.camera.height);
        let spot = &self.depth[at];
        let units = self.camera.units_per_metre;
        self.image(&self.topics.depth, at, spot, |image| pixels::depth(image, size, units, buffers.depth))?;
        let partner = self.partners[at];
        match (partner, &self.topics.colour) {
            (Some(of), Some(topic)) => {
                let spot = &self.colour[of];
                self.image(topic, of, spot, |image| pixels::colour(image, size, buffers.colour))?;
            }
            _ => buffers.colour.fill(0),
        }
        Ok(FrameInfo { stamp_nanos: spot.stamp_nanos, has_colour: partner.is_some(), rotation: None })
    }

    fn ground_truth(&self) -> Option<&Trajectory> {
        None
    }

    fn pairing(&self) -> Pairing {
        self.pairing
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }
}

#[cfg(test)]
mod tests;
