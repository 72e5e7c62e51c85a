//! `sensor_msgs/msg/Imu`: its angular rate, read from CDR.

use crate::cdr::Reader;
use tessera_recording::ros::Time;

/// Orientation and its covariance stand between the header and the rate: numbers of 8 bytes.
const N_BEFORE_RATE: usize = 4 + 9;
/// No gyroscope turns faster, radians per second.
const MOST_RAD_PER_S: f64 = 100.0;

/// What is used of a message.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ImuRate {
    pub(crate) stamp_nanos: i64,
    /// Frame of the rate.
    pub(crate) frame: String,
    /// Radians per second.
    pub(crate) rate_rad_per_s: [f64; 3],
}

/// The rate of a message with its encapsulation.
///
/// # Errors
/// In words, where it is no such message or has no rate.
pub(crate) fn read(message: &[u8]) -> Result<ImuRate, String> {
    let short = || format!("no sensor_msgs/msg/Imu: {} bytes", message.len());
    let mut reader = Reader::new(message).ok_or_else(short)?;
    let found = parse(&mut reader).ok_or_else(short)?;
    let (rate, variance) = found;
    let is_rate = |value: &f64| value.abs() <= MOST_RAD_PER_S;
    if variance < 0.0 || !rate.rate_rad_per_s.iter().all(is_rate) {
        let found = rate.rate_rad_per_s;
        return Err(format!(
            "an Imu with the rate {found:?} rad/s and variance {variance}, expected a gyroscope's"
        ));
    }
    Ok(rate)
}

/// The rate, and the first of its variances: -1 where the instrument has none.
fn parse(reader: &mut Reader<'_>) -> Option<(ImuRate, f64)> {
    let stamp = Time { sec: reader.word()? as i32, nanosec: reader.word()? };
    let frame = reader.text()?.trim_start_matches('/').to_owned();
    for _ in 0..N_BEFORE_RATE {
        reader.number()?;
    }
    let rate_rad_per_s = [reader.number()?, reader.number()?, reader.number()?];
    Some((ImuRate { stamp_nanos: stamp.nanos(), frame, rate_rad_per_s }, reader.number()?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Serialize;
    use tessera_recording::ros::{Header, encode};

    #[derive(Serialize)]
    struct Imu<'a> {
        header: Header<'a>,
        orientation: [f64; 4],
        orientation_covariance: [f64; 9],
        rate: [f64; 3],
        rate_covariance: [f64; 9],
        acceleration: [f64; 3],
        acceleration_covariance: [f64; 9],
    }

    fn message(frame: &str, rate: [f64; 3], variance: f64) -> Vec<u8> {
        let mut rate_covariance = [0.0; 9];
        rate_covariance[0] = variance;
        encode(&Imu {
            header: Header { stamp: Time::from_nanos(5_000_000_007), frame_id: frame.into() },
            orientation: [0.1, 0.2, 0.3, 0.4],
            orientation_covariance: [-1.0; 9],
            rate,
            rate_covariance,
            acceleration: [9.0; 3],
            acceleration_covariance: [0.0; 9],
        })
        .unwrap()
    }

    #[test]
    fn the_rate_is_read_whatever_the_length_of_the_frame() {
        for frame in ["", "imu", "/imu_link", "camera_gyro_optical_frame"] {
            let read = read(&message(frame, [0.5, -1.5, 2.5], 0.0)).unwrap();
            assert_eq!(
                (read.stamp_nanos, read.frame.as_str()),
                (5_000_000_007, frame.trim_start_matches('/'))
            );
            assert_eq!(read.rate_rad_per_s, [0.5, -1.5, 2.5]);
        }
    }

    #[test]
    fn what_is_no_rate_is_refused() {
        let good = message("imu", [0.0; 3], 0.0);
        assert!((0..good.len() - 8 * 20).all(|len| read(&good[..len]).is_err()));
        assert!(read(&message("imu", [0.0; 3], -1.0)).unwrap_err().contains("variance -1"));
        for rate in [f64::NAN, 101.0, f64::NEG_INFINITY] {
            assert!(read(&message("imu", [0.0, rate, 0.0], 0.0)).is_err());
        }
        let mut endless = good;
        endless[12..16].fill(255);
        assert!(read(&endless).is_err());
    }
}
