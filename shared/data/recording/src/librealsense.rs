//! What librealsense's own recorder (`rs-record`, RealSense Viewer) writes in its own way: names of topics as
//! `/device_0/sensor_0/Depth_0/image/data`, units of depth as an option, and in bags of ROS 1 each stream's place as
//! a transform without names.

use crate::error::MessageError;
use crate::ros::RosPose;

/// Topics of units end so.
const UNITS: &str = "/option/Depth_Units/value";
/// Topics of a stream's place have this before the group of its reference.
const PLACE: &str = "/tf/";
/// Frame of the streams' reference, as the recorder's newer files name it.
pub(super) const REFERENCE: &str = "ref_";

/// Whether a topic says the units of depth of a sensor.
pub(super) fn is_units(topic: &str) -> bool {
    topic.starts_with("/device_") && topic.ends_with(UNITS)
}

/// Whether a topic says the units of the sensor of some images.
pub(super) fn is_units_of(topic: &str, images: &str) -> bool {
    let sensor = |topic: &str| topic.split('/').skip(1).take(2).map(str::to_owned).collect::<Vec<String>>();
    is_units(topic) && sensor(topic) == sensor(images)
}

/// Device, sensor and stream of a topic; `None`: it is none of librealsense. Messages have no names of frames.
pub(super) fn stream_of(topic: &str) -> Option<String> {
    let mut parts = topic.strip_prefix("/device_")?.split('/');
    let (device, sensor, stream) = (parts.next()?, parts.next()?, parts.next()?);
    // Options of a sensor are no stream.
    (stream != "option" && parts.next().is_some()).then(|| format!("{device}/{sensor}/{stream}"))
}

/// Frame of the stream and of its reference where a topic says its place.
pub(super) fn placed_by(topic: &str) -> Option<(String, String)> {
    let (stream, group) = topic.rsplit_once(PLACE)?;
    let child = stream_of(&format!("{stream}/"))?;
    Some((child, format!("{REFERENCE}{group}")))
}

/// Units of a metre from metres of a unit: a float of ROS 1, or words behind their length of ROS 2.
///
/// # Errors
/// The bytes are neither, or no length.
pub(super) fn units_per_metre(data: &[u8]) -> Result<f64, MessageError> {
    let wrong = |reason: String| MessageError::Kind { kind: "Depth_Units", reason };
    let metres = match data {
        [a, b, c, d] => f64::from(f32::from_le_bytes([*a, *b, *c, *d])),
        _ => {
            let words = data.get(8..).unwrap_or_default();
            let words = String::from_utf8_lossy(words).trim_end_matches('\0').trim().to_owned();
            words.parse().map_err(|_| wrong(format!("found '{words}', expected metres of a unit")))?
        }
    };
    if !(1e-6..=1.0).contains(&metres) {
        return Err(wrong(format!("found {metres} m, expected 0.000001 to 1")));
    }
    let (units, whole) = (1.0 / metres, (1.0 / metres).round());
    // 0.00025 as a float of 32 bits.
    Ok(if (units - whole).abs() < 1e-5 * units { whole } else { units })
}

/// `reference_from_stream`: the recorder writes the inverse.
///
/// # Errors
/// The bytes end too early.
pub(super) fn place(data: &[u8]) -> Result<RosPose, MessageError> {
    let mut numbers = data.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes));
    let mut next = || numbers.next().unwrap_or(f64::NAN);
    let position = [next(), next(), next()];
    let orientation_xyzw = [next(), next(), next(), next()];
    if orientation_xyzw.iter().any(|number| !number.is_finite()) {
        let reason = format!("{} bytes, expected the 56 of a transform", data.len());
        return Err(MessageError::Kind { kind: "geometry_msgs/Transform", reason });
    }
    Ok(RosPose { position, orientation_xyzw })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_have_their_streams() {
        let depth = "/device_0/sensor_0/Depth_0/image/data";
        assert_eq!(stream_of(depth).as_deref(), Some("0/sensor_0/Depth_0"));
        assert_eq!(stream_of("/camera/depth/image/data"), None);
        let place = placed_by("/device_0/sensor_1/Color_0/tf/1");
        assert_eq!(place, Some(("0/sensor_1/Color_0".to_owned(), "ref_1".to_owned())));
        assert!(is_units_of("/device_0/sensor_0/option/Depth_Units/value", depth));
        assert!(!is_units_of("/device_0/sensor_1/option/Depth_Units/value", depth));
    }

    #[test]
    fn units_are_numbers_or_words() {
        assert_eq!(units_per_metre(&0.00025f32.to_le_bytes()).unwrap(), 4000.0);
        assert_eq!(units_per_metre(b"\0\x01\0\0\x09\0\0\x000.001000\0").unwrap(), 1000.0);
        for data in [&b"\0\x01\0\0\x04\0\0\0abc\0"[..], &0f32.to_le_bytes(), b""] {
            assert!(units_per_metre(data).unwrap_err().to_string().contains("expected"));
        }
    }
}
