//! Images, cameras and times read from CDR.

use super::structs::{CameraInfo, CompressedImage, Extrinsics, Image, Imu, RosPose, Time, Transforms};
use crate::error::MessageError;
use crate::imu::ImuFields;
use crate::messages::{CameraMessage, ImageForm, ImageMessage};
use re_cdr::{BigEndian, LittleEndian, from_bytes};
use serde::Deserialize;
use std::borrow::Cow;
use tessera_frames::SentWindow;

/// Bytes up to the end of a message's time: encapsulation, seconds, nanoseconds.
pub(crate) const STAMP_BYTES: u64 = 12;

/// A message, as recordings and networks have it. What stands behind it is not read.
///
/// # Errors
/// Where the bytes are no such message.
pub fn decode<'a, T: Deserialize<'a>>(kind: &'static str, data: &'a [u8]) -> Result<T, MessageError> {
    decode_first(kind, data).map(|(message, _)| message)
}

/// A message, and that its bytes are nothing more: behind it up to three zeros fill them up.
///
/// # Errors
/// Where the bytes are no such message, or more.
pub fn decode_whole<'a, T: Deserialize<'a>>(kind: &'static str, data: &'a [u8]) -> Result<T, MessageError> {
    let (message, rest) = decode_first(kind, data)?;
    match rest {
        [] | [0] | [0, 0] | [0, 0, 0] => Ok(message),
        _ => Err(MessageError::Kind { kind, reason: format!("{} bytes behind it", rest.len()) }),
    }
}

/// The four bytes before a message state the order of its bytes. Answers the bytes behind it too.
fn decode_first<'a, T: Deserialize<'a>>(
    kind: &'static str,
    data: &'a [u8],
) -> Result<(T, &'a [u8]), MessageError> {
    let wrong = |reason: String| MessageError::Kind { kind, reason };
    let (head, body) = data
        .split_first_chunk::<4>()
        .ok_or_else(|| wrong(format!("{} bytes, expected at least 4", data.len())))?;
    let [_, encapsulation, ..] = *head;
    let decoded = match encapsulation {
        0 => from_bytes::<T, BigEndian>(body),
        1 => from_bytes::<T, LittleEndian>(body),
        other => return Err(wrong(format!("encapsulation {other}, expected 0 or 1 (plain CDR)"))),
    };
    let (message, n_read) = decoded.map_err(|error| wrong(error.to_string()))?;
    Ok((message, body.get(n_read..).unwrap_or_default()))
}

/// The time of a message that begins with a header, from its first bytes.
pub(crate) fn stamp_nanos(kind: &'static str, data: &[u8]) -> Result<i64, MessageError> {
    decode::<Time>(kind, data).map(|time| time.nanos())
}

/// The one value that is no mistake: a driver that leaves the byte unset is not of the other order.
pub(crate) const BIG_ENDIAN: u8 = 1;

pub(crate) fn image(data: &[u8]) -> Result<ImageMessage<'_>, MessageError> {
    let image: Image<'_> = decode("sensor_msgs/msg/Image", data)?;
    Ok(ImageMessage {
        stamp_nanos: image.header.stamp.nanos(),
        data: Cow::Borrowed(image.data),
        form: ImageForm::Raw {
            encoding: image.encoding.into_owned(),
            width: image.width,
            height: image.height,
            step: image.step as usize,
            is_big_endian: image.is_bigendian == BIG_ENDIAN,
        },
    })
}

pub(crate) fn compressed(data: &[u8]) -> Result<ImageMessage<'_>, MessageError> {
    let image: CompressedImage<'_> = decode("sensor_msgs/msg/CompressedImage", data)?;
    Ok(ImageMessage {
        stamp_nanos: image.header.stamp.nanos(),
        data: Cow::Borrowed(image.data),
        form: ImageForm::File { format: image.format.into_owned() },
    })
}

pub(crate) fn camera(data: &[u8]) -> Result<CameraMessage, MessageError> {
    let info: CameraInfo<'_> = decode("sensor_msgs/msg/CameraInfo", data)?;
    Ok(CameraMessage {
        frame: info.header.frame_id.into_owned(),
        width: info.width,
        height: info.height,
        model: info.distortion_model.into_owned(),
        distortion: info.d,
        intrinsics: info.k.to_vec(),
        projection: info.p.to_vec(),
        window: SentWindow {
            binning: info.binning,
            first: [info.region.x_offset, info.region.y_offset],
            size: [info.region.width, info.region.height],
        },
    })
}

/// Parent, child and `parent_from_child` of each transform of a message.
pub(crate) fn transforms(data: &[u8]) -> Result<Vec<(String, String, RosPose)>, MessageError> {
    let message: Transforms<'_> = decode("tf2_msgs/msg/TFMessage", data)?;
    let name = |name: &str| name.trim_start_matches('/').to_owned();
    let one = |t: &super::structs::TransformStamped<'_>| {
        (name(&t.header.frame_id), name(&t.child_frame_id), t.transform)
    };
    Ok(message.transforms.iter().map(one).collect())
}

pub(crate) fn imu(data: &[u8]) -> Result<ImuFields, MessageError> {
    let imu: Imu<'_> = decode("sensor_msgs/msg/Imu", data)?;
    let variance = |[variance, ..]: [f64; 9]| variance;
    Ok(ImuFields {
        stamp_nanos: imu.header.stamp.nanos(),
        frame: imu.header.frame_id.into_owned(),
        rate: (imu.angular_velocity, variance(imu.angular_velocity_covariance)),
        force: (imu.linear_acceleration, variance(imu.linear_acceleration_covariance)),
    })
}

/// Rotation by columns and translation of a RealSense's `depth_to_color`.
pub(crate) fn extrinsics(data: &[u8]) -> Result<Extrinsics, MessageError> {
    decode("realsense2_camera_msgs/msg/Extrinsics", data)
}
