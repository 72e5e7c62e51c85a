//! Errors of a recording.

use std::io;
use tessera_frames::ImageError;

/// Why a recording cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file cannot be read.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// The file is of no kind that is read.
    #[error(
        "begins with '{found}', expected an MCAP file ('\\x89MCAP0\\r\\n'), a bag of ROS 1 ('#ROSBAG V2.0') or a bag of ROS 2 in SQLite ('SQLite format 3')"
    )]
    Magic {
        /// First bytes.
        found: String,
    },
    /// A bag of ROS 1 of a version that is not read.
    #[error("begins with '{found}', expected '#ROSBAG V2.0\\n'; older bags: rosbag fix FILE.bag NEW.bag")]
    BagVersion {
        /// First bytes.
        found: String,
    },
    /// A database that is no bag, or one that is not read.
    #[error("{0}")]
    Database(String),
    /// A record in the middle of the file is damaged.
    #[error("the record at byte {offset} is damaged: {reason}")]
    Damaged {
        /// Where it begins.
        offset: u64,
        /// What the reader said.
        reason: String,
    },
    /// No topic has what is needed.
    #[error("no {what} topic, expected {expected}; give {option}; there are: {there_are}")]
    NoTopic {
        /// `depth` or `colour`.
        what: &'static str,
        /// What would do.
        expected: &'static str,
        /// The option that names one.
        option: &'static str,
        /// Image topics of the file.
        there_are: String,
    },
    /// Several topics would do.
    #[error("several {what} topics: {found}; give {option}")]
    SeveralTopics {
        /// `depth` or `colour`.
        what: &'static str,
        /// Which.
        found: String,
        /// The option that names one.
        option: &'static str,
    },
    /// A topic that was given has no images.
    #[error("{option} is {found}, expected an image topic of the file: {there_are}")]
    UnknownTopic {
        /// The option.
        option: &'static str,
        /// What was given.
        found: String,
        /// Image topics of the file.
        there_are: String,
    },
    /// Nothing says what the camera is.
    #[error(
        "no camera for {topic}: expected a CameraInfo or CameraCalibration topic beside it; give --camera FILE"
    )]
    NoCamera {
        /// The depth topic.
        topic: String,
    },
    /// A camera of a model that is not known here.
    #[error(
        "{topic}: distortion model '{model}' with coefficients {found:?}, expected plumb_bob with up to 5, rational_polynomial with 8 or equidistant with 4 that do not fold the image; rectify the images first (ROS: image_proc, RectifyNode, and record image_rect), or give --camera FILE"
    )]
    Distortion {
        /// The topic.
        topic: String,
        /// The model.
        model: String,
        /// Its coefficients.
        found: Vec<f64>,
    },
    /// A camera whose numbers cannot be.
    #[error("{topic}: {source}; a camera that is not calibrated may state zeros: give --camera FILE")]
    Camera {
        /// The topic.
        topic: String,
        /// Which number.
        source: tessera_geometry::CameraError,
    },
    /// Binning and region of interest that do not give the images.
    #[error(
        "{topic}: {}x{} px, of which binning and roi leave {}x{} px, expected {}x{} px as the images are; give --camera FILE",
        whole.0, whole.1, sent.0, sent.1, found.0, found.1
    )]
    Window {
        /// The topic.
        topic: String,
        /// Size of the images.
        found: (u32, u32),
        /// Size that the message states.
        whole: (u32, u32),
        /// Size after binning and region.
        sent: (u32, u32),
    },
    /// A message cannot be used.
    #[error("{topic}, message {number}: {problem}")]
    Message {
        /// The topic.
        topic: String,
        /// Counted from 1 in the order of its times.
        number: usize,
        /// What is wrong with it.
        problem: MessageError,
    },
    /// No images are left.
    #[error("{topic} has no messages")]
    Empty {
        /// The topic.
        topic: String,
    },
}

/// Why a message cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum MessageError {
    /// The bytes are no message of their kind.
    #[error("no {kind}: {reason}")]
    Kind {
        /// The schema.
        kind: &'static str,
        /// What the decoder said.
        reason: String,
    },
    /// An encoding that is not known here.
    #[error("encoding is '{found}', expected {expected}")]
    Encoding {
        /// What was found.
        found: String,
        /// What would do.
        expected: &'static str,
    },
    /// Fewer bytes than rows and columns need.
    #[error("{found} bytes of data and step {step}, expected {expected} bytes in rows of at least {row}")]
    Length {
        /// Bytes found.
        found: usize,
        /// Bytes from row to row.
        step: usize,
        /// Bytes needed.
        expected: usize,
        /// Bytes of a row.
        row: usize,
    },
    /// The picture inside.
    #[error(transparent)]
    Image(#[from] ImageError),
}
