//! Messages of Foxglove's schemas, in protobuf or JSON.

use crate::error::MessageError;
use crate::messages::{CameraMessage, Form, ImageForm, ImageMessage, nanos};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use prost::Message;
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use tessera_frames::SentWindow;

/// A time: protobuf says `seconds` and `nanos`, JSON `sec` and `nsec`.
#[derive(Clone, PartialEq, Message, Deserialize)]
struct FoxgloveTime {
    #[prost(int64, tag = "1")]
    #[serde(rename = "sec")]
    seconds: i64,
    #[prost(int32, tag = "2")]
    #[serde(rename = "nsec")]
    nanos: i32,
}

#[derive(Clone, PartialEq, Message, Deserialize)]
struct RawImage {
    #[prost(message, optional, tag = "1")]
    timestamp: Option<FoxgloveTime>,
    #[prost(fixed32, tag = "2")]
    width: u32,
    #[prost(fixed32, tag = "3")]
    height: u32,
    #[prost(string, tag = "4")]
    encoding: String,
    #[prost(fixed32, tag = "5")]
    step: u32,
    #[prost(bytes = "vec", tag = "6")]
    #[serde(deserialize_with = "base64_bytes")]
    data: Vec<u8>,
}

#[derive(Clone, PartialEq, Message, Deserialize)]
struct FoxgloveImage {
    #[prost(message, optional, tag = "1")]
    timestamp: Option<FoxgloveTime>,
    #[prost(bytes = "vec", tag = "2")]
    #[serde(deserialize_with = "base64_bytes")]
    data: Vec<u8>,
    #[prost(string, tag = "3")]
    format: String,
}

#[derive(Clone, PartialEq, Message, Deserialize)]
struct CameraCalibration {
    #[prost(fixed32, tag = "2")]
    width: u32,
    #[prost(fixed32, tag = "3")]
    height: u32,
    #[prost(string, tag = "4")]
    #[serde(default)]
    distortion_model: String,
    #[prost(double, repeated, tag = "5")]
    #[serde(rename = "D", default)]
    d: Vec<f64>,
    #[prost(double, repeated, tag = "6")]
    #[serde(rename = "K")]
    k: Vec<f64>,
    #[prost(double, repeated, tag = "8")]
    #[serde(rename = "P", default)]
    p: Vec<f64>,
    #[prost(string, tag = "9")]
    #[serde(default)]
    frame_id: String,
}

fn base64_bytes<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<u8>, D::Error> {
    let text = Cow::<'de, str>::deserialize(deserializer)?;
    STANDARD.decode(text.as_bytes()).map_err(serde::de::Error::custom)
}

fn decode<T: Message + Default + for<'a> Deserialize<'a>>(
    kind: &'static str,
    form: Form,
    data: &[u8],
) -> Result<T, MessageError> {
    let wrong = |reason: String| MessageError::Kind { kind, reason };
    match form {
        Form::Protobuf => T::decode(data).map_err(|error| wrong(error.to_string())),
        Form::Json => serde_json::from_slice(data).map_err(|error| wrong(error.to_string())),
    }
}

fn stamp(kind: &'static str, time: Option<FoxgloveTime>) -> Result<i64, MessageError> {
    let missing = || MessageError::Kind { kind, reason: "no timestamp".to_owned() };
    time.map(|time| nanos(time.seconds, time.nanos.into())).ok_or_else(missing)
}

pub(super) fn image(form: Form, data: &[u8]) -> Result<ImageMessage<'_>, MessageError> {
    const KIND: &str = "foxglove.RawImage";
    let image: RawImage = decode(KIND, form, data)?;
    Ok(ImageMessage {
        stamp_nanos: stamp(KIND, image.timestamp)?,
        data: Cow::Owned(image.data),
        form: ImageForm::Raw {
            encoding: image.encoding,
            width: image.width,
            height: image.height,
            step: image.step as usize,
            is_big_endian: false,
        },
    })
}

pub(super) fn compressed(form: Form, data: &[u8]) -> Result<ImageMessage<'_>, MessageError> {
    const KIND: &str = "foxglove.FoxgloveImage";
    let image: FoxgloveImage = decode(KIND, form, data)?;
    Ok(ImageMessage {
        stamp_nanos: stamp(KIND, image.timestamp)?,
        data: Cow::Owned(image.data),
        form: ImageForm::File { format: image.format },
    })
}

pub(super) fn camera(form: Form, data: &[u8]) -> Result<CameraMessage, MessageError> {
    let camera: CameraCalibration = decode("foxglove.CameraCalibration", form, data)?;
    Ok(CameraMessage {
        frame: camera.frame_id,
        width: camera.width,
        height: camera.height,
        model: camera.distortion_model,
        distortion: camera.d,
        intrinsics: camera.k,
        projection: camera.p,
        window: SentWindow::default(),
    })
}
