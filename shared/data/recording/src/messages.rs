//! The messages of a recording: ROS 2 in CDR, ROS 1 in its own form, Foxglove's in protobuf or JSON.

use crate::container::Channel;
use crate::error::MessageError;
use crate::{foxglove, librealsense, ros, ros1};
use std::borrow::Cow;
use tessera_frames::SentWindow;

/// Bytes of an Imu message at most: 37 numbers of 8 bytes behind a header.
const IMU_BYTES: u64 = 1024;

/// What a channel carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MessageKind {
    /// `sensor_msgs/msg/Image`; in ROS 1 types are named without `msg`.
    RosImage(MessageWire),
    /// `sensor_msgs/msg/CompressedImage`.
    RosCompressed(MessageWire),
    /// `sensor_msgs/msg/CameraInfo`.
    RosCamera(MessageWire),
    /// `tf2_msgs/msg/TFMessage`.
    RosTransforms(MessageWire),
    /// Units of depth, of librealsense's recorder.
    DepthUnits,
    /// `geometry_msgs/Transform` of a stream, of that recorder.
    StreamPlace,
    /// `realsense2_camera_msgs/msg/Extrinsics`.
    RosExtrinsics(MessageWire),
    /// `sensor_msgs/msg/Imu`.
    RosImu(MessageWire),
    /// `foxglove.RawImage`.
    FoxgloveImage(Form),
    /// `foxglove.CompressedImage`.
    FoxgloveCompressed(Form),
    /// `foxglove.CameraCalibration`.
    FoxgloveCamera(Form),
}

/// How ROS's messages are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MessageWire {
    /// ROS 2.
    Cdr,
    /// ROS 1.
    Ros1,
}

/// How Foxglove's messages are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    Protobuf,
    Json,
}

