//! Choice of the camera's topics: as given, or by type and name once they stay the same.

use crate::arguments::Ros2Arguments;
use crate::carrier::{CAMERA_INFO, COMPRESSED, Carrier, CarrierError, IMAGE, Quality, Seen, Subscription};
use crate::error::Ros2Error;
use crate::report::Report;
use std::time::{Duration, Instant};
use tessera_recording::{ImageType, RecordingError, choose_topics};

/// How long a choice must stay the same: topics are discovered one by one.
const SETTLE: Duration = Duration::from_secs(1);
/// Time between two lines that say what is missing.
const INTERVAL: Duration = Duration::from_secs(5);

/// Topics with their types.
#[derive(Clone, Debug, PartialEq, Eq)]
struct TopicChoice {
    depth: (String, ImageType),
    colour: Option<(String, ImageType)>,
    info: Option<String>,
    colour_info: Option<String>,
}

/// An image topic that is read.
pub(crate) struct ImageTopics {
    pub(crate) topic: String,
    pub(crate) kind: ImageType,
    pub(crate) messages: Box<dyn Subscription>,
}

/// The camera's topics as they are read.
pub(crate) struct CameraTopics {
    pub(crate) depth: ImageTopics,
    pub(crate) colour: Option<ImageTopics>,
    pub(crate) info: Option<Box<dyn Subscription>>,
    pub(crate) colour_info: Option<Box<dyn Subscription>>,
}

/// Waits for the topics.
pub(crate) struct Chooser {
    depth: Option<String>,
    colour: Option<String>,
    info: Option<String>,
    is_without_colour: bool,
    /// No CameraInfo is needed.
    has_camera: bool,
    quality: Quality,
    settling: Option<(TopicChoice, Instant)>,
    ambiguous_since: Option<Instant>,
    told_at: Option<Instant>,
    /// When the first line told that something is missing.
    waits_since: Option<Instant>,
}

impl Chooser {
    pub(crate) fn new(arguments: &Ros2Arguments) -> Self {
        Self {
            depth: arguments.depth_topic.clone(),
            colour: arguments.color_topic.clone(),
            info: arguments.camera_info.clone(),
            is_without_colour: arguments.no_color,
            has_camera: arguments.camera.is_some(),
            quality: Quality { is_reliable: arguments.reliable, ..Quality::SENSOR },
            settling: None,
            ambiguous_since: None,
            told_at: None,
            waits_since: None,
        }
    }

    /// Looks at what is there; the topics, once they are chosen.
    ///
    /// # Errors
    /// Where several would do, or a topic cannot be read.
    pub(crate) fn look(
        &mut self,
        carrier: &mut dyn Carrier,
        now: Instant,
        report: &Report,
    ) -> Result<Option<CameraTopics>, Ros2Error> {
        let seen = carrier.seen();
        let choice = match self.choose(&seen) {
            Ok(choice) => choice,
            Err(error @ RecordingError::SeveralTopics { .. }) => {
                self.settling = None;
                let since = *self.ambiguous_since.get_or_insert(now);
                if now.saturating_duration_since(since) >= SETTLE {
                    return Err(error.into());
                }
                return Ok(None);
            }
            Err(error) => {
                let since = *self.waits_since.get_or_insert(now);
                let alone = carrier.alone().filter(|_| now.saturating_duration_since(since) >= INTERVAL);
                let why = alone.unwrap_or_else(|| error.to_string());
                self.tell(now, report, &format!("waiting for the camera: {why}"));
                return Ok(None);
            }
        };
        self.ambiguous_since = None;
        if choice.info.is_none() && !self.has_camera {
            let depth = &choice.depth.0;
            let words = format!(
                "waiting for the CameraInfo of {depth}: none is there; --camera-info TOPIC or --camera FILE does without the search"
            );
            self.tell(now, report, &words);
            return Ok(None);
        }
        match &self.settling {
            Some((settling, since)) if *settling == choice => {
                if now.saturating_duration_since(*since) >= SETTLE {
                    return Ok(Some(subscribe(carrier, &choice, self.quality)?));
                }
            }
            _ => self.settling = Some((choice, now)),
        }
        Ok(None)
    }

    fn choose(&self, seen: &[Seen]) -> Result<TopicChoice, RecordingError> {
        let kind = |topic: &str| {
            let of = |name: &str| seen.iter().any(|seen| seen.topic == topic && seen.kind == name);
            // Both under one name is nothing that a driver does.
            if of(COMPRESSED.name) && !of(IMAGE.name) { ImageType::Compressed } else { ImageType::Raw }
        };
        let there_are = seen.iter().map(|seen| (seen.topic.as_str(), seen.kind.as_str()));
        let colour = if self.is_without_colour { None } else { self.colour.as_deref() };
        let there_are = there_are.filter(|(topic, _)| {
            // Without colour there is no choice to be made among its topics.
            !self.is_without_colour || topic.contains("depth") || Some(*topic) == self.depth.as_deref()
        });
        let chosen = choose_topics(there_are, self.depth.as_deref(), colour)?;
        let with_kind = |topic: String| (topic.clone(), kind(&topic));
        Ok(TopicChoice {
            depth: with_kind(chosen.depth),
            colour: chosen.colour.filter(|_| !self.is_without_colour).map(with_kind),
            info: self.info.clone().or(chosen.camera),
            colour_info: chosen.colour_camera,
        })
    }

    fn tell(&mut self, now: Instant, report: &Report, words: &str) {
        if self.told_at.is_none_or(|told| now.saturating_duration_since(told) >= INTERVAL) {
            self.told_at = Some(now);
            report.say(words);
        }
    }
}

