//! The aligner's connections: surfaces in; poses, flow and wake-ups out.

use crate::desk::Desk;
use crate::flow::FlowControl;
use crate::inbox::Inbox;
use crate::publish::pose_message;
use tessera_mapping::FrameRecord;
use tessera_messages::{Flow, PoseMessage, Stage, StepTimes, WaitingOn};
use tessera_stage::{Context, IDLE, Pulse, StageError, monotonic_nanos};
use tessera_transport::{Bell, Ear, Link, Publisher};

/// All connections of the aligner.
pub(crate) struct Ports {
    pub(crate) inbox: Inbox,
    pub(crate) control: FlowControl,
    pub(crate) pulse: Pulse,
    /// Nothing was received yet: a writer's history may be under way.
    pub(crate) is_fresh: bool,
    ear: Ear,
    poses: Publisher<PoseMessage>,
    flow: Publisher<Flow>,
    sensor: Bell,
    optimise: Bell,
}

impl Ports {
    pub(crate) fn open(link: &Link, context: &Context) -> Result<Self, StageError> {
        Ok(Self {
            ear: link.ear(Stage::Align)?,
            inbox: Inbox::open(link, context.run.n_frames)?,
            control: FlowControl::begin(0, 0),
            is_fresh: true,
            poses: link.pose_publisher()?,
            flow: link.flow_publisher()?,
            sensor: link.bell(Stage::Sensor)?,
            optimise: link.bell(Stage::Optimise)?,
            pulse: Pulse::start(link, Stage::Align, &context.stopwatch)?,
        })
    }

    /// Goes on in the epoch of a predecessor, whose surfaces `seen` came by the history, and says so.
    pub(crate) fn adopt_epoch(
        &mut self,
        epoch: u64,
        next: u64,
        seen: &[(u64, u64)],
    ) -> Result<(), StageError> {
        let now = monotonic_nanos();
        self.control = FlowControl::adopt(epoch, next, now);
        seen.iter().for_each(|&(index, epoch)| self.control.saw(index, epoch, now));
        self.tell_sensor()
    }

    /// Begins an epoch at the first index that is missing, and says so.
    pub(crate) fn begin_epoch(&mut self, first_missing: u64) -> Result<(), StageError> {
        self.control = FlowControl::begin(first_missing, monotonic_nanos());
        self.tell_sensor()
    }

    /// Publishes the last frame's pose again.
    pub(crate) fn publish_again(&mut self, desk: &Desk) -> Result<(), StageError> {
        if let Some(record) = &desk.known.last_frame {
            self.poses.send(pose_message(record, StepTimes::default()))?;
        }
        Ok(())
    }

    /// Publishes a frame's pose.
    pub(crate) fn publish(&mut self, record: &FrameRecord, mut times: StepTimes) -> Result<(), StageError> {
        times.pose_sent = monotonic_nanos();
        self.poses.send(pose_message(record, times))?;
        self.pulse.output(record.index);
        if times.frame_sent > 0 {
            self.pulse.published(times.pose_sent.saturating_sub(times.frame_sent));
        }
        Ok(())
    }

    /// Sends the flow and wakes the sensor.
    pub(crate) fn tell_sensor(&mut self) -> Result<(), StageError> {
        self.flow.send(self.control.flow())?;
        self.sensor.ring();
        Ok(())
    }

    /// Wakes the optimiser: the journal has grown by something that matters to it.
    pub(crate) fn tell_optimiser(&self) {
        self.optimise.ring();
    }

    /// Sleeps until something comes, at most [`IDLE`].
    pub(crate) fn wait(&mut self, on: WaitingOn) -> Result<(), StageError> {
        self.pulse.waiting(on);
        if !self.ear.wait(IDLE)? {
            // Nobody rang: whoever came late gets what was said last.
            self.flow.update();
            self.poses.update();
        }
        Ok(())
    }

    /// Throws away what is held of the flow.
    pub(crate) fn forget(&mut self) {
        self.inbox.clear();
    }
}
