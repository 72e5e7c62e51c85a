//! Messages of ROS 1: fields one behind the other, little-endian, without padding.
//!
//! Source: wiki.ros.org/msg and the message definitions of ROS Noetic.

use crate::error::MessageError;
use crate::imu::ImuFields;
use crate::messages::{CameraMessage, ImageForm, ImageMessage, nanos};
use crate::ros::{BIG_ENDIAN, Extrinsics, RosPose};
use std::borrow::Cow;
use tessera_frames::SentWindow;

/// Most numbers of an array that is read: no distortion has more coefficients.
const MOST_REALS: usize = 64;
/// Most transforms of a message.
const MOST_TRANSFORMS: usize = 1 << 16;

/// The fields of a message that have not been read yet.
struct Fields<'a> {
    kind: &'static str,
    left: &'a [u8],
}

/// `std_msgs/Header`.
struct ConnectionHeader<'a> {
    stamp_nanos: i64,
    frame: Cow<'a, str>,
}

impl<'a> Fields<'a> {
    fn of(kind: &'static str, data: &'a [u8]) -> Self {
        Self { kind, left: data }
    }

    fn wrong(&self, reason: String) -> MessageError {
        MessageError::Kind { kind: self.kind, reason }
    }

    fn bytes(&mut self, n: usize) -> Result<&'a [u8], MessageError> {
        let split = self.left.split_at_checked(n);
        let (bytes, left) = split.ok_or_else(|| {
            self.wrong(format!("it ends {} bytes too early", n.saturating_sub(self.left.len())))
        })?;
        self.left = left;
        Ok(bytes)
    }

    fn chunk<const N: usize>(&mut self) -> Result<[u8; N], MessageError> {
        let too_early = N.saturating_sub(self.left.len());
        let split = self.left.split_first_chunk();
        let (chunk, left) =
            split.ok_or_else(|| self.wrong(format!("it ends {too_early} bytes too early")))?;
        self.left = left;
        Ok(*chunk)
    }

    fn word(&mut self) -> Result<u32, MessageError> {
        self.chunk().map(u32::from_le_bytes)
    }

    fn byte(&mut self) -> Result<u8, MessageError> {
        self.chunk().map(u8::from_le_bytes)
    }

    /// Bytes behind their number.
    fn counted(&mut self) -> Result<&'a [u8], MessageError> {
        let n = self.word()?;
        self.bytes(n as usize)
    }

    fn text(&mut self) -> Result<Cow<'a, str>, MessageError> {
        Ok(String::from_utf8_lossy(self.counted()?))
    }

    fn reals(&mut self, n: usize) -> Result<Vec<f64>, MessageError> {
        let bytes = self.bytes(n.saturating_mul(8))?;
        Ok(bytes.as_chunks().0.iter().map(|real| f64::from_le_bytes(*real)).collect())
    }

    fn array<const N: usize>(&mut self) -> Result<[f64; N], MessageError> {
        let mut reals = [0.0; N];
        for real in &mut reals {
            *real = self.chunk().map(f64::from_le_bytes)?;
        }
        Ok(reals)
    }

    /// Sequence, time and frame.
    fn header(&mut self) -> Result<ConnectionHeader<'a>, MessageError> {
        let _sequence = self.word()?;
        let stamp_nanos = nanos(self.word()?.into(), self.word()?.into());
        Ok(ConnectionHeader { stamp_nanos, frame: self.text()? })
    }
}

/// The time of a message that begins with a header, from its first bytes.
pub(crate) fn stamp_nanos(kind: &'static str, data: &[u8]) -> Result<i64, MessageError> {
    let mut fields = Fields::of(kind, data);
    let _sequence = fields.word()?;
    Ok(nanos(fields.word()?.into(), fields.word()?.into()))
}

pub(crate) fn image(data: &[u8]) -> Result<ImageMessage<'_>, MessageError> {
    let mut fields = Fields::of("sensor_msgs/Image", data);
    let stamp_nanos = fields.header()?.stamp_nanos;
    let (height, width) = (fields.word()?, fields.word()?);
    let encoding = fields.text()?.into_owned();
    let is_big_endian = fields.byte()? == BIG_ENDIAN;
    let step = fields.word()? as usize;
    let form = ImageForm::Raw { encoding, width, height, step, is_big_endian };
    Ok(ImageMessage { stamp_nanos, data: Cow::Borrowed(fields.counted()?), form })
}

pub(crate) fn compressed(data: &[u8]) -> Result<ImageMessage<'_>, MessageError> {
    let mut fields = Fields::of("sensor_msgs/CompressedImage", data);
    let stamp_nanos = fields.header()?.stamp_nanos;
    let form = ImageForm::File { format: fields.text()?.into_owned() };
    Ok(ImageMessage { stamp_nanos, data: Cow::Borrowed(fields.counted()?), form })
}

