//! Messages of ROS 2 that come one by one from a network, read by the rules of recordings.

use crate::camera::{self, RecordedCamera};
use crate::colour::{self, ColourUse};
use crate::error::{MessageError, RecordingError};
use crate::messages::ImageMessage;
use crate::transforms::FrameTree;
use crate::{pixels, ros};
use tessera_frames::CameraFile;
use tessera_frames::Undistortion;
use tessera_geometry::Camera;

/// Part of the focal length by which a camera may change and still be the same: autofocus.
const NEAR: f64 = 0.01;

/// The two types of image messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageType {
    /// `sensor_msgs/msg/Image`.
    Raw,
    /// `sensor_msgs/msg/CompressedImage`.
    Compressed,
}

/// An image as a message in CDR has it; its pixels are not decoded yet.
#[derive(Debug)]
pub struct LiveImage<'a>(ImageMessage<'a>);

/// A topic of images with the first of them.
#[derive(Clone, Copy, Debug)]
pub struct LiveTopic<'a> {
    /// The topic.
    pub topic: &'a str,
    /// Its first image.
    pub image: &'a LiveImage<'a>,
    /// A `sensor_msgs/msg/CameraInfo` in CDR that belongs to it.
    pub info: Option<&'a [u8]>,
}

/// How images are read: the camera of depth, and what is done with colour.
#[derive(Clone, Debug)]
pub struct LiveCamera {
    camera: Camera,
    recorded: Option<RecordedCamera>,
    lens: Option<Undistortion>,
    colour: ColourUse,
    colour_words: String,
    warning: Option<String>,
    topic: String,
}

/// A later CameraInfo against the first one.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// The same numbers.
    None,
    /// Focal lengths and principal point within 1 %, as autofocus moves them.
    Small(Camera),
    /// Another camera.
    Large(Camera),
}

impl<'a> LiveImage<'a> {
    /// Reads the parts of a message.
    ///
    /// # Errors
    /// Where the bytes are no such message.
    pub fn read(of: ImageType, data: &'a [u8]) -> Result<Self, MessageError> {
        match of {
            ImageType::Raw => ros::image(data),
            ImageType::Compressed => ros::compressed(data),
        }
        .map(Self)
    }

    /// Time of the image, nanoseconds.
    pub fn stamp_nanos(&self) -> i64 {
        self.0.stamp_nanos
    }
}

impl LiveCamera {
    /// Decides by the first messages of depth and colour how all others are read. The camera of
    /// depth is that of the file `given`, else that of its CameraInfo; so with colour.
    ///
    /// # Errors
    /// Where nothing says what the depth camera is, or it is one that cannot be used.
    pub fn new(
        depth: &LiveTopic<'_>,
        colour: Option<&LiveTopic<'_>>,
        frames: &FrameTree,
        given: Option<&CameraFile>,
    ) -> Result<Self, RecordingError> {
        let units_per_metre = camera::units_per_metre(&depth.image.0);
        let recorded = recorded(depth, units_per_metre);
        let stated_colour = given.and_then(|file| file.colour.as_ref());
        let (mut camera, lens, recorded) = match given {
            Some(file) => (file.camera.clone(), None, recorded.ok()),
            None => {
                let recorded = recorded?;
                let camera = recorded.camera.clone();
                let lens = recorded.lens.map(|lens| Undistortion::new(&lens, &camera));
                (camera, lens, Some(recorded))
            }
        };
        // Once it is warped.
        camera.colour_registered |= stated_colour.is_some();
        let seen = colour::Depth { camera: &camera, recorded: recorded.as_ref(), stated_colour };
        let choice = choose(colour, &seen, frames);
        Ok(Self {
            lens,
            colour: choice.colour,
            colour_words: choice.words,
            warning: choice.warning,
            topic: depth.topic.to_owned(),
            recorded,
            camera,
        })
    }

    /// The camera of the depth images as they are read.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Coordinate frame of the depth images; empty where nothing says it.
    pub fn frame(&self) -> &str {
        self.recorded.as_ref().map_or("", |recorded| &recorded.frame)
    }

    /// Whether colour images are used.
    pub fn uses_colour(&self) -> bool {
        !matches!(self.colour, ColourUse::None)
    }

    /// What is done with colour, for people.
    pub fn colour_words(&self) -> &str {
        &self.colour_words
    }