impl MessageKind {
    /// `None` for a channel that has nothing for us.
    pub(super) fn of(channel: &Channel) -> Option<Self> {
        if librealsense::is_units(&channel.topic) {
            return Some(Self::DepthUnits);
        }
        if channel.schema == "geometry_msgs/Transform" && librealsense::placed_by(&channel.topic).is_some() {
            return Some(Self::StreamPlace);
        }
        let form = match channel.encoding.as_str() {
            "cdr" => return Self::of_ros(&channel.schema.replacen("/msg/", "/", 1), MessageWire::Cdr),
            "ros1" => return Self::of_ros(&channel.schema, MessageWire::Ros1),
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

    /// By the name that ROS 1 gives a type.
    fn of_ros(schema: &str, wire: MessageWire) -> Option<Self> {
        match schema {
            "sensor_msgs/Image" => Some(Self::RosImage(wire)),
            "sensor_msgs/CompressedImage" => Some(Self::RosCompressed(wire)),
            "sensor_msgs/CameraInfo" => Some(Self::RosCamera(wire)),
            "sensor_msgs/Imu" => Some(Self::RosImu(wire)),
            "tf2_msgs/TFMessage" | "tf/tfMessage" => Some(Self::RosTransforms(wire)),
            "realsense2_camera_msgs/Extrinsics" | "realsense2_camera/Extrinsics" => {
                Some(Self::RosExtrinsics(wire))
            }
            _ => None,
        }
    }

    /// Bytes at the front of a message that hold its time, or all that is read of it; `None`: it may stand anywhere.
    pub(super) fn stamp_bytes(self) -> Option<u64> {
        match self {
            Self::FoxgloveImage(_) | Self::FoxgloveCompressed(_) | Self::FoxgloveCamera(_) => None,
            Self::RosImu(_) => Some(IMU_BYTES),
            // Small, and read by themselves.
            Self::DepthUnits | Self::StreamPlace => Some(0),
            _ => Some(ros::STAMP_BYTES),
        }
    }

    pub(super) fn is_camera(self) -> bool {
        matches!(self, Self::RosCamera(_) | Self::FoxgloveCamera(_))
    }

    pub(super) fn is_image(self) -> bool {
        let is_ros = matches!(self, Self::RosImage(_) | Self::RosCompressed(_));
        is_ros || matches!(self, Self::FoxgloveImage(_) | Self::FoxgloveCompressed(_))
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
    /// What of the camera's image is sent.
    pub(super) window: SentWindow,
}

/// Reads an image.
pub(super) fn image(kind: MessageKind, data: &[u8]) -> Result<ImageMessage<'_>, MessageError> {
    match kind {
        MessageKind::RosImage(MessageWire::Cdr) => ros::image(data),
        MessageKind::RosImage(MessageWire::Ros1) => ros1::image(data),
        MessageKind::RosCompressed(MessageWire::Cdr) => ros::compressed(data),
        MessageKind::RosCompressed(MessageWire::Ros1) => ros1::compressed(data),
        MessageKind::FoxgloveImage(form) => foxglove::image(form, data),
        MessageKind::FoxgloveCompressed(form) => foxglove::compressed(form, data),
        _ => Err(MessageError::Kind { kind: "image", reason: "it is a camera or a transform".to_owned() }),
    }
}

/// Reads the time of an image, of which the front may be all that there is.
pub(super) fn stamp_nanos(kind: MessageKind, data: &[u8]) -> Result<i64, MessageError> {
    match kind {
        MessageKind::RosImage(MessageWire::Cdr) => ros::stamp_nanos("sensor_msgs/msg/Image", data),
        MessageKind::RosCompressed(MessageWire::Cdr) => {
            ros::stamp_nanos("sensor_msgs/msg/CompressedImage", data)
        }
        MessageKind::RosImage(MessageWire::Ros1) => ros1::stamp_nanos("sensor_msgs/Image", data),
        MessageKind::RosCompressed(MessageWire::Ros1) => {
            ros1::stamp_nanos("sensor_msgs/CompressedImage", data)
        }
        _ => image(kind, data).map(|image| image.stamp_nanos),
    }
}

/// Reads a camera.
pub(super) fn camera(kind: MessageKind, data: &[u8]) -> Result<CameraMessage, MessageError> {
    match kind {
        MessageKind::RosCamera(MessageWire::Cdr) => ros::camera(data),
        MessageKind::RosCamera(MessageWire::Ros1) => ros1::camera(data),
        MessageKind::FoxgloveCamera(form) => foxglove::camera(form, data),
        _ => Err(MessageError::Kind { kind: "camera", reason: "it is an image".to_owned() }),
    }
}

/// Reads parent, child and `parent_from_child` of each transform.
pub(super) fn transforms(
    kind: MessageKind,
    data: &[u8],
) -> Result<Vec<(String, String, ros::RosPose)>, MessageError> {
    match kind {
        MessageKind::RosTransforms(MessageWire::Ros1) => ros1::transforms(data),
        _ => ros::transforms(data),
    }
}

/// Reads a message by how it is written.
pub(super) fn of_wire<'a, T>(
    wire: MessageWire,
    data: &'a [u8],
    cdr: impl FnOnce(&'a [u8]) -> Result<T, MessageError>,
    ros1: impl FnOnce(&'a [u8]) -> Result<T, MessageError>,
) -> Result<T, MessageError> {
    match wire {
        MessageWire::Cdr => cdr(data),
        MessageWire::Ros1 => ros1(data),
    }
}

/// Reads where a RealSense's colour camera stands from its depth camera.
pub(super) fn extrinsics(kind: MessageKind, data: &[u8]) -> Result<ros::Extrinsics, MessageError> {
    match kind {
        MessageKind::RosExtrinsics(MessageWire::Ros1) => ros1::extrinsics(data),
        _ => ros::extrinsics(data),
    }
}

/// Nanoseconds of a message's time.
pub(super) fn nanos(seconds: i64, nanoseconds: i64) -> i64 {
    seconds.saturating_mul(1_000_000_000).saturating_add(nanoseconds)
}
