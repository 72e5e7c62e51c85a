//! Choice of the topics of depth, colour and camera: by type and name, or as given.

use crate::container::{Channel, Channels};
use crate::error::RecordingError;
use crate::librealsense;
use crate::messages::MessageKind;
use std::collections::BTreeMap;

/// The options that name topics.
const DEPTH_OPTION: &str = "--depth-topic TOPIC";
const COLOUR_OPTION: &str = "--color-topic TOPIC";
/// What `image_transport` puts behind the name of a topic.
const COMPRESSED_DEPTH: &str = "/compressedDepth";
const TRANSPORTS: [&str; 5] = [COMPRESSED_DEPTH, "/compressed", "/theora", "/zstd", "/ffmpeg"];

/// The channels that matter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Topics {
    pub(super) depth: String,
    /// `None`: the recording has no colour.
    pub(super) colour: Option<String>,
    pub(super) camera: Option<String>,
    /// That of the colour images, where it is another one.
    pub(super) colour_camera: Option<String>,
    /// Where the colour camera stands, as a RealSense says it.
    pub(super) extrinsics: Option<String>,
    /// The gyroscope and the accelerometer of the camera, which may have a topic each.
    pub(super) imu: Vec<String>,
    /// Units of depth, as librealsense's recorder says them.
    pub(super) units: Option<String>,
}

/// Topics of a network, chosen as those of a recording are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChosenTopics {
    /// Depth.
    pub depth: String,
    /// Colour, where there is any.
    pub colour: Option<String>,
    /// CameraInfo of depth.
    pub camera: Option<String>,
    /// CameraInfo of colour, where it is another one.
    pub colour_camera: Option<String>,
}

/// Chooses among topics with their types, as `sensor_msgs/msg/Image`; those given are taken.
///
/// # Errors
/// Where none has depth, or several would do.
pub fn choose_topics<'a>(
    there_are: impl IntoIterator<Item = (&'a str, &'a str)>,
    depth: Option<&str>,
    colour: Option<&str>,
) -> Result<ChosenTopics, RecordingError> {
    let mut channels = Channels::default();
    for (id, (topic, kind)) in (0..).zip(there_are) {
        let channel =
            Channel { topic: topic.to_owned(), encoding: "cdr".to_owned(), schema: kind.to_owned() };
        channels.insert(id, channel);
    }
    let Topics { depth, colour, camera, colour_camera, .. } = choose(&channels, depth, colour)?;
    Ok(ChosenTopics { depth, colour, camera, colour_camera })
}

/// Chooses among the channels of a file by their names.
pub(super) fn choose(
    channels: &Channels,
    depth: Option<&str>,
    colour: Option<&str>,
) -> Result<Topics, RecordingError> {
    choose_by(channels, depth, colour, &is_depth)
}

/// The same, where what a topic holds tells which are depth; topics without messages do not count.
pub(super) fn choose_by_content(
    channels: &Channels,
    depth: Option<&str>,
    colour: Option<&str>,
    contents: &BTreeMap<String, bool>,
) -> Result<Topics, RecordingError> {
    let is_left_out = |channel: &Channel| {
        MessageKind::of(channel).is_some_and(MessageKind::is_image) && !contents.contains_key(&channel.topic)
    };
    let with_messages = channels.iter().filter(|(_, channel)| !is_left_out(channel));
    let with_messages = with_messages.map(|(id, channel)| (*id, channel.clone())).collect();
    let is_depth = |topic: &str| contents.get(topic).copied().unwrap_or(false);
    choose_by(&with_messages, depth, colour, &is_depth)
}