    /// What is wrong with colour, for people.
    pub fn warning(&self) -> Option<&str> {
        self.warning.as_deref()
    }

    /// Compares a later CameraInfo of the depth topic with the first one. Where a camera was given,
    /// it changes nothing.
    ///
    /// # Errors
    /// Where the bytes are no CameraInfo, or one that cannot be used.
    pub fn compare(&self, info: &[u8]) -> Result<Change, RecordingError> {
        let Some(recorded) = self.recorded.as_ref().filter(|recorded| recorded.camera == self.camera) else {
            return Ok(Change::None);
        };
        let size = (self.camera.width, self.camera.height);
        let found = convert(&self.topic, info, self.camera.units_per_metre, Some(size))?;
        let change = difference(&recorded.camera, found.camera);
        Ok(match change {
            Change::None | Change::Small(_) if found.lens == recorded.lens => change,
            Change::None => Change::Large(recorded.camera.clone()),
            Change::Small(camera) | Change::Large(camera) => Change::Large(camera),
        })
    }

    /// Compares the camera with that of images before these, `earlier`, and takes its numbers where they
    /// differ as autofocus makes them differ. Answers with what it was.
    pub fn keep(&mut self, earlier: &Camera) -> Change {
        let change = difference(earlier, self.camera.clone());
        if let Change::Small(found) = &change {
            if let Some(recorded) = self.recorded.as_mut().filter(|recorded| recorded.camera == *found) {
                recorded.camera.clone_from(earlier);
            }
            self.camera.clone_from(earlier);
        }
        change
    }

    /// Reads depth as raw units of the camera.
    ///
    /// # Errors
    /// Where the image has another size, or its data are not what it says.
    pub fn read_depth(&self, image: &LiveImage<'_>, depth_raw: &mut [u16]) -> Result<(), MessageError> {
        let size = (self.camera.width, self.camera.height);
        pixels::depth(&image.0, size, self.camera.units_per_metre, depth_raw)?;
        if let Some(lens) = &self.lens {
            lens.straighten(1, depth_raw);
        }
        Ok(())
    }

    /// Reads colour as red, green, blue at the pixels of depth.
    ///
    /// # Errors
    /// As [`Self::read_depth`].
    pub fn read_colour(
        &self,
        image: &LiveImage<'_>,
        depth_raw: &[u16],
        rgb: &mut [u8],
    ) -> Result<(), MessageError> {
        let size = (self.camera.width, self.camera.height);
        self.colour.read(&image.0, size, self.lens.as_ref(), depth_raw, rgb)
    }
}

/// How a camera differs from the one before it, in what a run is told of its camera.
fn difference(before: &Camera, found: Camera) -> Change {
    let (colour_lag_s, colour_focal_ratio) = (before.colour_lag_s, before.colour_focal_ratio);
    let told = Camera { colour_lag_s, colour_focal_ratio, ..found.clone() };
    if told == *before {
        return Change::None;
    }
    let Camera { fx, fy, cx, cy, .. } = *before;
    let near = NEAR * fx;
    let is_near = [(fx, found.fx), (fy, found.fy), (cx, found.cx), (cy, found.cy)]
        .into_iter()
        .all(|(before, found)| (before - found).abs() <= near);
    match is_near && (Camera { fx, fy, cx, cy, ..told }) == *before {
        true => Change::Small(found),
        false => Change::Large(found),
    }
}

fn choose(colour: Option<&LiveTopic<'_>>, depth: &colour::Depth<'_>, frames: &FrameTree) -> colour::Choice {
    let choice = |colour, words: String| colour::Choice { colour, words, warning: None };
    let Some(colour) = colour else { return choice(ColourUse::None, "none".to_owned()) };
    let Ok(size) = colour::size_of(&colour.image.0) else {
        let words = format!("{}, taken as registered to depth", colour.topic);
        return choice(ColourUse::Registered, words);
    };
    let own = recorded(colour, depth.camera.units_per_metre).ok();
    let standing = |from: &str, to: &str| frames.between(from, to);
    colour::decide(colour::Images { topic: colour.topic, size, own }, depth, standing)
}

fn recorded(of: &LiveTopic<'_>, units_per_metre: f64) -> Result<RecordedCamera, RecordingError> {
    let info = of.info.ok_or_else(|| RecordingError::NoCamera { topic: of.topic.to_owned() })?;
    convert(of.topic, info, units_per_metre, camera::image_size(&of.image.0))
}

