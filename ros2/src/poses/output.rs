//! Poses of the run into the network: odometry, transforms, the way so far, diagnostics.

use crate::carrier::{
    Carrier, CarrierError, DIAGNOSTICS, INITIAL_POSE, ODOMETRY, PATH, Publication, Quality, TRANSFORMS,
};
use crate::error::Ros2Error;
use crate::poses::base::{Base, pose, velocity};
use crate::poses::path::PosePath;
use std::borrow::Cow;
use tessera_geometry::Pose;
use tessera_messages::PoseMessage;
use tessera_recording::ros::{
    Covariance, DiagnosticArray, DiagnosticStatus, Header, KeyValue, Odometry, Path, PoseStamped,
    PoseWithCovariance, PoseWithCovarianceStamped, Time, TransformStamped, Transforms, TwistWithCovariance,
    encode,
};
use tessera_slam::WorldUp;

const MAP: &str = "map";
const ODOM: &str = "odom";
/// Variance of what is not known.
const UNKNOWN: f64 = 1e6;
/// State of a pose that was measured, and of one that was found again.
const TRACKING: u32 = 0;
const LOST: u32 = 1;
/// Longest time over which a velocity is taken.
const MOST_SECONDS: f64 = 0.5;

/// What is published.
pub(crate) struct Output {
    odometry: Box<dyn Publication>,
    /// In `map`.
    pose: Box<dyn Publication>,
    path: Box<dyn Publication>,
    diagnostics: Box<dyn Publication>,
    transforms: Option<Box<dyn Publication>>,
    way: PosePath,
    before: Option<Before>,
    map_from_odom: Pose,
    newest_nanos: i64,
    /// Of the run's newest pose.
    pub(crate) state: u32,
    pub(crate) reason: String,
    pub(crate) n_poses: u64,
}

/// The pose before: its time, the pose of the base, and the covariance of the camera's with its references fixed
/// where it was tracked.
struct Before {
    stamp_nanos: i64,
    odom_from_base: Pose,
    step_covariance: [[f64; 6]; 6],
}

/// Covariance of the camera's pose with its references fixed: what these err by is common to the poses before and
/// after, and cancels in a velocity. Where a direction is degenerate it is unknown, and the pose's own bounds it.
fn step_covariance(message: &PoseMessage) -> [[f64; 6]; 6] {
    let of = &message.step_variance;
    if message.state == LOST {
        return [[0.0; 6]; 6];
    }
    if of.iter().all(|variance| *variance == 0.0) {
        return message.covariance;
    }
    std::array::from_fn(|row| std::array::from_fn(|column| if row == column { of[row] } else { 0.0 }))
}

impl Output {
    /// Announces the topics.
    ///
    /// # Errors
    /// Where the network refuses one.
    pub(crate) fn new(
        carrier: &mut dyn Carrier,
        namespace: &str,
        has_transforms: bool,
    ) -> Result<Self, CarrierError> {
        let transforms =
            has_transforms.then(|| carrier.publish("/tf", TRANSFORMS, Quality::TRANSFORMS)).transpose()?;
        Ok(Self {
            odometry: carrier.publish(&format!("{namespace}/odom"), ODOMETRY, Quality::DEFAULT)?,
            pose: carrier.publish(&format!("{namespace}/pose"), INITIAL_POSE, Quality::DEFAULT)?,
            path: carrier.publish(
                &format!("{namespace}/path"),
                PATH,
                Quality { depth: 1, ..Quality::DEFAULT },
            )?,
            diagnostics: carrier.publish("/diagnostics", DIAGNOSTICS, Quality::DEFAULT)?,
            transforms,
            way: PosePath::default(),
            before: None,
            map_from_odom: Pose::identity(),
            newest_nanos: 0,
            state: TRACKING,
            reason: String::new(),
            n_poses: 0,
        })
    }

    /// Another run begins: `odom` begins anew with it.
    pub(crate) fn begin_run(&mut self) {
        (self.way, self.before, self.map_from_odom) = (PosePath::default(), None, Pose::identity());
        (self.state, self.reason, self.n_poses) = (TRACKING, String::new(), 0);
    }