pub(crate) fn camera(data: &[u8]) -> Result<CameraMessage, MessageError> {
    let mut fields = Fields::of("sensor_msgs/CameraInfo", data);
    let frame = fields.header()?.frame.into_owned();
    let (height, width) = (fields.word()?, fields.word()?);
    let model = fields.text()?.into_owned();
    let n = fields.word()? as usize;
    if n > MOST_REALS {
        return Err(
            fields.wrong(format!("it has {n} coefficients of distortion, expected at most {MOST_REALS}"))
        );
    }
    let distortion = fields.reals(n)?;
    let intrinsics = fields.reals(9)?;
    let _rectification = fields.reals(9)?;
    let projection = fields.reals(12)?;
    let binning = [fields.word()?, fields.word()?];
    let first = [fields.word()?, fields.word()?];
    let (rows, columns) = (fields.word()?, fields.word()?);
    let window = SentWindow { binning, first, size: [columns, rows] };
    Ok(CameraMessage { frame, width, height, model, distortion, intrinsics, projection, window })
}

/// Parent, child and `parent_from_child` of each transform of a message.
pub(crate) fn transforms(data: &[u8]) -> Result<Vec<(String, String, RosPose)>, MessageError> {
    let mut fields = Fields::of("tf2_msgs/TFMessage", data);
    let n = fields.word()? as usize;
    let name = |name: Cow<'_, str>| name.trim_start_matches('/').to_owned();
    let one = |fields: &mut Fields<'_>| {
        let (parent, child) = (name(fields.header()?.frame), name(fields.text()?));
        let (position, orientation_xyzw) = (fields.array()?, fields.array()?);
        Ok((parent, child, RosPose { position, orientation_xyzw }))
    };
    (0..n.min(MOST_TRANSFORMS)).map(|_| one(&mut fields)).collect()
}

/// Rotation by columns and translation of a RealSense's `depth_to_color`.
pub(crate) fn extrinsics(data: &[u8]) -> Result<Extrinsics, MessageError> {
    let mut fields = Fields::of("realsense2_camera/Extrinsics", data);
    fields.header()?;
    Ok(Extrinsics { rotation: fields.array()?, translation: fields.array()? })
}

pub(crate) fn imu(data: &[u8]) -> Result<ImuFields, MessageError> {
    let mut fields = Fields::of("sensor_msgs/Imu", data);
    let ConnectionHeader { stamp_nanos, frame } = fields.header()?;
    let (_orientation, _covariance) = (fields.array::<4>()?, fields.array::<9>()?);
    let mut vector = || -> Result<([f64; 3], f64), MessageError> {
        let (values, [variance, ..]) = (fields.array()?, fields.array::<9>()?);
        Ok((values, variance))
    };
    Ok(ImuFields { stamp_nanos, frame: frame.into_owned(), rate: vector()?, force: vector()? })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> Vec<u8> {
        [7u32, 3, 5, 1].iter().flat_map(|word| word.to_le_bytes()).chain(*b"c").collect()
    }

    #[test]
    fn an_image_is_read_and_one_that_ends_early_is_refused() {
        let mut data = header();
        data.extend([2u32, 3, 5].iter().flat_map(|word| word.to_le_bytes()));
        data.extend(b"16UC1\0\x06\0\0\0\x0c\0\0\0");
        data.extend(0..12);
        let found = image(&data).unwrap();
        assert_eq!((found.stamp_nanos, found.data.len()), (3_000_000_005, 12));
        let ImageForm::Raw { encoding, width, height, step, is_big_endian } = found.form else { panic!() };
        assert_eq!((encoding.as_str(), width, height, step, is_big_endian), ("16UC1", 3, 2, 6, false));
        assert_eq!(stamp_nanos("x", &data[..12]).unwrap(), 3_000_000_005);
        for n in 0..data.len() {
            let words = image(&data[..n]).unwrap_err().to_string();
            assert!(words.contains("sensor_msgs/Image: it ends"), "{n}: {words}");
        }
    }

    #[test]
    fn what_an_array_declares_is_not_believed() {
        let mut data = header();
        data.extend([480u32, 640, 0, u32::MAX].iter().flat_map(|word| word.to_le_bytes()));
        assert!(camera(&data).unwrap_err().to_string().contains("4294967295 coefficients"));
        assert!(transforms(&u32::MAX.to_le_bytes()).unwrap_err().to_string().contains("it ends"));
    }
}
