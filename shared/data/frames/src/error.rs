//! Errors of a source. Each message names the place, what was found and expected.

use std::io;
use std::path::PathBuf;
use tessera_evaluation::{ReadError, StampError};
use tessera_geometry::CameraError;

/// Why a source cannot be opened or a frame not read.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// The source is neither a scene nor anything that is there.
    #[error(
        "no source '{}': expected room, corridor, wall, house, building or a folder of images, FILE.mcap, FILE.bag (ROS 1), FILE.db3 or the folder of a ROS 2 bag, or external", path.display()
    )]
    NoFolder {
        /// What was given.
        path: PathBuf,
    },
    /// A folder whose layout is not known.
    #[error(
        "{}: no layout that is known; expected one of {expected}; it holds {there_are}{hint}", folder.display()
    )]
    NoLayout {
        /// The folder.
        folder: PathBuf,
        /// The layouts that are known.
        expected: String,
        /// What lies in the folder.
        there_are: String,
        /// Where else to look, as text.
        hint: String,
    },
    /// A recording that is known for what it is and not read.
    #[error("{} is {what}, which is not read: {remedy}", path.display())]
    NotRead {
        /// The file or folder.
        path: PathBuf,
        /// What it is.
        what: &'static str,
        /// What to do, with the command.
        remedy: String,
    },
    /// A file of a recording is not as its layout says.
    #[error("{}: {reason}", path.display())]
    Layout {
        /// The file or folder.
        path: PathBuf,
        /// What was found and what was expected.
        reason: String,
    },
    /// The colour of a frame cannot be used; its depth has been read.
    #[error(transparent)]
    Colour(Box<SourceError>),
    /// A recording in a file cannot be used.
    #[error("{}: {source}", path.display())]
    Recording {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// Frames of a camera's own program cannot be looked at beforehand, nor again.
    #[error("the source 'external' is a camera's own program: only `tessera run external` waits for it")]
    External,
    /// All frames are left out.
    #[error("the source has {n_frames} frames, {n_skipped} are left out at the beginning; expected fewer")]
    NothingLeft {
        /// Frames of the source.
        n_frames: u64,
        /// Frames left out.
        n_skipped: u64,
    },
    /// A file cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A line of `rgb.txt` or `depth.txt` cannot be used.
    #[error("{}, line {line}: {source}", path.display())]
    List {
        /// The list.
        path: PathBuf,
        /// Line, counted from 1.
        line: usize,
        /// What is wrong with it.
        source: ListError,
    },
    /// A list names no image.
    #[error("{} names no images, expected lines of: timestamp filename", path.display())]
    EmptyList {
        /// The list.
        path: PathBuf,
    },
    /// `imu.txt` holds nothing.
    #[error("{} has no measurements, expected lines of: timestamp gx gy gz [ax ay az]", path.display())]
    EmptyImu {
        /// The file.
        path: PathBuf,
    },
    /// The ground truth cannot be used.
    #[error(transparent)]
    GroundTruth(#[from] ReadError),
    /// Nothing says what the camera is.
    #[error(
        "{} has no camera.toml{beside}: put one there, or give --camera FILE or --camera {}{template}",
        folder.display(), crate::CAMERA_NAMES.join("|")
    )]
    NoCamera {
        /// The folder.
        folder: PathBuf,
        /// Files that may have been meant for one, as text.
        beside: String,
        /// Lines of a camera file to fill in, as text.
        template: String,
    },
    /// A camera was named that is neither built in nor a file.
    #[error("no camera '{found}': expected a file or one of {}", crate::CAMERA_NAMES.join(", "))]
    UnknownCamera {
        /// What was given.
        found: String,
    },
    /// A camera file is not what it should be.
    #[error("{file}: {message}")]
    CameraFile {
        /// The file, or the name of a built-in camera.
        file: String,
        /// Line, key, what was found and expected.
        message: String,
    },
    /// A number of the camera is out of range.
    #[error("{file}: {source}")]
    CameraValue {
        /// The file, or the name of a built-in camera.
        file: String,
        /// Which number.
        source: CameraError,
    },
    /// A scene option is out of range.
    #[error("{name} is {value}, expected {rule}")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// What was found.
        value: String,
        /// What must hold.
        rule: &'static str,
    },
    /// An image cannot be used.
    #[error("frame {frame}, {}: {source}", path.display())]
    Image {
        /// Index of the frame.
        frame: u64,
        /// The image.
        path: PathBuf,
        /// What is wrong with it.
        source: ImageError,
    },
    /// A frame beyond the end was asked for.
    #[error("frame {frame} was asked for, the source has frames 0 to {last}")]
    NoFrame {
        /// Index asked for.
        frame: u64,
        /// Last index there is.
        last: u64,
    },
    /// The caller's slices do not fit the camera.
    #[error(
        "buffers hold {depth} depth and {colour} colour values, expected {expected_depth} and {expected_colour}"
    )]
    Buffers {
        /// Length of the depth slice.
        depth: usize,
        /// Length of the colour slice.
        colour: usize,
        /// Length that fits.
        expected_depth: usize,
        /// Length that fits.
        expected_colour: usize,
    },
}

