//! The first messages of the camera's topics, by which all others are read.

use crate::camera::topics::{CameraTopics, ImageTopics};
use crate::carrier::Subscription;
use crate::error::Ros2Error;
use crate::report::take;
use crate::report::{Report, ReportEvent};
use crate::run::JoinedRun;
use std::time::{Duration, Instant};
use tessera_frames::CameraFile;
use tessera_geometry::Camera;
use tessera_recording::{Change, FrameTree, LiveCamera, LiveImage, LiveTopic, RecordingError};

/// How long the first depth image waits for colour, CameraInfo and `/tf_static` where one is missing.
const PATIENCE: Duration = Duration::from_secs(1);

/// The newest message of each topic while the camera is not known; images are readable ones.
#[derive(Default)]
pub(crate) struct FirstMessages {
    began_at: Option<Instant>,
    depth: Option<Vec<u8>>,
    info: Option<Vec<u8>>,
    colour: Option<Vec<u8>>,
    colour_info: Option<Vec<u8>>,
}

impl FirstMessages {
    /// Keeps the newest messages; answers how many depth images came.
    pub(crate) fn take(&mut self, topics: &mut CameraTopics, now: Instant, report: &mut Report) -> u64 {
        let n_depth = newest_image(&mut topics.depth, &mut self.depth, report);
        if n_depth > 0 {
            self.began_at.get_or_insert(now);
        }
        if let Some(colour) = &mut topics.colour {
            newest_image(colour, &mut self.colour, report);
        }
        if let Some(infos) = &mut topics.info {
            newest(&mut **infos, &mut self.info, report);
        }
        if let Some(infos) = &mut topics.colour_info {
            newest(&mut **infos, &mut self.colour_info, report);
        }
        n_depth
    }

    /// The camera, once all that is needed has come. To be asked after each depth image.
    ///
    /// # Errors
    /// Where the camera is one that cannot be used.
    pub(crate) fn begin(
        &self,
        topics: &CameraTopics,
        (frames, base): (&FrameTree, &str),
        given: Option<&CameraFile>,
        run: &JoinedRun,
        report: &mut Report,
    ) -> Result<Option<LiveCamera>, Ros2Error> {
        let (Some(data), Some(began_at)) = (&self.depth, self.began_at) else { return Ok(None) };
        let (topic, is_late) = (&topics.depth.topic, began_at.elapsed() >= PATIENCE);
        if !is_late && !self.is_whole(topics, given) {
            return Ok(None);
        }
        if self.info.is_none() && given.is_none() {
            report.note(ReportEvent::NoCamera, || format!("{topic}: images come, and no CameraInfo"));
            return Ok(None);
        }
        let image = LiveImage::read(topics.depth.kind, data)?;
        let depth = LiveTopic { topic, image: &image, info: self.info.as_deref() };
        let colour = topics.colour.as_ref().zip(self.colour.as_ref());
        let colour =
            colour.and_then(|(images, data)| Some((images, LiveImage::read(images.kind, data).ok()?)));
        let colour = colour.as_ref().map(|(images, image)| LiveTopic {
            topic: &images.topic,
            image,
            info: self.colour_info.as_deref(),
        });
        let mut camera = match LiveCamera::new(&depth, colour.as_ref(), frames, given) {
            Ok(camera) => camera,
            // The next CameraInfo may be one.
            Err(RecordingError::Message { problem, .. }) => {
                report.note(ReportEvent::Malformed, || format!("CameraInfo of {topic}: {problem}"));
                return Ok(None);
            }
            Err(error) => return Err(error.into()),
        };
        let is_placed = camera.frame() == base || frames.between(camera.frame(), base).is_some();
        if !(is_late || is_placed) || !is_of_run(&mut camera, run, topic, report) {
            return Ok(None);
        }
        let (width, height) = (camera.camera().width, camera.camera().height);
        report.say(&format!("camera {width}x{height} px, colour: {}", camera.colour_words()));
        if let Some(warning) = camera.warning() {
            report.say(warning);
        }
        Ok(Some(camera))
    }
}

impl FirstMessages {
    /// Whether each topic has had a message.
    fn is_whole(&self, topics: &CameraTopics, given: Option<&CameraFile>) -> bool {
        let has = |is_read: bool, message: &Option<Vec<u8>>| !is_read || message.is_some();
        (self.info.is_some() || given.is_some())
            && has(topics.colour.is_some(), &self.colour)
            && has(topics.colour_info.is_some(), &self.colour_info)
    }
}

/// Whether the camera is that of the run, whose first images may have come from a program before this one;
/// where it differs as autofocus makes it differ, it takes the run's numbers.
fn is_of_run(camera: &mut LiveCamera, run: &JoinedRun, topic: &str, report: &mut Report) -> bool {
    let first = match run.camera() {
        Ok(Some(first)) => first,
        Ok(None) => return true,
        Err(error) => {
            report.note(ReportEvent::Map, || error.to_string());
            return true;
        }
    };
    let found = camera.camera().clone();
    match camera.keep(&first) {
        Change::None => {}
        Change::Small(_) => report.note(ReportEvent::CameraChanged, || small_change(topic, &first, &found)),
        Change::Large(_) => {
            report.note(ReportEvent::CameraChanged, || large_change(topic, &first, &found));
            return false;
        }
    }
    true
}

/// What is said of a CameraInfo a little other than the run's first one.
pub(crate) fn small_change(topic: &str, first: &Camera, found: &Camera) -> String {
    let (fx, now) = (first.fx, found.fx);
    format!("{topic}: the CameraInfo changed a little, fx {fx} to {now}: the run keeps the first")
}

/// What is said of one of another camera.
pub(crate) fn large_change(topic: &str, first: &Camera, found: &Camera) -> String {
    format!(
        "{topic}: the CameraInfo is {}x{} px, fx {}, expected {}x{} px, fx {} as the run began with: images are left out until it is back; another camera needs another run",
        found.width, found.height, found.fx, first.width, first.height, first.fx
    )
}

/// Keeps the newest message.
fn newest(from: &mut dyn Subscription, to: &mut Option<Vec<u8>>, report: &mut Report) {
    while let Some(message) = take(from, report) {
        *to = Some(message);
    }
}

/// Keeps the newest image that can be read; answers how many messages came.
fn newest_image(images: &mut ImageTopics, to: &mut Option<Vec<u8>>, report: &mut Report) -> u64 {
    let mut n = 0;
    while let Some(message) = take(&mut *images.messages, report) {
        n = u64::saturating_add(n, 1);
        match LiveImage::read(images.kind, &message) {
            Ok(_) => *to = Some(message),
            Err(error) => report.note(ReportEvent::Malformed, || format!("{}: {error}", images.topic)),
        }
    }
    n
}
