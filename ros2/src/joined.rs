//! A run as long as it is joined: its poses, and what they tell of it.

use crate::camera::input::CameraInput;
use crate::camera::sender::Sender;
use crate::error::Ros2Error;
use crate::network::ros_time::RosTime;
use crate::poses::output::Output;
use crate::report::{Report, ReportEvent};
use crate::run::JoinedRun;
use std::time::Duration;
use tessera_messages::PoseMessage;
use tessera_slam::WorldUp;
use tessera_transport::Subscriber;

/// A run with its poses.
pub(crate) struct Joined {
    poses: Option<Subscriber<PoseMessage>>,
    /// Frames that the run left out, as the gaps between its poses tell.
    pub(crate) n_dropped: u64,
    last_index: Option<u64>,
    /// Axes of the run's world, once it has a pose.
    world_up: Option<WorldUp>,
    /// From an image handed to the run to its pose, of the newest one.
    pub(crate) latency: Option<Duration>,
    /// From an image's time to the pose, milliseconds, where both are of one clock.
    pub(crate) age_ms: Option<f64>,
    /// Last: ports go before the node.
    pub(crate) run: JoinedRun,
}

impl Joined {
    pub(crate) fn new(run: JoinedRun) -> Self {
        Self { poses: None, n_dropped: 0, last_index: None, world_up: None, latency: None, age_ms: None, run }
    }

    /// Opens the poses once the run has made them.
    ///
    /// # Errors
    /// Where they cannot be opened.
    pub(crate) fn look(&mut self) -> Result<(), Ros2Error> {
        if self.poses.is_none() {
            self.poses = self.run.guest.pose_subscriber()?;
        }
        Ok(())
    }

    /// Publishes all poses that came.
    ///
    /// # Errors
    /// Where the run's shared memory is broken, or a message cannot be written as CDR.
    pub(crate) fn take_poses(
        &mut self,
        input: &mut CameraInput,
        output: &mut Output,
        time: &RosTime,
        report: &mut Report,
    ) -> Result<(), Ros2Error> {
        let Some(poses) = &self.poses else { return Ok(()) };
        while let Some(pose) = poses.receive()? {
            if let Err(refusal) = pose.validate() {
                report.note(ReportEvent::Malformed, || format!("pose: {refusal}"));
                continue;
            }
            // Published again after a death in the run.
            if self.last_index.is_some_and(|last| pose.index <= last) {
                continue;
            }
            input.clock.begin_after(pose.stamp_nanos);
            let gap = self.last_index.map_or(0, |last| pose.index.saturating_sub(last.saturating_add(1)));
            self.n_dropped = self.n_dropped.saturating_add(gap);
            self.last_index = Some(pose.index);
            if let Some(sender) = input.sender()
                && let Some(received_at) = sender.received_at(pose.stamp_nanos)
            {
                self.latency = Some(received_at.elapsed());
            }
            let Some(base) = input.base() else { continue };
            let stamp_nanos = input.clock.camera_nanos(pose.stamp_nanos);
            self.age_ms = time.age_ms(stamp_nanos);
            let world_up = match self.world_up {
                Some(world_up) => world_up,
                // It has a pose, so it has written what it is.
                None => *self.world_up.insert(self.run.world_up()?.unwrap_or_default()),
            };
            match output.publish_pose(&pose, (base, world_up), stamp_nanos) {
                Err(Ros2Error::Carrier(error)) => report.note(ReportEvent::Carrier, || error.to_string()),
                other => other?,
            }
        }
        answer_late(input, output, report)
    }
}

/// Answers the newest image where its pose does not come: it was left out, as one whose time lies far ahead is until
/// the next one confirms it. So no camera waits for ever.
fn answer_late(input: &mut CameraInput, output: &mut Output, report: &mut Report) -> Result<(), Ros2Error> {
    let Some(run_nanos) = input.sender().and_then(Sender::take_late) else { return Ok(()) };
    let stamp_nanos = input.clock.camera_nanos(run_nanos);
    report.note(ReportEvent::Late, || {
        format!(
            "no pose came for the image of {stamp_nanos} ns, and no image behind it: it is answered with odometry of \
             unknown certainty"
        )
    });
    let Some(base) = input.base() else { return Ok(()) };
    match output.publish_unknown(base, stamp_nanos) {
        Err(Ros2Error::Carrier(error)) => report.note(ReportEvent::Carrier, || error.to_string()),
        other => other?,
    }
    Ok(())
}
