//! `sensor_msgs/msg/Imu`: angular rates and specific forces.

use crate::error::MessageError;
use crate::messages::{MessageWire, of_wire};
use crate::{ros, ros1};

/// No gyroscope turns faster, radians per second.
const MOST_RAD_PER_S: f64 = 100.0;
/// No accelerometer measures more, metres per second squared.
const MOST_M_PER_S2: f64 = 500.0;

/// What is used of an Imu message.
#[derive(Clone, Debug, PartialEq)]
pub struct ImuMessage {
    /// Time of the measurement, nanoseconds.
    pub stamp_nanos: i64,
    /// Frame of its vectors.
    pub frame: String,
    /// Angular rate, radians per second; `None` where the message has none.
    pub rate_rad_per_s: Option<[f64; 3]>,
    /// Specific force, metres per second squared; `None` where the message has none: zero, or marked so.
    pub force_m_per_s2: Option<[f64; 3]>,
}

impl ImuMessage {
    /// Reads a `sensor_msgs/msg/Imu` in CDR.
    ///
    /// # Errors
    /// Where the bytes are no such message, or the numbers no measurement.
    pub fn read(message: &[u8]) -> Result<Self, MessageError> {
        ros::imu(message)?.checked()
    }

    pub(crate) fn of(wire: MessageWire, message: &[u8]) -> Result<Self, MessageError> {
        of_wire(wire, message, ros::imu, ros1::imu)?.checked()
    }
}

/// The numbers of a message. In a field without a measurement the first variance is -1.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ImuFields {
    pub(crate) stamp_nanos: i64,
    pub(crate) frame: String,
    pub(crate) rate: ([f64; 3], f64),
    pub(crate) force: ([f64; 3], f64),
}

impl ImuFields {
    fn checked(self) -> Result<ImuMessage, MessageError> {
        let of = |what: &str, (values, variance): ([f64; 3], f64), most: f64| {
            let is_measured = values.iter().all(|value| value.abs() <= most);
            match variance >= 0.0 {
                false => Ok(None),
                true if is_measured => Ok(Some(values)),
                true => Err(MessageError::Kind {
                    kind: "sensor_msgs/msg/Imu",
                    reason: format!("its {what} is {values:?}, expected at most {most}"),
                }),
            }
        };
        let rate_rad_per_s = of("angular_velocity in rad/s", self.rate, MOST_RAD_PER_S)?;
        let force = of("linear_acceleration in m/s^2", self.force, MOST_M_PER_S2)?;
        // Where a driver has no accelerometer, or leaves it to another topic.
        let force_m_per_s2 = force.filter(|force| *force != [0.0; 3]);
        let frame = self.frame.trim_start_matches('/').to_owned();
        Ok(ImuMessage { stamp_nanos: self.stamp_nanos, frame, rate_rad_per_s, force_m_per_s2 })
    }
}
