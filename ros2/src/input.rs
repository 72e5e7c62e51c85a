//! Images from the network into the run: the camera is known first, then each image is paired,
//! decoded in place and sent. What cannot be used is told, counted and left out.

use crate::arguments::Arguments;
use crate::base::Base;
use crate::carrier::{Carrier, Quality, Subscription, TRANSFORMS};
use crate::clock::{Clock, Tick};
use crate::error::Ros2Error;
use crate::first::First;
use crate::pairing::{Pairing, Stamped};
use crate::report::{Event, Report};
use crate::sender::{Image, Outcome, Sender};
use crate::topics::{Chooser, Images, Topics};
use std::time::{Duration, Instant};
use tessera_frames::named_camera;
use tessera_geometry::Camera;
use tessera_recording::{Change, FrameTree, LiveCamera, LiveImage};
use tessera_transport::Guest;

/// Time between two looks for topics.
const LOOK: Duration = Duration::from_millis(200);
/// Bytes of a message up to the end of its time.
const STAMP_BYTES: usize = 12;

/// The network's side of the camera.
pub(crate) struct Input {
    chooser: Chooser,
    looked_at: Option<Instant>,
    given: Option<Camera>,
    base_frame: String,
    tf_static: Box<dyn Subscription>,
    frames: FrameTree,
    topics: Option<Topics>,
    first: First,
    going: Option<Going>,
    pub(crate) clock: Clock,
    /// Depth images that came.
    pub(crate) n_depth: u64,
    pub(crate) last_depth_at: Option<Instant>,
}

/// What is needed for each image, once the camera is known.
struct Going {
    camera: LiveCamera,
    base: Base,
    sender: Sender,
    pairing: Pairing,
    /// Of the newest CameraInfo, what follows its time.
    info: Vec<u8>,
    is_other_camera: bool,
    n_colour: u64,
}