    /// Publishes a pose of the run at the camera's time `stamp_nanos`. Of a lost frame there is
    /// odometry of unknown certainty and no transform.
    ///
    /// # Errors
    /// Where the network refuses a message.
    pub(crate) fn publish_pose(
        &mut self,
        message: &PoseMessage,
        (base, world_up): (&Base, WorldUp),
        stamp_nanos: i64,
    ) -> Result<(), Ros2Error> {
        let map_from_world = base.map_from_world(world_up);
        let odom_from_base = base.pose_in(&map_from_world, &pose(&message.odom_from_camera));
        self.map_from_odom = map_from_world * pose(&message.world_from_odom) * map_from_world.inverse();
        self.newest_nanos = stamp_nanos;
        (self.state, self.reason) = (message.state, message.reason_text());
        self.n_poses += 1;
        let is_lost = message.state == LOST;
        let covariance = base.covariance(&message.covariance, &odom_from_base).filter(|_| !is_lost);
        let now = Before { stamp_nanos, odom_from_base, step_covariance: step_covariance(message) };
        let odometry = self.odometry(&now, covariance, base);
        self.odometry.send(&encode(&odometry)?)?;
        self.before = Some(now);
        let map_from_base = self.map_from_odom * odom_from_base;
        let covariance = base.covariance(&message.covariance, &map_from_base).filter(|_| !is_lost);
        self.send_pose(stamp_nanos, &odom_from_base, covariance)?;
        if is_lost {
            return Ok(());
        }
        self.way.add(stamp_nanos, odom_from_base);
        if let Some(transforms) = &mut self.transforms {
            let link = |parent, child: &str, transform: &Pose| TransformStamped {
                header: header(stamp_nanos, parent),
                child_frame_id: Cow::Owned(child.to_owned()),
                transform: transform.into(),
            };
            let links = vec![link(MAP, ODOM, &self.map_from_odom), link(ODOM, &base.frame, &odom_from_base)];
            transforms.send(&encode(&Transforms { transforms: links })?)?;
        }
        Ok(())
    }

    /// Answers an image at the camera's time `stamp_nanos` that has no pose: odometry and pose of unknown certainty
    /// at the last place, as of a lost frame, and no transform.
    ///
    /// # Errors
    /// Where the network refuses a message.
    pub(crate) fn publish_unknown(&mut self, base: &Base, stamp_nanos: i64) -> Result<(), Ros2Error> {
        let odom_from_base = self.before.as_ref().map_or_else(Pose::identity, |before| before.odom_from_base);
        let now = Before { stamp_nanos, odom_from_base, step_covariance: [[0.0; 6]; 6] };
        let odometry = self.odometry(&now, None, base);
        self.odometry.send(&encode(&odometry)?)?;
        self.send_pose(stamp_nanos, &odom_from_base, None)
    }

    /// Sends a pose of the base in `map`; a covariance that is not known is stated as such.
    fn send_pose(
        &mut self,
        stamp_nanos: i64,
        odom_from_base: &Pose,
        covariance: Option<Covariance>,
    ) -> Result<(), Ros2Error> {
        let map_from_base = self.map_from_odom * odom_from_base;
        let pose = PoseWithCovariance {
            pose: (&map_from_base).into(),
            covariance: covariance.unwrap_or_else(unknown),
        };
        Ok(self.pose.send(&encode(&PoseWithCovarianceStamped { header: header(stamp_nanos, MAP), pose })?)?)
    }

