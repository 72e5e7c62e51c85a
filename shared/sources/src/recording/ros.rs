//! Messages of ROS 2 in CDR.

use super::error::MessageError;
use super::messages::{CameraMessage, ImageForm, ImageMessage, nanos};
use re_cdr::{BigEndian, LittleEndian, from_bytes};
use serde::Deserialize;
use std::borrow::Cow;

/// Bytes up to the end of a message's time: encapsulation, seconds, nanoseconds.
pub(super) const STAMP_BYTES: u64 = 12;

#[derive(Deserialize)]
struct Time {
    sec: i32,
    nanosec: u32,
}

#[derive(Deserialize)]
struct Header {
    stamp: Time,
    #[serde(rename = "frame_id")]
    _frame_id: String,
}

impl Time {
    fn nanos(&self) -> i64 {
        nanos(self.sec.into(), self.nanosec.into())
    }
}

/// `sensor_msgs/msg/Image`.
#[derive(Deserialize)]
struct Image<'a> {
    header: Header,
    height: u32,
    width: u32,
    encoding: String,
    is_bigendian: u8,
    step: u32,
    #[serde(borrow, with = "serde_bytes")]
    data: &'a [u8],
}

/// `sensor_msgs/msg/CompressedImage`.
#[derive(Deserialize)]
struct CompressedImage<'a> {
    header: Header,
    format: String,
    #[serde(borrow, with = "serde_bytes")]
    data: &'a [u8],
}

/// `sensor_msgs/msg/CameraInfo` up to the projection; binning and region follow.
#[derive(Deserialize)]
struct CameraInfo {
    #[serde(rename = "header")]
    _header: Header,
    height: u32,
    width: u32,
    distortion_model: String,
    d: Vec<f64>,
    k: [f64; 9],
    #[serde(rename = "r")]
    _r: [f64; 9],
    p: [f64; 12],
}

/// The four bytes before a message say in which order its bytes are.
fn decode<'a, T: Deserialize<'a>>(kind: &'static str, data: &'a [u8]) -> Result<T, MessageError> {
    let wrong = |reason: String| MessageError::Kind { kind, reason };
    let (head, body) = data
        .split_at_checked(4)
        .ok_or_else(|| wrong(format!("{} bytes, expected at least 4", data.len())))?;
    let decoded = match head[1] {
        0 => from_bytes::<T, BigEndian>(body),
        1 => from_bytes::<T, LittleEndian>(body),
        other => return Err(wrong(format!("encapsulation {other}, expected 0 or 1 (plain CDR)"))),
    };
    decoded.map(|(message, _)| message).map_err(|error| wrong(error.to_string()))
}

/// The time of a message that begins with a header, from its first bytes.
pub(super) fn stamp_nanos(kind: &'static str, data: &[u8]) -> Result<i64, MessageError> {
    decode::<Time>(kind, data).map(|time| time.nanos())
}

pub(super) fn image(data: &[u8]) -> Result<ImageMessage<'_>, MessageError> {
    let image: Image<'_> = decode("sensor_msgs/msg/Image", data)?;
    Ok(ImageMessage {
        stamp_nanos: image.header.stamp.nanos(),
        data: Cow::Borrowed(image.data),
        form: ImageForm::Raw {
            encoding: image.encoding,
            width: image.width,
            height: image.height,
            step: image.step as usize,
            is_big_endian: image.is_bigendian != 0,
        },
    })
}

pub(super) fn compressed(data: &[u8]) -> Result<ImageMessage<'_>, MessageError> {
    let image: CompressedImage<'_> = decode("sensor_msgs/msg/CompressedImage", data)?;
    Ok(ImageMessage {
        stamp_nanos: image.header.stamp.nanos(),
        data: Cow::Borrowed(image.data),
        form: ImageForm::File { format: image.format },
    })
}

pub(super) fn camera(data: &[u8]) -> Result<CameraMessage, MessageError> {
    let info: CameraInfo = decode("sensor_msgs/msg/CameraInfo", data)?;
    Ok(CameraMessage {
        width: info.width,
        height: info.height,
        model: info.distortion_model,
        distortion: info.d,
        intrinsics: info.k.to_vec(),
        projection: info.p.to_vec(),
    })
}