impl Input {
    /// Listens; the camera's topics are looked for in [`Self::step`].
    ///
    /// # Errors
    /// Where the network refuses, or the camera file cannot be used.
    pub(crate) fn new(arguments: &Arguments, carrier: &mut dyn Carrier) -> Result<Self, Ros2Error> {
        Ok(Self {
            chooser: Chooser::new(arguments),
            looked_at: None,
            given: arguments.camera.as_deref().map(named_camera).transpose()?,
            base_frame: arguments.base_frame.clone(),
            tf_static: carrier.subscribe("/tf_static", TRANSFORMS, Quality::STATIC)?,
            frames: FrameTree::default(),
            topics: None,
            first: First::default(),
            going: None,
            clock: Clock::default(),
            n_depth: 0,
            last_depth_at: None,
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

    /// Takes what came, and sends what can be sent.
    ///
    /// # Errors
    /// Where topics cannot be chosen, the camera cannot be used, or the run's memory is broken.
    pub(crate) fn step(
        &mut self,
        carrier: &mut dyn Carrier,
        guest: &Guest,
        report: &mut Report,
    ) -> Result<(), Ros2Error> {
        let now = Instant::now();
        while let Some(message) = take(&mut *self.tf_static, report) {
            if let Err(error) = self.frames.add(&message) {
                report.note(Event::Malformed, || format!("/tf_static: {error}"));
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
        let Some(topics) = &mut self.topics else { return Ok(()) };
        match &mut self.going {
            None => {
                let n_depth = self.first.take(topics, now, report);
                self.n_depth += n_depth;
                if n_depth == 0 {
                    return Ok(());
                }
                self.going =
                    self.first.begin(topics, &self.frames, self.given.as_ref(), now, report)?.map(|camera| {
                        let base = Base::find(&self.frames, camera.frame(), &self.base_frame);
                        report.say(&base.words);
                        Going::new(camera, base)
                    });
            }
            Some(going) => {
                going.take_infos(topics, report);
                going.take_colours(topics, report);
                while let Some(message) = take(&mut *topics.depth.messages, report) {
                    let index = self.n_depth;
                    self.n_depth += 1;
                    self.last_depth_at = Some(now);
                    going.take_depth(&topics.depth, Stamped { stamp_nanos: 0, index, message }, now, report);
                }
                going.send(topics, guest, &mut self.clock, report)?;
            }
        }
        Ok(())
    }
}

/// The next message; an error of the network is told and counted.
pub(crate) fn take(from: &mut dyn Subscription, report: &mut Report) -> Option<Vec<u8>> {
    match from.take() {
        Ok(message) => message,
        Err(error) => {
            report.note(Event::Carrier, || error.to_string());
            None
        }
    }
}

fn words_of(topics: &Topics) -> String {
    let colour = topics.colour.as_ref().map_or("none", |colour| &colour.topic);
    format!("depth {}, colour {colour}", topics.depth.topic)
}

impl Going {
    fn new(camera: LiveCamera, base: Base) -> Self {
        let sender = Sender::new(camera.camera());
        Self {
            sender,
            base,
            pairing: Pairing::default(),
            info: Vec::new(),
            is_other_camera: false,
            n_colour: 0,
            camera,
        }
    }

    /// Compares each CameraInfo with the first one.
    fn take_infos(&mut self, topics: &mut Topics, report: &mut Report) {
        if let Some(infos) = &mut topics.colour_info {
            // Only the first one counts.
            while take(&mut **infos, report).is_some() {}
        }
        let Some(infos) = &mut topics.info else { return };
        while let Some(message) = take(&mut **infos, report) {
            let rest = message.get(STAMP_BYTES..).unwrap_or_default();
            if rest == self.info {
                continue;
            }
            self.info = rest.to_owned();
            let (topic, first) = (&topics.depth.topic, self.camera.camera());
            match self.camera.compare(&message) {
                Ok(Change::None) => self.is_other_camera = false,
                Ok(Change::Small(found)) => {
                    self.is_other_camera = false;
                    report.note(Event::CameraChanged, || {
                        format!(
                            "{topic}: the CameraInfo changed a little, fx {} to {}: the run keeps the first",
                            first.fx, found.fx
                        )
                    });
                }
                Ok(Change::Large(found)) => {
                    self.is_other_camera = true;
                    report.note(Event::CameraChanged, || {
                        format!(
                            "{topic}: the CameraInfo is {}x{} px, fx {}, expected {}x{} px, fx {} as the run began with: images are left out until it is back; another camera needs another run",
                            found.width, found.height, found.fx, first.width, first.height, first.fx
                        )
                    });
                }
                Err(error) => report.note(Event::Malformed, || format!("CameraInfo of {topic}: {error}")),
            }
        }
    }

    fn take_colours(&mut self, topics: &mut Topics, report: &mut Report) {
        let Some(colour) = &mut topics.colour else { return };
        while let Some(message) = take(&mut *colour.messages, report) {
            self.n_colour += 1;
            let read = LiveImage::read(colour.kind, &message).map(|image| image.stamp_nanos());
            match read {
                Ok(stamp_nanos) if self.camera.uses_colour() => {
                    self.pairing.add_colour(Stamped { stamp_nanos, index: self.n_colour, message });
                }
                Ok(_) => {}
                Err(error) => report.note(Event::Malformed, || format!("{}: {error}", colour.topic)),
            }
        }
    }

    fn take_depth(&mut self, images: &Images, mut depth: Stamped, now: Instant, report: &mut Report) {
        if self.is_other_camera {
            return report.count(Event::OtherCamera);
        }
        let read = LiveImage::read(images.kind, &depth.message).map(|image| image.stamp_nanos());
        match read {
            Ok(stamp_nanos) => {
                depth.stamp_nanos = stamp_nanos;
                self.pairing.add_depth(depth, now);
            }
            Err(error) => report.note(Event::Malformed, || format!("{}: {error}", images.topic)),
        }
    }

    /// Sends all images whose colour is known.
    fn send(
        &mut self,
        topics: &Topics,
        guest: &Guest,
        clock: &mut Clock,
        report: &mut Report,
    ) -> Result<(), Ros2Error> {
        let (name, has_colour) = (&topics.depth.topic, self.camera.uses_colour());
        while let Some((depth, colour)) = self.pairing.next(has_colour, Instant::now()) {
            let stamp_nanos = match clock.tick(depth.stamp_nanos) {
                Tick::At(stamp_nanos) => stamp_nanos,
                Tick::Jumped(back, stamp_nanos) => {
                    report.note(Event::ClockJump, || {
                        format!(
                            "{name}: the clock jumped back by {:.3} s; the run's time goes on",
                            back as f64 * 1e-9
                        )
                    });
                    stamp_nanos
                }
                Tick::Late => {
                    let at = depth.stamp_nanos;
                    report.note(Event::OutOfOrder, || {
                        format!("{name}: time {at} ns is not after that of the image before it: left out")
                    });
                    continue;
                }
            };
            if has_colour && colour.is_none() {
                report.count(Event::WithoutColour);
            }
            self.send_one(topics, guest, (&depth, colour.as_ref()), stamp_nanos, report)?;
        }
        Ok(())
    }

    fn send_one(
        &mut self,
        topics: &Topics,
        guest: &Guest,
        (depth, colour): (&Stamped, Option<&Stamped>),
        stamp_nanos: i64,
        report: &mut Report,
    ) -> Result<(), Ros2Error> {
        let camera = &self.camera;
        let colour = topics.colour.as_ref().zip(colour);
        let mut wrong_colour = None;
        let decode = |raw: &mut [u16], rgb: Option<&mut [u8]>| {
            let image = LiveImage::read(topics.depth.kind, &depth.message).map_err(|e| e.to_string())?;
            camera.read_depth(&image, raw).map_err(|e| e.to_string())?;
            if let (Some(rgb), Some((images, colour))) = (rgb, colour) {
                let read = LiveImage::read(images.kind, &colour.message)
                    .and_then(|image| camera.read_colour(&image, raw, rgb));
                if let Err(error) = read {
                    rgb.fill(0);
                    wrong_colour = Some(format!("{}: {error}", images.topic));
                }
            }
            Ok(())
        };
        let image = Image {
            index: depth.index,
            stamp_nanos,
            has_colour: colour.is_some(),
            received_at: Instant::now(),
        };
        let sent = self.sender.send(guest, &image, decode)?;
        if let Some(words) = wrong_colour {
            report.note(Event::Unusable, || words);
        }
        match sent {
            Outcome::Sent => {}
            Outcome::NotWanted => report.count(Event::NotSent),
            Outcome::Refused(why) => {
                report.note(Event::Unusable, || format!("{}: {why}", topics.depth.topic));
            }
        }
        Ok(())
    }
}