impl SourceError {
    /// Whether it concerns the images of one frame, so that others may be good.
    pub fn is_of_one_frame(&self) -> bool {
        matches!(self, Self::Colour(_) | Self::Image { .. } | Self::Recording { .. } | Self::Io { .. })
    }
}

/// What is wrong with one line of an image list.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ListError {
    /// There is no file name behind the time.
    #[error("found '{found}', expected: timestamp filename")]
    Columns {
        /// The line.
        found: String,
    },
    /// The first word is not a time.
    #[error(transparent)]
    Stamp(#[from] StampError),
    /// A time comes twice.
    #[error("timestamp {found} is repeated, expected each once")]
    Repeated {
        /// The time, seconds.
        found: String,
    },
    /// A time is below the one before it.
    #[error("timestamp {found} comes after {before}, expected increasing timestamps")]
    Unsorted {
        /// The time, seconds.
        found: String,
        /// The one before it, seconds.
        before: String,
    },
    /// A line of `imu.txt` has the wrong number of columns.
    #[error("found '{found}', expected: timestamp gx gy gz [ax ay az]")]
    ImuColumns {
        /// The line.
        found: String,
    },
    /// A word of `imu.txt` is not a number.
    #[error("found '{found}', expected a finite number")]
    ImuNumber {
        /// The word.
        found: String,
    },
    /// No camera turns that fast.
    #[error("a rate is {found} rad/s, expected at most {most} rad/s: are these degrees?")]
    ImuRate {
        /// The rate, as text.
        found: String,
        /// The largest that is believed, as text.
        most: String,
    },
    /// No camera is shaken that hard.
    #[error("a specific force is {found} m/s^2, expected at most {most} m/s^2")]
    ImuForce {
        /// The force, as text.
        found: String,
        /// The largest that is believed, as text.
        most: String,
    },
    /// A file name leads out of the folder.
    #[error("filename is '{found}', expected a path inside the folder")]
    Outside {
        /// The file name.
        found: String,
    },
}

/// What is wrong with one image.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The file cannot be read.
    #[error("{0}")]
    Io(io::Error),
    /// The file has none of the forms that are read.
    #[error("found {found}, expected {expected}")]
    Format {
        /// What it is, or its first bytes.
        found: String,
        /// What would do.
        expected: &'static str,
    },
    /// The decoder gave up: the file is cut short or damaged.
    #[error("the image is cut short or damaged ({message}), expected a whole {format}")]
    Damaged {
        /// PNG or JPEG.
        format: &'static str,
        /// What the decoder said.
        message: String,
    },
    /// The wrong kind of pixel.
    #[error("{what} image has {found}, expected {expected}")]
    Pixels {
        /// `depth` or `colour`.
        what: &'static str,
        /// Channels and bits found.
        found: String,
        /// Channels and bits that would do.
        expected: &'static str,
    },
    /// Floats that are no metres.
    #[error(
        "depth image has floats from {least} to {most}, expected metres: these look like millimetres; write them / 1000, or as whole numbers of 16 bits with units_per_metre = 1000"
    )]
    Millimetres {
        /// The smallest beyond what a camera sees.
        least: f64,
        /// The largest.
        most: f64,
    },
    /// The wrong number of bytes once decompressed.
    #[error("{what} image holds {found} bytes, expected {expected} for {}x{} px as the camera says", size.0, size.1)]
    Length {
        /// `depth` or `confidence`.
        what: &'static str,
        /// Bytes found, as text.
        found: String,
        /// Bytes that would do.
        expected: usize,
        /// Columns and rows of the camera.
        size: (u32, u32),
    },
    /// The wrong size.
    #[error("{what} image is {}x{} px, expected {}x{} px as the camera says", found.0, found.1, expected.0, expected.1)]
    Size {
        /// `depth` or `colour`.
        what: &'static str,
        /// Columns and rows found.
        found: (u32, u32),
        /// Columns and rows of the camera.
        expected: (u32, u32),
    },
}