fn choose_by(
    channels: &Channels,
    depth: Option<&str>,
    colour: Option<&str>,
    is_depth: &dyn Fn(&str) -> bool,
) -> Result<Topics, RecordingError> {
    let of = |wanted: fn(MessageKind) -> bool| -> Vec<&str> {
        let is_wanted = |channel: &&Channel| MessageKind::of(channel).is_some_and(wanted);
        let mut topics: Vec<&str> =
            channels.values().filter(is_wanted).map(|channel| channel.topic.as_str()).collect();
        topics.sort_unstable();
        topics.dedup();
        topics
    };
    let images = of(MessageKind::is_image);
    let there_are = if images.is_empty() { "no image topics".to_owned() } else { images.join(", ") };
    let given = |option, topic: &str| match images.contains(&topic) {
        true => Ok(topic.to_owned()),
        false => {
            let there_are = there_are.clone();
            Err(RecordingError::UnknownTopic { option, found: topic.to_owned(), there_are })
        }
    };
    let depth = match depth {
        Some(topic) => given(DEPTH_OPTION, topic)?,
        None => best("depth", DEPTH_OPTION, &images, &|topic| is_depth(topic))?.ok_or_else(|| {
            RecordingError::NoTopic {
                what: "depth",
                expected: "an image topic with 'depth' in its name, or one of 16UC1 or 32FC1",
                option: DEPTH_OPTION,
                there_are: there_are.clone(),
            }
        })?,
    };
    let colour = match colour {
        Some(topic) => Some(given(COLOUR_OPTION, topic)?),
        None => best("colour", COLOUR_OPTION, &images, &|topic| !is_depth(topic) && is_colour(topic))?,
    };
    let cameras = of(MessageKind::is_camera);
    let camera = camera_of(&depth, &cameras);
    let colour_camera = colour.as_ref().and_then(|colour| camera_of(colour, &cameras));
    let extrinsics = of(|kind| matches!(kind, MessageKind::RosExtrinsics(_)));
    let extrinsics = extrinsics.into_iter().find(|topic| topic.ends_with("depth_to_color"));
    Ok(Topics {
        colour,
        colour_camera: colour_camera.filter(|topic| camera.as_ref() != Some(topic)),
        camera,
        extrinsics: extrinsics.map(str::to_owned),
        imu: imu_of(&depth, &of(|kind| matches!(kind, MessageKind::RosImu(_)))),
        units: of(|kind| kind == MessageKind::DepthUnits)
            .into_iter()
            .find(|topic| librealsense::is_units_of(topic, &depth))
            .map(str::to_owned),
        depth,
    })
}

/// The camera of the nearest name; a camera of colour alone is not that of depth, unless nothing
/// else is there.
fn camera_of(images: &str, cameras: &[&str]) -> Option<String> {
    let common = |topic: &str| topic.bytes().zip(images.bytes()).take_while(|(a, b)| a == b).count();
    let near = |topic: &&&str| (is_depth(topic) == is_depth(images), common(topic));
    cameras.iter().rev().max_by_key(near).map(|topic| (*topic).to_owned())
}

/// The IMU topics of the camera: those that share most of the name with its images.
fn imu_of(images: &str, topics: &[&str]) -> Vec<String> {
    let common = |topic: &str| {
        let parts = topic.split('/').zip(images.split('/'));
        parts.take_while(|(a, b)| a == b).count()
    };
    let most = topics.iter().map(|topic| common(topic)).max();
    let nearest = topics.iter().filter(|topic| Some(common(topic)) == most);
    nearest.map(|topic| (*topic).to_owned()).collect()
}

/// A topic without the part that names its transport: each image topic has them all.
fn without_transport(topic: &str) -> &str {
    TRANSPORTS.iter().find_map(|end| topic.strip_suffix(end)).unwrap_or(topic)
}

fn is_depth(topic: &str) -> bool {
    without_transport(topic).to_lowercase().contains("depth")
}

fn is_colour(topic: &str) -> bool {
    let name = without_transport(topic).to_lowercase();
    // Of a colour topic `compressedDepth` holds nothing.
    !is_depth(topic)
        && !topic.ends_with(COMPRESSED_DEPTH)
        && !["infra", "/ir", "mono", "mask"].iter().any(|word| name.contains(word))
}