fn subscribe(
    carrier: &mut dyn Carrier,
    choice: &TopicChoice,
    quality: Quality,
) -> Result<CameraTopics, CarrierError> {
    let mut images = |(topic, kind): &(String, ImageType)| -> Result<ImageTopics, CarrierError> {
        let ros = if *kind == ImageType::Raw { IMAGE } else { COMPRESSED };
        let messages = carrier.subscribe(topic, ros, quality)?;
        Ok(ImageTopics { topic: topic.clone(), kind: *kind, messages })
    };
    let depth = images(&choice.depth)?;
    let colour = choice.colour.as_ref().map(&mut images).transpose()?;
    let mut info = |topic: &Option<String>| {
        topic.as_ref().map(|topic| carrier.subscribe(topic, CAMERA_INFO, quality)).transpose()
    };
    Ok(CameraTopics { depth, colour, info: info(&choice.info)?, colour_info: info(&choice.colour_info)? })
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    fn chooser(words: &[&str]) -> Chooser {
        let words = ["tessera-ros2", "x"].iter().chain(words);
        Chooser::new(&Ros2Arguments::try_parse_from(words).unwrap())
    }

    fn seen(topics: &[(&str, &str)]) -> Vec<Seen> {
        topics.iter().map(|(topic, kind)| Seen { topic: (*topic).into(), kind: (*kind).into() }).collect()
    }

    #[test]
    fn topics_are_chosen_with_their_types() {
        let there_are = seen(&[
            ("/camera/color/image_raw/compressed", COMPRESSED.name),
            ("/camera/color/camera_info", CAMERA_INFO.name),
            ("/camera/depth/image_raw", IMAGE.name),
            ("/camera/depth/camera_info", CAMERA_INFO.name),
            ("/rosout", "rcl_interfaces/msg/Log"),
        ]);
        let choice = chooser(&[]).choose(&there_are).unwrap();
        assert_eq!(choice.depth, ("/camera/depth/image_raw".to_owned(), ImageType::Raw));
        let colour = ("/camera/color/image_raw/compressed".to_owned(), ImageType::Compressed);
        assert_eq!(choice.colour, Some(colour));
        assert_eq!(choice.info.as_deref(), Some("/camera/depth/camera_info"));
        assert_eq!(choice.colour_info.as_deref(), Some("/camera/color/camera_info"));
        let without = chooser(&["--no-color", "--camera-info", "/other"]).choose(&there_are).unwrap();
        assert_eq!((without.colour, without.info.as_deref()), (None, Some("/other")));
    }

    #[test]
    fn several_depth_topics_need_a_word() {
        let there_are = seen(&[("/a/depth", IMAGE.name), ("/b/depth", IMAGE.name)]);
        let words = chooser(&[]).choose(&there_are).unwrap_err().to_string();
        assert!(words.contains("give --depth-topic TOPIC"), "{words}");
        let given = chooser(&["--depth-topic", "/b/depth"]).choose(&there_are).unwrap();
        assert_eq!(given.depth.0, "/b/depth");
    }

    /// Names as docs/ros2_launch.md has them of drivers.
    #[test]
    fn topics_of_drivers_are_found_or_asked_for() {
        let images = |names: &[&str]| {
            let topics = names.iter().map(|name| {
                let info = name.rsplit_once('/').map(|(front, _)| format!("{front}/camera_info")).unwrap();
                [((*name).to_owned(), IMAGE.name), (info, CAMERA_INFO.name)]
            });
            let topics: Vec<(String, &str)> = topics.flatten().collect();
            let topics: Vec<(&str, &str)> =
                topics.iter().map(|(name, kind)| (name.as_str(), *kind)).collect();
            seen(&topics)
        };
        let found = |words: &[&str], there_are: &[&str]| {
            let choice = chooser(words).choose(&images(there_are)).map_err(|error| error.to_string())?;
            Ok::<_, String>((choice.depth.0, choice.colour.map(|(topic, _)| topic), choice.info))
        };
        let all = |depth: &str, colour: &str, info: &str| {
            Ok((depth.to_owned(), Some(colour.to_owned()), Some(info.to_owned())))
        };
        let front = "/camera/camera";
        let realsense = ["aligned_depth_to_color/image_raw", "color/image_raw", "depth/image_rect_raw"];
        let realsense = realsense.map(|name| format!("{front}/{name}"));
        let realsense: Vec<&str> = realsense.iter().map(String::as_str).collect();
        let aligned = "/camera/camera/aligned_depth_to_color";
        assert_eq!(
            found(&[], &realsense),
            all(realsense[0], realsense[1], &format!("{aligned}/camera_info"))
        );
        let azure =
            ["/depth/image_raw", "/depth_to_rgb/image_raw", "/rgb/image_raw", "/rgb_to_depth/image_raw"];
        assert!(found(&[], &azure).unwrap_err().contains("give --depth-topic"));
        let given = ["--depth-topic", azure[1], "--color-topic", azure[2]];
        assert_eq!(found(&given, &azure), all(azure[1], azure[2], "/depth_to_rgb/camera_info"));
        let orbbec = ["/camera/color/image_raw", "/camera/depth/image_raw", "/camera/ir/image_raw"];
        assert_eq!(found(&[], &orbbec), all(orbbec[1], orbbec[0], "/camera/depth/camera_info"));
        let oak = ["/oak/rgb/image_raw", "/oak/stereo/image_raw"];
        assert!(found(&[], &oak).unwrap_err().contains("no depth topic"));
        let given = ["--depth-topic", oak[1], "--color-topic", oak[0]];
        assert_eq!(found(&given, &oak), all(oak[1], oak[0], "/oak/stereo/camera_info"));
    }
}