    fn odometry<'a>(&self, now: &Before, covariance: Option<Covariance>, base: &'a Base) -> Odometry<'a> {
        let moved = self.before.as_ref().and_then(|before| {
            let seconds = now.stamp_nanos.saturating_sub(before.stamp_nanos) as f64 * 1e-9;
            (seconds > 0.0 && seconds < MOST_SECONDS).then(|| {
                let before_from_now = before.odom_from_base.inverse() * now.odom_from_base;
                let of = [&before.step_covariance, &now.step_covariance];
                let covariance = base.velocity_covariance(of, &before_from_now, seconds);
                (velocity(&before.odom_from_base, &now.odom_from_base, seconds), covariance)
            })
        });
        let ((linear, angular), of_twist) = moved.unwrap_or_default();
        Odometry {
            header: header(now.stamp_nanos, ODOM),
            child_frame_id: Cow::Borrowed(&base.frame),
            pose: PoseWithCovariance {
                pose: (&now.odom_from_base).into(),
                covariance: covariance.unwrap_or_else(unknown),
            },
            twist: TwistWithCovariance { linear, angular, covariance: of_twist.unwrap_or_else(unknown) },
        }
    }

    /// `map_from_base` of the newest pose, where that is not lost.
    pub(crate) fn map_from_base(&self) -> Option<Pose> {
        let newest = self.before.as_ref().filter(|_| self.state != LOST)?;
        Some(self.map_from_odom * newest.odom_from_base)
    }

    /// Publishes the way so far, with the newest correction.
    ///
    /// # Errors
    /// Where the network refuses it.
    pub(crate) fn publish_path(&mut self) -> Result<(), Ros2Error> {
        if self.way.poses().is_empty() {
            return Ok(());
        }
        let of = |(stamp_nanos, odom_from_base): &(i64, Pose)| PoseStamped {
            header: header(*stamp_nanos, MAP),
            pose: (&(self.map_from_odom * odom_from_base)).into(),
        };
        let path =
            Path { header: header(self.newest_nanos, MAP), poses: self.way.poses().iter().map(of).collect() };
        Ok(self.path.send(&encode(&path)?)?)
    }

    /// Publishes the state of a run at the time `now_nanos`, with numbers by name; `silent` says why it has
    /// none.
    ///
    /// # Errors
    /// Where the network refuses it.
    pub(crate) fn publish_diagnostics(
        &mut self,
        run: &str,
        silent: Option<String>,
        values: &[(String, String)],
        now_nanos: i64,
    ) -> Result<(), Ros2Error> {
        let (level, message) = match (silent, self.state) {
            (Some(words), _) => (DiagnosticStatus::STALE, words),
            (None, _) if self.n_poses == 0 => (DiagnosticStatus::WARN, "no pose yet".to_owned()),
            (None, TRACKING) => (DiagnosticStatus::OK, "tracking".to_owned()),
            (None, LOST) => (DiagnosticStatus::ERROR, format!("lost: {}", self.reason)),
            (None, _) => (DiagnosticStatus::WARN, format!("found again: {}", self.reason)),
        };
        let values =
            values.iter().map(|(key, value)| KeyValue { key: key.into(), value: value.into() }).collect();
        let status = DiagnosticStatus {
            level,
            name: format!("tessera: {run}").into(),
            message: message.into(),
            hardware_id: "".into(),
            values,
        };
        let array = DiagnosticArray { header: header(now_nanos, ""), status: vec![status] };
        Ok(self.diagnostics.send(&encode(&array)?)?)
    }
}

fn header(stamp_nanos: i64, frame: &'static str) -> Header<'static> {
    Header { stamp: Time::from_nanos(stamp_nanos), frame_id: frame.into() }
}

fn unknown() -> Covariance {
    std::array::from_fn(|row| std::array::from_fn(|column| if row == column { UNKNOWN } else { 0.0 }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_messages::StepTimes;

    #[test]
    fn a_velocity_has_the_covariances_with_fixed_references_where_they_are_known() {
        let whole = std::array::from_fn(|row| std::array::from_fn(|column| 1.0 + (row * column) as f64));
        let step_variance = [1e-6, 2e-6, 3e-6, 4e-8, 5e-8, 6e-8];
        let message = PoseMessage {
            index: 0,
            stamp_nanos: 0,
            state: TRACKING,
            n_correspondences: 0,
            reason: [0; 64],
            odom_from_camera: [0.0; 7],
            world_from_odom: [0.0; 7],
            covariance: whole,
            step_variance,
            times: StepTimes::default(),
        };
        let of_step = step_covariance(&message);
        assert_eq!(std::array::from_fn(|k| of_step[k][k]), step_variance);
        assert_eq!(of_step.iter().flatten().filter(|value| **value != 0.0).count(), 6);
        // A degenerate direction: the pose's covariance bounds it. Lost: nothing is known.
        assert_eq!(step_covariance(&PoseMessage { step_variance: [0.0; 6], ..message }), whole);
        assert_eq!(step_covariance(&PoseMessage { state: LOST, ..message }), [[0.0; 6]; 6]);
    }
}
