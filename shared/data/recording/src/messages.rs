//! The messages of a recording: ROS 2 in CDR, Foxglove's in protobuf or JSON.

use crate::error::MessageError;
use crate::file::Channel;
use crate::{foxglove, ros};
use std::borrow::Cow;

/// What a channel carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// `sensor_msgs/msg/Image`.
    RosImage,
    /// `sensor_msgs/msg/CompressedImage`.
    RosCompressed,
    /// `sensor_msgs/msg/CameraInfo`.
    RosCamera,
    /// `tf2_msgs/msg/TFMessage`.
    RosTransforms,
    /// `realsense2_camera_msgs/msg/Extrinsics`.
    RosExtrinsics,
    /// `foxglove.RawImage`.
    FoxgloveImage(Form),
    /// `foxglove.CompressedImage`.
    FoxgloveCompressed(Form),
    /// `foxglove.CameraCalibration`.
    FoxgloveCamera(Form),
}

/// How Foxglove's messages are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    Protobuf,
    Json,
}

impl Kind {
    /// `None` for a channel that has nothing for us.
    pub(super) fn of(channel: &Channel) -> Option<Self> {
        let form = match channel.encoding.as_str() {
            "cdr" => {
                return match channel.schema.as_str() {
                    "sensor_msgs/msg/Image" => Some(Self::RosImage),
                    "sensor_msgs/msg/CompressedImage" => Some(Self::RosCompressed),
                    "sensor_msgs/msg/CameraInfo" => Some(Self::RosCamera),
                    "tf2_msgs/msg/TFMessage" => Some(Self::RosTransforms),
                    "realsense2_camera_msgs/msg/Extrinsics" => Some(Self::RosExtrinsics),
                    _ => None,
                };
            }
            "protobuf" => Form::Protobuf,
            "json" => Form::Json,
            _ => return None,
        };
        match channel.schema.as_str() {
            "foxglove.RawImage" => Some(Self::FoxgloveImage(form)),
            "foxglove.CompressedImage" => Some(Self::FoxgloveCompressed(form)),
            "foxglove.CameraCalibration" => Some(Self::FoxgloveCamera(form)),
            _ => None,
        }
    }

    /// Bytes at the front of a message that hold its time; `None`: it may stand anywhere.
    pub(super) fn stamp_bytes(self) -> Option<u64> {
        let is_foxglove =
            matches!(self, Self::FoxgloveImage(_) | Self::FoxgloveCompressed(_) | Self::FoxgloveCamera(_));
        (!is_foxglove).then_some(ros::STAMP_BYTES)
    }

    pub(super) fn is_camera(self) -> bool {
        matches!(self, Self::RosCamera | Self::FoxgloveCamera(_))
    }

    pub(super) fn is_image(self) -> bool {
        !self.is_camera() && !matches!(self, Self::RosTransforms | Self::RosExtrinsics)
    }
}

/// An image as a message has it.
#[derive(Debug)]
pub(super) struct ImageMessage<'a> {
    pub(super) stamp_nanos: i64,
    pub(super) data: Cow<'a, [u8]>,
    pub(super) form: ImageForm,
}

/// How the data of an image are to be read.
#[derive(Debug)]
pub(super) enum ImageForm {
    /// Pixels row by row.
    Raw { encoding: String, width: u32, height: u32, step: usize, is_big_endian: bool },
    /// A picture file; the words of the message say of what.
    File { format: String },
}

/// A camera as a message has it.
#[derive(Debug)]
pub(super) struct CameraMessage {
    /// Name of its coordinate frame; empty where it is not known.
    pub(super) frame: String,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) model: String,
    pub(super) distortion: Vec<f64>,
    /// Of the image as taken, 3x3 row by row.
    pub(super) intrinsics: Vec<f64>,
    /// Of the rectified image, 3x4 row by row.
    pub(super) projection: Vec<f64>,
}

/// Reads an image.
pub(super) fn image(kind: Kind, data: &[u8]) -> Result<ImageMessage<'_>, MessageError> {
    match kind {
        Kind::RosImage => ros::image(data),
        Kind::RosCompressed => ros::compressed(data),
        Kind::FoxgloveImage(form) => foxglove::image(form, data),
        Kind::FoxgloveCompressed(form) => foxglove::compressed(form, data),
        _ => Err(MessageError::Kind { kind: "image", reason: "it is a camera or a transform".to_owned() }),
    }
}

/// Reads the time of an image, of which the front may be all that there is.
pub(super) fn stamp_nanos(kind: Kind, data: &[u8]) -> Result<i64, MessageError> {
    match kind {
        Kind::RosImage => ros::stamp_nanos("sensor_msgs/msg/Image", data),
        Kind::RosCompressed => ros::stamp_nanos("sensor_msgs/msg/CompressedImage", data),
        _ => image(kind, data).map(|image| image.stamp_nanos),
    }
}

/// Reads a camera.
pub(super) fn camera(kind: Kind, data: &[u8]) -> Result<CameraMessage, MessageError> {
    match kind {
        Kind::RosCamera => ros::camera(data),
        Kind::FoxgloveCamera(form) => foxglove::camera(form, data),
        _ => Err(MessageError::Kind { kind: "camera", reason: "it is an image".to_owned() }),
    }
}

/// Nanoseconds of a message's time.
pub(super) fn nanos(seconds: i64, nanoseconds: i64) -> i64 {
    seconds.saturating_mul(1_000_000_000).saturating_add(nanoseconds)
}