/// The one topic that fits best; `None` where none fits.
fn best(
    what: &'static str,
    option: &'static str,
    topics: &[&str],
    fits: &dyn Fn(&str) -> bool,
) -> Result<Option<String>, RecordingError> {
    let rank = |topic: &str| {
        let name = topic.to_lowercase();
        let has = |words: &[&str]| words.iter().any(|word| name.contains(word));
        // Depth laid over colour first, what is not compressed before what is.
        // Of depth under several names the one that is named so.
        let is_named = is_depth(topic);
        (has(&["aligned", "registered"]), is_named, !has(&["compressed"]), has(&["color", "colour", "rgb"]))
    };
    let fitting: Vec<&str> = topics.iter().copied().filter(|topic| fits(topic)).collect();
    let Some(most) = fitting.iter().map(|topic| rank(topic)).max() else { return Ok(None) };
    let foremost: Vec<&str> = fitting.into_iter().filter(|topic| rank(topic) == most).collect();
    match foremost[..] {
        [topic] => Ok(Some(topic.to_owned())),
        _ => Err(RecordingError::SeveralTopics { what, found: foremost.join(", "), option }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channels(topics: &[(&str, &str)]) -> Channels {
        let mut channels = Channels::default();
        for (id, (topic, schema)) in topics.iter().enumerate() {
            let channel =
                Channel { topic: (*topic).into(), encoding: "cdr".into(), schema: (*schema).into() };
            channels.insert(id as u32, channel);
        }
        channels
    }

    const IMAGE: &str = "sensor_msgs/msg/Image";
    const INFO: &str = "sensor_msgs/msg/CameraInfo";

    #[test]
    fn topics_of_common_drivers_are_found() {
        let realsense = channels(&[
            ("/camera/color/image_raw", IMAGE),
            ("/camera/color/camera_info", INFO),
            ("/camera/depth/image_rect_raw", IMAGE),
            ("/camera/depth/camera_info", INFO),
            ("/camera/aligned_depth_to_color/image_raw", IMAGE),
            ("/camera/aligned_depth_to_color/camera_info", INFO),
            ("/camera/infra1/image_rect_raw", IMAGE),
        ]);
        let topics = choose(&realsense, None, None).unwrap();
        assert_eq!(topics.depth, "/camera/aligned_depth_to_color/image_raw");
        assert_eq!(topics.colour.as_deref(), Some("/camera/color/image_raw"));
        assert_eq!(topics.camera.as_deref(), Some("/camera/aligned_depth_to_color/camera_info"));
        let given = choose(&realsense, Some("/camera/depth/image_rect_raw"), None).unwrap();
        assert_eq!(given.camera.as_deref(), Some("/camera/depth/camera_info"));
    }

    #[test]
    fn the_imu_is_that_of_the_camera() {
        let imu = "sensor_msgs/msg/Imu";
        let of = |topics: &[&str]| {
            let all: Vec<(&str, &str)> =
                topics.iter().map(|topic| (*topic, imu)).chain([("/camera/depth/image", IMAGE)]).collect();
            choose(&channels(&all), None, None).unwrap().imu
        };
        let realsense = ["/imu/data", "/camera/accel/sample", "/camera/gyro/sample"];
        assert_eq!(of(&realsense), ["/camera/accel/sample", "/camera/gyro/sample"].map(str::to_owned));
        assert_eq!(of(&["/mavros/imu/data", "/camera/imu"]), ["/camera/imu".to_owned()]);
        assert_eq!(of(&[]), Vec::<String>::new());
    }

    #[test]
    fn what_is_missing_or_doubtful_is_named() {
        let words = |result: Result<Topics, RecordingError>| result.unwrap_err().to_string();
        let two = channels(&[("/a/depth", IMAGE), ("/b/depth", IMAGE), ("/rgb", IMAGE)]);
        assert_eq!(
            words(choose(&two, None, None)),
            "several depth topics: /a/depth, /b/depth; give --depth-topic TOPIC"
        );
        assert!(choose(&two, Some("/b/depth"), None).is_ok());
        assert!(
            words(choose(&two, Some("/c"), None)).contains("expected an image topic of the file: /a/depth")
        );
        let none = words(choose(&channels(&[("/rgb", IMAGE)]), None, None));
        assert!(none.contains("no depth topic") && none.contains("there are: /rgb"), "{none}");
        let without_colour = choose(&channels(&[("/depth", IMAGE)]), None, None).unwrap();
        assert_eq!((without_colour.colour, without_colour.camera), (None, None));
    }

    #[test]
    fn transports_of_colour_are_no_depth() {
        let all = channels(&[
            ("/oak/rgb/image_raw", IMAGE),
            ("/oak/rgb/image_raw/compressedDepth", "sensor_msgs/msg/CompressedImage"),
            ("/oak/rgb/camera_info", INFO),
            ("/oak/stereo/image_raw", IMAGE),
            ("/oak/declared_depth/image_raw", IMAGE),
            ("/oak/stereo/camera_info", INFO),
        ]);
        let message =
            choose(&channels(&[("/rgb/compressedDepth", IMAGE)]), None, None).unwrap_err().to_string();
        assert!(message.contains("no depth topic"), "{message}");
        let contents = [
            ("/oak/rgb/image_raw", false),
            ("/oak/stereo/image_raw", true),
            ("/oak/rgb/image_raw/compressedDepth", false),
        ];
        let contents = contents.map(|(topic, is_depth)| (topic.to_owned(), is_depth)).into();
        let topics = choose_by_content(&all, None, None, &contents).unwrap();
        assert_eq!(
            (topics.depth.as_str(), topics.colour.as_deref()),
            ("/oak/stereo/image_raw", Some("/oak/rgb/image_raw"))
        );
        assert_eq!(topics.camera.as_deref(), Some("/oak/stereo/camera_info"));
        assert_eq!(topics.colour_camera.as_deref(), Some("/oak/rgb/camera_info"));
        let nothing = choose_by_content(&all, None, None, &BTreeMap::new()).unwrap_err().to_string();
        assert!(nothing.contains("no depth topic") && nothing.contains("no image topics"), "{nothing}");
    }
}