fn convert(
    topic: &str,
    info: &[u8],
    units_per_metre: f64,
    size: Option<(u32, u32)>,
) -> Result<RecordedCamera, RecordingError> {
    let wrong = |problem| RecordingError::Message { topic: topic.to_owned(), number: 1, problem };
    let said = ros::camera(info).map_err(wrong)?;
    camera::convert(&said, units_per_metre, (topic.contains("rect"), size), topic)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros::{CameraInfo, Header, Image, RosPose, Time, TransformStamped, Transforms, encode};

    const SIZE: (u32, u32) = (20, 16);

    fn header(frame: &str) -> Header<'_> {
        Header { stamp: Time { sec: 3, nanosec: 5 }, frame_id: frame.into() }
    }

    fn info(frame: &str, size: (u32, u32), fx: f64) -> Vec<u8> {
        binned_info(frame, size, fx, [0; 2])
    }

    fn binned_info(frame: &str, (width, height): (u32, u32), fx: f64, binning: [u32; 2]) -> Vec<u8> {
        let (cx, cy) = (f64::from(width - 1) / 2.0, f64::from(height - 1) / 2.0);
        encode(&CameraInfo {
            header: header(frame),
            height,
            width,
            distortion_model: "plumb_bob".into(),
            d: vec![0.0; 5],
            k: [fx, 0.0, cx, 0.0, fx, cy, 0.0, 0.0, 1.0],
            r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            p: [fx, 0.0, cx, 0.0, 0.0, fx, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
            binning,
            region: Default::default(),
        })
        .unwrap()
    }

    fn image((width, height): (u32, u32), encoding: &str, data: &[u8]) -> Vec<u8> {
        let step = data.len() as u32 / height;
        let (header, encoding) = (header("x"), encoding.into());
        encode(&Image { header, height, width, encoding, is_bigendian: 0, step, data }).unwrap()
    }

    fn read(data: &[u8]) -> LiveImage<'_> {
        LiveImage::read(ImageType::Raw, data).unwrap()
    }

    #[test]
    fn depth_in_metres_is_read_and_a_change_of_the_camera_is_seen() {
        let metres: Vec<u8> = (0..320).flat_map(|_| 1.5f32.to_le_bytes()).collect();
        let (depth, first) = (image(SIZE, "32FC1", &metres), info("d", SIZE, 20.0));
        let depth = read(&depth);
        let topic = LiveTopic { topic: "/depth", image: &depth, info: Some(&first) };
        let live = LiveCamera::new(&topic, None, &FrameTree::default(), None).unwrap();
        assert_eq!((live.frame(), live.uses_colour(), depth.stamp_nanos()), ("d", false, 3_000_000_005));
        let mut raw = [0; 320];
        live.read_depth(&depth, &mut raw).unwrap();
        assert_eq!(raw, [7500; 320]);
        assert_eq!(live.compare(&info("d", SIZE, 20.0)).unwrap(), Change::None);
        assert!(matches!(live.compare(&info("d", SIZE, 20.1)).unwrap(), Change::Small(_)));
        assert!(matches!(live.compare(&info("d", SIZE, 25.0)).unwrap(), Change::Large(_)));
        assert!(matches!(live.compare(&info("d", (40, 32), 20.0)).unwrap(), Change::Large(_)));
        assert!(live.compare(&first[..20]).unwrap_err().to_string().contains("CameraInfo"));
        let small = image((10, 16), "32FC1", &metres[..640]);
        let words = live.read_depth(&read(&small), &mut raw).unwrap_err().to_string();
        assert!(words.contains("10x16 px, expected 20x16"), "{words}");
        let none = LiveTopic { info: None, ..topic };
        let words = LiveCamera::new(&none, None, &FrameTree::default(), None).unwrap_err().to_string();
        assert!(words.contains("no camera for /depth"), "{words}");
        let camera = Camera { units_per_metre: 1000.0, ..live.camera().clone() };
        let given = CameraFile { camera, colour: None, lens: None, is_distance: false, assumed: None };
        let live = LiveCamera::new(&none, None, &FrameTree::default(), Some(&given)).unwrap();
        live.read_depth(&depth, &mut raw).unwrap();
        assert_eq!((raw[0], live.compare(&info("d", SIZE, 25.0)).unwrap()), (1500, Change::None));
    }

    #[test]
    fn a_binned_camera_has_the_numbers_of_its_images() {
        let metres: Vec<u8> = (0..320).flat_map(|_| 1.5f32.to_le_bytes()).collect();
        let (depth, halved) = (image(SIZE, "32FC1", &metres), binned_info("d", (40, 32), 40.0, [2; 2]));
        let depth = read(&depth);
        let topic = LiveTopic { topic: "/depth", image: &depth, info: Some(&halved) };
        let live = LiveCamera::new(&topic, None, &FrameTree::default(), None).unwrap();
        let Camera { width, height, fx, cx, cy, .. } = *live.camera();
        assert_eq!((width, height, fx, cx, cy), (20, 16, 20.0, 9.5, 7.5));
        assert_eq!(live.compare(&halved).unwrap(), Change::None);
    }

    #[test]
    fn a_camera_takes_the_numbers_of_a_run_that_autofocus_explains() {
        let metres: Vec<u8> = (0..320).flat_map(|_| 1.5f32.to_le_bytes()).collect();
        let (depth, now) = (image(SIZE, "32FC1", &metres), info("d", SIZE, 20.1));
        let depth = read(&depth);
        let topic = LiveTopic { topic: "/depth", image: &depth, info: Some(&now) };
        let mut live = LiveCamera::new(&topic, None, &FrameTree::default(), None).unwrap();
        let earlier = Camera { fx: 20.0, fy: 20.0, ..live.camera().clone() };
        assert!(matches!(live.keep(&earlier), Change::Small(found) if found.fx == 20.1));
        assert_eq!(live.camera(), &earlier);
        assert_eq!(live.keep(&earlier), Change::None);
        assert!(matches!(live.compare(&now).unwrap(), Change::Small(found) if found.fx == 20.1));
        for other in [
            Camera { fx: 25.0, ..earlier.clone() },
            Camera { units_per_metre: 1000.0, ..earlier.clone() },
            Camera { distortion: [0.1, 0.0, 0.0, 0.0, 0.0], ..earlier.clone() },
        ] {
            assert!(matches!(live.keep(&other), Change::Large(_)));
            assert_eq!(live.camera(), &earlier);
        }
        // Of colour's delay and scale a run is not told.
        assert_eq!(live.keep(&Camera { colour_lag_s: 0.01, ..earlier.clone() }), Change::None);
    }

    #[test]
    fn colour_of_another_camera_is_warped_where_the_frames_say_how() {
        let millimetres: Vec<u8> = (0..320).flat_map(|_| 1000u16.to_le_bytes()).collect();
        let (depth, depth_info) = (image(SIZE, "16UC1", &millimetres), info("d", SIZE, 20.0));
        let (depth, large) = (read(&depth), (40, 32));
        let topic = LiveTopic { topic: "/depth", image: &depth, info: Some(&depth_info) };
        let columns: Vec<u8> = (0..32).flat_map(|_| (0..40).flat_map(|c| [c, 7, 7])).collect();
        let (colour, colour_info) = (image(large, "rgb8", &columns), info("c", large, 40.0));
        let colour = read(&colour);
        let colour_topic = LiveTopic { topic: "/colour", image: &colour, info: Some(&colour_info) };
        let lost = LiveCamera::new(&topic, Some(&colour_topic), &FrameTree::default(), None).unwrap();
        assert!(!lost.uses_colour() && lost.warning().unwrap().contains("no /tf_static says"));
        let transform = RosPose { position: [0.1, 0.0, 0.0], orientation_xyzw: [0.0, 0.0, 0.0, 1.0] };
        let transforms =
            vec![TransformStamped { header: header("d"), child_frame_id: "c".into(), transform }];
        let mut frames = FrameTree::default();
        frames.add(&encode(&Transforms { transforms }).unwrap()).unwrap();
        let live = LiveCamera::new(&topic, Some(&colour_topic), &frames, None).unwrap();
        let (mut raw, mut rgb) = ([0; 320], [0; 960]);
        live.read_depth(&depth, &mut raw).unwrap();
        live.read_colour(&colour, &raw, &mut rgb).unwrap();
        // At 1 m a point of column 10 is seen 0.1 * 40 px further left, in an image twice as wide.
        assert!((i32::from(rgb[3 * (20 * 8 + 10)]) - 16).abs() <= 1, "{}", rgb[3 * (20 * 8 + 10)]);
    }
}
