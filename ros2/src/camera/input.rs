//! Images from the network into the run: topics and camera are found first, then each image goes its way.

use crate::arguments::Ros2Arguments;
use crate::camera::first::FirstMessages;
use crate::camera::going::Going;
use crate::camera::pairing::Stamped;
use crate::camera::sender::Sender;
use crate::camera::topics::{CameraTopics, Chooser};
use crate::carrier::{Carrier, IMU, Quality, Subscription, TRANSFORMS};
use crate::error::Ros2Error;
use crate::poses::base::Base;
use crate::report::{Report, ReportEvent, take};
use crate::run::JoinedRun;
use crate::run::clock::ImageClock;
use std::collections::VecDeque;
use std::time::{Duration, Instant};
use tessera_frames::CameraFile;
use tessera_recording::FrameTree;

/// Time between two looks for topics.
const LOOK: Duration = Duration::from_millis(200);

/// Messages of an IMU that are kept before the camera is known: four seconds at 400 Hz.
const MOST_EARLY: usize = 1600;

/// The network's side of the camera.
pub(crate) struct CameraInput {
    chooser: Chooser,
    looked_at: Option<Instant>,
    given: Option<CameraFile>,
    base_frame: String,
    tf_static: Box<dyn Subscription>,
    imu: Option<Box<dyn Subscription>>,
    /// Messages of the IMU from before the camera was known.
    early_imu: VecDeque<Vec<u8>>,
    frames: FrameTree,
    topics: Option<CameraTopics>,
    first: FirstMessages,
    going: Option<Going>,
    pub(crate) clock: ImageClock,
    /// Depth images that came.
    pub(crate) n_depth: u64,
}

impl CameraInput {
    /// Listens; the camera's topics are looked for in [`Self::step`].
    ///
    /// # Errors
    /// Where the network refuses, or the camera file cannot be used.
    pub(crate) fn new(arguments: &Ros2Arguments, carrier: &mut dyn Carrier) -> Result<Self, Ros2Error> {
        Ok(Self {
            chooser: Chooser::new(arguments),
            looked_at: None,
            given: arguments
                .camera
                .as_deref()
                .map(|name| CameraFile::named(name)?.as_it_is(name))
                .transpose()?,
            base_frame: arguments.base_frame.clone(),
            tf_static: carrier.subscribe("/tf_static", TRANSFORMS, Quality::STATIC)?,
            imu: arguments
                .imu_topic
                .as_ref()
                .map(|topic| carrier.subscribe(topic, IMU, Quality { depth: 200, ..Quality::SENSOR }))
                .transpose()?,
            early_imu: VecDeque::new(),
            frames: FrameTree::default(),
            topics: None,
            first: FirstMessages::default(),
            going: None,
            clock: ImageClock::default(),
            n_depth: 0,
        })
    }

    /// Where the base of the robot is from the camera, once that is decided.
    pub(crate) fn base(&self) -> Option<&Base> {
        self.going.as_ref().map(|going| &going.base)
    }

    /// What sends images, once the camera is known.
    pub(crate) fn sender(&mut self) -> Option<&mut Sender> {
        self.going.as_mut().map(|going| &mut going.sender)
    }

    /// Another run begins: its camera is the one that is there now, and its time begins anew.
    pub(crate) fn begin_run(&mut self) {
        (self.first, self.going) = (FirstMessages::default(), None);
        (self.clock, self.n_depth) = (ImageClock::default(), 0);
    }

    /// Leaves out what came: there is no run.
    pub(crate) fn leave_out(&mut self, report: &mut Report) {
        let Some(topics) = &mut self.topics else { return };
        let colour = topics.colour.as_mut().map(|colour| &mut colour.messages);
        let infos = topics.info.as_mut().into_iter().chain(&mut topics.colour_info);
        let all = [&mut topics.depth.messages].into_iter().chain(colour).chain(infos).chain(&mut self.imu);
        for messages in all {
            while take(&mut **messages, report).is_some() {}
        }
    }

    /// Takes messages of the IMU; until the camera is known they wait.
    fn take_imu(&mut self, report: &mut Report) {
        while let Some(message) = self.imu.as_mut().and_then(|imu| take(&mut **imu, report)) {
            match &mut self.going {
                Some(going) => going.take_imu(&message, &self.frames, report),
                None => {
                    if self.early_imu.len() == MOST_EARLY {
                        self.early_imu.pop_front();
                    }
                    self.early_imu.push_back(message);
                }
            }
        }
    }

    /// Takes what came, and sends what can be sent; `now_nanos` is the time by which images wait.
    ///
    /// # Errors
    /// Where topics cannot be chosen, the camera cannot be used, or the run's memory is broken.
    pub(crate) fn step(
        &mut self,
        carrier: &mut dyn Carrier,
        run: &JoinedRun,
        now_nanos: i64,
        report: &mut Report,
    ) -> Result<(), Ros2Error> {
        let now = Instant::now();
        while let Some(message) = take(&mut *self.tf_static, report) {
            if let Err(error) = self.frames.add(&message) {
                report.note(ReportEvent::Malformed, || format!("/tf_static: {error}"));
            }
        }
        if self.topics.is_none() {
            if self.looked_at.is_some_and(|looked| now.saturating_duration_since(looked) < LOOK) {
                return Ok(());
            }
            self.looked_at = Some(now);
            self.topics = self.chooser.look(carrier, now, report)?;
            if let Some(topics) = &self.topics {
                report.say(&words_of(topics));
            }
        }
        self.take_imu(report);
        let Some(topics) = &mut self.topics else { return Ok(()) };
        match &mut self.going {
            None => {
                let n_depth = self.first.take(topics, now, report);
                self.n_depth = self.n_depth.saturating_add(n_depth);
                if n_depth == 0 {
                    return Ok(());
                }
                let frames = (&self.frames, self.base_frame.as_str());
                let camera = self.first.begin(topics, frames, self.given.as_ref(), run, report)?;
                self.going = camera.map(|camera| {
                    let base = Base::find(&self.frames, camera.frame(), &self.base_frame);
                    report.say(&base.words);
                    report.say(&format!(
                        "the camera is known: {} depth images that came before are not in the run",
                        self.n_depth
                    ));
                    let mut going = Going::new(camera, base, self.imu.is_some());
                    for message in self.early_imu.drain(..) {
                        going.take_imu(&message, &self.frames, report);
                    }
                    going
                });
                if self.going.is_some() {
                    report.add(ReportEvent::Before, self.n_depth);
                }
            }
            Some(going) => {
                going.take_infos(topics, report);
                going.take_colours(topics, report);
                while let Some(message) = take(&mut *topics.depth.messages, report) {
                    let index = self.n_depth;
                    self.n_depth = index.saturating_add(1);
                    let depth = Stamped { stamp_nanos: 0, index, message };
                    going.take_depth(&topics.depth, depth, now_nanos, report);
                }
                going.send(topics, &run.guest, (&mut self.clock, now_nanos), report)?;
            }
        }
        Ok(())
    }
}

fn words_of(topics: &CameraTopics) -> String {
    let colour = topics.colour.as_ref().map_or("none", |colour| &colour.topic);
    format!("depth {}, colour {colour}", topics.depth.topic)
}
