//! `/initialpose`, as RViz and Nav2 send it: somebody knows where the robot is. The run is asked to look for
//! its place anew, in the whole map; how far what it finds is from what was given, is told.

use crate::camera::sender::Sender;
use crate::carrier::{Carrier, CarrierError, INITIAL_POSE, Quality, Subscription};
use crate::poses::base::pose;
use crate::report::take;
use crate::report::{Report, ReportEvent};
use std::time::{Duration, Instant};
use tessera_geometry::Pose;
use tessera_recording::ros::{Header, RosPose, decode};

/// Its name in ROS.
const TOPIC: &str = "/initialpose";
const MAP: &str = "map";
/// After so long what the run has found is compared with what was given.
const TO_FIND: Duration = Duration::from_secs(2);
/// A quaternion's length is 1 but for so much.
const UNIT_WITHIN: f64 = 1e-3;

/// The topic, and what was given last.
pub(crate) struct InitialPose {
    messages: Box<dyn Subscription>,
    given: Option<(Pose, Instant)>,
}

impl InitialPose {
    /// Announces the topic.
    ///
    /// # Errors
    /// Where the network refuses it.
    pub(crate) fn new(carrier: &mut dyn Carrier) -> Result<Self, CarrierError> {
        let messages = carrier.subscribe(TOPIC, INITIAL_POSE, Quality::SENSOR)?;
        Ok(Self { messages, given: None })
    }

    /// Takes in what came, and has the next image ask; `found` is `map_from_base` by the run's newest pose,
    /// where that is not lost.
    pub(crate) fn step(&mut self, found: Option<Pose>, sender: Option<&mut Sender>, report: &mut Report) {
        let mut newest = None;
        while let Some(message) = take(&mut *self.messages, report) {
            match read(&message) {
                Ok(given) => newest = Some(given),
                Err(why) => report.note(ReportEvent::Malformed, || format!("{TOPIC}: {why}")),
            }
        }
        if let Some(given) = newest {
            match sender {
                Some(sender) => {
                    sender.asks_relocalisation = true;
                    self.given = Some((given, Instant::now()));
                    report.say(&format!("{TOPIC}: the run looks for its place anew, in the whole map"));
                }
                None => report.say(&format!("{TOPIC}: there are no images yet: nothing is asked for")),
            }
        }
        let Some((given, at)) = self.given else { return };
        if at.elapsed() >= TO_FIND
            && let Some(found) = found
        {
            self.given = None;
            report.say(&format!("{TOPIC}: {}", difference(&given, &found)));
        }
    }
}

/// How far both are apart, for people.
fn difference(given: &Pose, found: &Pose) -> String {
    let apart = given.inv_mul(found);
    let [x, y] = [found.translation.x, found.translation.y];
    format!(
        "the run is at x {x:.2} m, y {y:.2} m, {:.2} m and {:.0} degrees from what was given",
        apart.translation.vector.xy().norm(),
        apart.rotation.angle().to_degrees()
    )
}

/// The pose of a `geometry_msgs/msg/PoseWithCovarianceStamped` in `map`.
///
/// # Errors
/// In words, where it is none.
fn read(message: &[u8]) -> Result<Pose, String> {
    let short = || format!("no geometry_msgs/msg/PoseWithCovarianceStamped: {} bytes", message.len());
    let (header, RosPose { position: [x, y, z], orientation_xyzw: [qx, qy, qz, qw] }): (Header<'_>, _) =
        decode("pose", message).map_err(|_| short())?;
    let (frame, numbers) = (header.frame_id, [x, y, z, qx, qy, qz, qw]);
    if frame.trim_start_matches('/') != MAP {
        return Err(format!("a pose in {frame:?}, expected {MAP}"));
    }
    let norm = numbers[3..].iter().map(|value| value * value).sum::<f64>().sqrt();
    let is_pose = numbers.iter().all(|value| value.is_finite()) && (norm - 1.0).abs() < UNIT_WITHIN;
    is_pose.then(|| pose(&numbers)).ok_or_else(|| format!("{numbers:?} is no pose"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_recording::ros::{PoseWithCovariance, Time, encode};

    fn message(frame: &str, orientation_xyzw: [f64; 4]) -> Vec<u8> {
        let header = Header { stamp: Time::from_nanos(1), frame_id: frame.into() };
        let pose = RosPose { position: [3.0, -4.0, 0.0], orientation_xyzw };
        encode(&(header, PoseWithCovariance { pose, covariance: [[0.0; 6]; 6] })).unwrap()
    }

    #[test]
    fn a_pose_in_the_map_is_read_and_others_are_refused_in_words() {
        let turned = [0.0, 0.0, 0.6, 0.8];
        let given = read(&message("map", turned)).unwrap();
        let words = difference(&given, &Pose::translation(0.0, 0.0, 0.5));
        assert!(words.contains("5.00 m and 74 degrees"), "{words}");
        assert!(read(&message("odom", turned)).unwrap_err().contains("expected map"));
        assert!(read(&message("map", [0.0; 4])).unwrap_err().contains("is no pose"));
        let good = message("map", turned);
        assert!(read(&good[..60]).unwrap_err().contains("60 bytes"));
    }
}
